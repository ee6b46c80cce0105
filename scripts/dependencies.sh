#!/usr/bin/env bash
# Checks the dependencies' licences, sources and known vulnerabilities, and writes target/dependencies: the texts of all licences
# (THIRD-PARTY.md) and a software bill of materials (camsplat.cdx.json, CycloneDX). Installs the tools for that where they are missing.
set -euo pipefail
cd "$(dirname "$0")/.."

have() { command -v "$1" >/dev/null; }
missing=()
have cargo-deny || missing+=(cargo-deny)
have cargo-cyclonedx || missing+=(cargo-cyclonedx)
[ ${#missing[@]} -eq 0 ] || cargo install --locked --target-dir target/tools "${missing[@]}"
have cargo-about || cargo install --locked --target-dir target/tools --features cli cargo-about

cargo deny --locked check bans licenses sources
if cargo deny --locked fetch db; then
    cargo deny --locked check advisories
else
    echo "skipped: the database of advisories cannot be fetched here"
fi

out=target/dependencies
mkdir -p "$out"
cargo about generate --locked --fail --output-file "$out/THIRD-PARTY.md" about.hbs
cargo cyclonedx --format json --override-filename camsplat.cdx --manifest-path Cargo.toml -q
mv camsplat.cdx.json "$out/"
rm -f python/camsplat.cdx.json
echo "dependencies.sh: $out/THIRD-PARTY.md, $out/camsplat.cdx.json"
