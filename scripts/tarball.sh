#!/usr/bin/env bash
# Builds dist/camsplat-VERSION-ARCH-linux.tar.gz for this machine's architecture: the program for every distribution with glibc 2.28 or later, linked by zig, with man
# pages, completions and the licences of its dependencies. Pages, shaders and weights are in the program; a Vulkan loader and a driver are
# looked for at run time. (A program without glibc could not load them, so that it is not linked statically against musl.)
# Run setup.sh first. Needs python3; scripts/licences.sh brings the other tools.
set -euo pipefail
cd "$(dirname "$0")/.."

arch=$(uname -m)
triple=$arch-unknown-linux-gnu
tools=target/wheel-tools
[ -x "$tools/bin/pip" ] || python3 -m venv "$tools"
"$tools/bin/pip" install -q cargo-zigbuild ziglang
scripts/dependencies.sh
scripts/licences.sh

# Zig links the program. Build scripts run here and now, and link what this system has.
export "CC_${triple//-/_}=cc" "CXX_${triple//-/_}=c++"
PATH="$PWD/$tools/bin:$PATH" cargo zigbuild --release --locked --bin camsplat --target "$triple.2.28"

version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -1)
name=camsplat-$version-$arch-linux
folder=target/tarball/$name
rm -rf target/tarball
mkdir -p "$folder/completions" dist
cp "target/$triple/release/camsplat" README.md CHANGELOG.md LICENSE-MIT LICENSE-APACHE target/dependencies/* "$folder/"
strip "$folder/camsplat"
"$folder/camsplat" manual --out "$folder/man"
for shell in bash fish zsh; do
    "$folder/camsplat" completions "$shell" >"$folder/completions/camsplat.$shell"
done
tar --sort=name --owner=0 --group=0 --numeric-owner -C target/tarball -czf "dist/$name.tar.gz" "$name"
(cd dist && sha256sum "$name.tar.gz" >"$name.tar.gz.sha256")
echo "tarball.sh: dist/$name.tar.gz"
