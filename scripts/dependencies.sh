#!/usr/bin/env bash
# Checks the dependencies' licences, sources and known vulnerabilities. Installs cargo-deny where it is missing, without optimisation,
# which would take longer than what it saves.
set -euo pipefail
cd "$(dirname "$0")/.."

command -v cargo-deny >/dev/null || cargo install --locked --debug --target-dir target/tools cargo-deny
cargo deny --locked check bans licenses sources
if cargo deny --locked fetch db; then
    cargo deny --locked check advisories
else
    echo "skipped: the database of advisories cannot be fetched here"
fi
