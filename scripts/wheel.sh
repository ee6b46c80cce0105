#!/usr/bin/env bash
# Builds the Python wheel into dist/ and tries it in empty virtual environments, one for each Python that is named (python3 where none is):
#
#     scripts/wheel.sh [PYTHON ...]
#
# On Linux the wheel is for every distribution with glibc 2.28 or later (manylinux_2_28), linked by zig, which pip brings. Run setup.sh first.
# What is tried: the README's example as a doctest, the command line, and a plan of arrays.
set -euo pipefail

# Relative paths are those of the caller.
pythons=()
for python in "${@:-python3}"; do
    pythons+=("$(realpath --no-symlinks "$(command -v "$python")")")
done
cd "$(dirname "$0")/.."

tools=target/wheel-tools
[ -x "$tools/bin/maturin" ] || python3 -m venv "$tools"
"$tools/bin/pip" install -q "maturin>=1.9,<2" cargo-zigbuild ziglang

rm -f dist/camsplat-*.whl
if [ "$(uname -s)" = Linux ]; then
    # Zig links the package alone, for the older glibc: all that it is made of is what other builds compile, too.
    linker=$PWD/$tools/bin/link-by-zig
    printf '#!/bin/sh\nexec cargo-zigbuild zig cc -- -target %s-linux-gnu.2.28 "$@"\n' "$(uname -m)" >"$linker"
    chmod +x "$linker"
    # cargo-zigbuild finds zig by the Python before it on the path.
    PATH="$PWD/$tools/bin:$PATH" maturin build --release --locked --compatibility manylinux_2_28 --out dist -- -C linker="$linker"
else
    "$tools/bin/maturin" build --release --locked --out dist
fi
wheel=$(ls "$PWD"/dist/camsplat-*.whl)

readme=$PWD/README.md
for python in "${pythons[@]}"; do
    place=$(mktemp -d)
    trap 'rm -rf "$place"' EXIT
    "$python" -m venv "$place/venv"
    "$place/venv/bin/pip" install -q "$wheel" trimesh
    (
        cd "$place"
        venv/bin/python -m doctest "$readme"
        venv/bin/camsplat --version
        venv/bin/python -c 'import camsplat, sys; print("tried with Python", sys.version.split()[0], camsplat.read_cameras("statue"))'
    )
    rm -r "$place"
done
echo "wheel.sh: $wheel"
