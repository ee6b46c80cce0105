#!/usr/bin/env bash
# Writes target/dependencies, which goes into archives: the texts of the dependencies' licences (THIRD-PARTY.md) and a software bill of
# materials (camsplat.cdx.json, CycloneDX). Installs the tools for that where they are missing.
set -euo pipefail
cd "$(dirname "$0")/.."

command -v cargo-cyclonedx >/dev/null || cargo install --locked --target-dir target/tools cargo-cyclonedx
command -v cargo-about >/dev/null || cargo install --locked --target-dir target/tools --features cli cargo-about

out=target/dependencies
mkdir -p "$out"
cargo about generate --locked --fail --output-file "$out/THIRD-PARTY.md" about.hbs
cargo cyclonedx --format json --override-filename camsplat.cdx --manifest-path Cargo.toml -q
mv camsplat.cdx.json "$out/"
rm -f python/camsplat.cdx.json
echo "licences.sh: $out/THIRD-PARTY.md, $out/camsplat.cdx.json"
