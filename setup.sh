#!/usr/bin/env bash
# Installs what camsplat needs beside Rust: a Vulkan loader, the software driver lavapipe, validation layers, and the
# archives of shaderc merged into one (so that the build need not compile shaderc from source).
# Safe to run twice; does nothing where everything is there. With --with-viewers it also installs Chromium and
# RenderDoc, which the tests use to open reports and captures where they exist, and ffmpeg, with which they film.
set -euo pipefail
cd "$(dirname "$0")"

packages=(libvulkan1 libvulkan-dev mesa-vulkan-drivers vulkan-validationlayers libshaderc-dev glslang-dev spirv-tools spirv-cross libdrm-dev
    g++ cmake git python3 python3-venv)
if [ "${1:-}" = "--with-viewers" ]; then
    packages+=(chromium renderdoc python3-renderdoc ffmpeg)
elif [ -n "${1:-}" ]; then
    echo "setup.sh: unknown argument '$1'; the only one is --with-viewers" >&2
    exit 2
fi

by_hand() {
    cat >&2 <<'TXT'
setup.sh: no apt-get here (or no right to use it). Please install by hand:
  - a Vulkan loader (libvulkan.so.1) and a Vulkan 1.2 driver; Mesa's lavapipe serves where there is no GPU
  - the Khronos validation layers and the Vulkan headers (the tests use them)
  - cmake, git, python3 and a C++ compiler: the build compiles shaderc from source (about 6 minutes, once)
TXT
    exit 1
}

missing=()
if command -v dpkg-query >/dev/null 2>&1; then
    for package in "${packages[@]}"; do
        [ "$(dpkg-query -W -f='${db:Status-Status}' "$package" 2>/dev/null)" = installed ] || missing+=("$package")
    done
else
    by_hand
fi

if [ ${#missing[@]} -gt 0 ]; then
    command -v apt-get >/dev/null 2>&1 || by_hand
    sudo=()
    if [ "$(id -u)" -ne 0 ]; then
        command -v sudo >/dev/null 2>&1 || by_hand
        sudo=(sudo)
    fi
    echo "setup.sh: installing ${missing[*]}"
    "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get update -q >/dev/null
    # One at a time: a name that this release does not have must not keep the others from being installed.
    for package in "${missing[@]}"; do
        "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -q --no-install-recommends "$package" >/dev/null ||
            echo "setup.sh: could not install $package; see README.md, Install" >&2
    done
fi

# Debian's shaderc archives do not link as they are: merge them, check that the result links, and point cargo at it.
# Where that fails cargo builds shaderc from source.
libdir=$(dirname "$(dpkg-query -L libshaderc-dev 2>/dev/null | grep -m1 'libshaderc_combined\.a$' || echo none/none)")
merged=.shaderc/libshaderc_combined.a
if [ -f "$libdir/libshaderc_combined.a" ] && { [ ! -f "$merged" ] || [ "$libdir/libshaderc_combined.a" -nt "$merged" ]; }; then
    mkdir -p .shaderc
    {
        echo "create $merged.new"
        for name in shaderc_combined glslang MachineIndependent GenericCodeGen OSDependent OGLCompiler SPIRV SPIRV-Tools-opt SPIRV-Tools; do
            [ -f "$libdir/lib$name.a" ] && echo "addlib $libdir/lib$name.a"
        done
        echo save
        echo end
    } | ar -M
    cat >.shaderc/probe.c <<'C'
void *shaderc_compiler_initialize(void);
int main(void) { return shaderc_compiler_initialize() == 0; }
C
    if gcc -c .shaderc/probe.c -o .shaderc/probe.o &&
        g++ .shaderc/probe.o "$merged.new" -lpthread -o .shaderc/probe 2>.shaderc/probe.log && .shaderc/probe; then
        mv "$merged.new" "$merged"
        touch "$merged"
    else
        rm -f "$merged.new" "$merged"
        echo "setup.sh: the packaged shaderc does not link; cargo will build it from source (about 6 minutes, once)" >&2
    fi
fi

# Cargo's configuration says where the merged archive is. One that somebody else wrote, or wrote on in, stays as it is.
config=.cargo/config.toml
setting='SHADERC_LIB_DIR = { value = ".shaderc", relative = true }'
written="# Written by setup.sh.
[env]
$setting"
if [ -f "$merged" ] && [ ! -e "$config" ]; then
    mkdir -p .cargo
    echo "$written" >"$config"
elif [ -f "$merged" ] && ! grep -q '^SHADERC_LIB_DIR' "$config"; then
    echo "setup.sh: $config is not of this script's making; add under [env]: $setting" >&2
elif [ ! -f "$merged" ] && [ -e "$config" ]; then
    if [ "$(cat "$config")" = "$written" ]; then
        rm "$config"
    elif grep -q '^SHADERC_LIB_DIR.*"\.shaderc"' "$config"; then
        echo "setup.sh: take SHADERC_LIB_DIR out of $config, for there is nothing in .shaderc" >&2
    fi
fi
echo "setup.sh: ready"
