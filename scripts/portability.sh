#!/usr/bin/env bash
# Checks the shaders of the last release build for devices that are not here: validates their SPIR-V, translates it to Metal's language, and
# compiles every pipeline with Mesa's drivers for AMD's and Intel's GPUs and for CPUs. Prints tables of registers, memory and spills, as
# Markdown, and leaves them in target/portability/portability.md. Fails where a shader is not valid, not translated or not compiled.
#
#   scripts/portability.sh [--all] [FOLDER]
#
# FOLDER has other .spv files and the shaders.rs that goes with them. --all compiles for Intel's Arc too, which takes minutes. Needs python3
# and Debian's gcc, libvulkan-dev, libdrm-dev, mesa-vulkan-drivers, spirv-tools and spirv-cross.
set -euo pipefail
cd "$(dirname "$0")/.."

for tool in cc python3 spirv-val spirv-dis spirv-cross; do
    command -v "$tool" >/dev/null || { echo "portability.sh: no $tool; install the packages that this script names" >&2; exit 2; }
done
out="${CARGO_TARGET_DIR:-target}/portability"
mkdir -p "$out"
flags=(-O1 -std=c11 -Wall -Wextra -Wno-missing-field-initializers)
cc "${flags[@]}" scripts/portability/pipelines.c -lvulkan -o "$out/pipelines"
# Without the headers of libdrm Intel's driver is left out.
rm -f "$out/intel_device.so"
cc "${flags[@]}" -I/usr/include/libdrm -shared -fPIC scripts/portability/intel_device.c -o "$out/intel_device.so" 2>"$out/intel_device.log" || true

PYTHONDONTWRITEBYTECODE=1 nice python3 scripts/portability "$@" | tee "$out/portability.md"
