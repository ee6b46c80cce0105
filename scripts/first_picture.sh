#!/usr/bin/env bash
# Takes the README's first picture of a demo's folder: first_picture.sh DEMO PICTURE.png. Needs chromium.
set -euo pipefail
demo="$(realpath "$1")"
page="$(realpath "$(dirname "$0")/first_picture.html")"
chromium --headless --no-sandbox --disable-gpu --use-angle=swiftshader --enable-unsafe-swiftshader --allow-file-access-from-files \
    --hide-scrollbars --virtual-time-budget=20000 --window-size=1600,900 --screenshot="$2" "file://$page?$demo" 2>/dev/null
