"""Makes the installable extension: python blender/build.py WHEEL, which writes camsplat-blender-VERSION-PLATFORM.zip beside the wheel."""

import re
import sys
import zipfile
from pathlib import Path

EXTENSION = Path(__file__).resolve().parent / "extension"
"""The extension's files."""

PLATFORMS = [
    (r"(manylinux|linux).*_x86_64", "linux-x64"),
    (r"(manylinux|linux).*_aarch64", "linux-arm64"),
    (r"macosx_.*_x86_64", "macos-x64"),
    (r"macosx_.*_arm64", "macos-arm64"),
    (r"win_amd64", "windows-x64"),
    (r"win_arm64", "windows-arm64"),
]
"""Platform tags of wheels, and Blender's names of these platforms."""


def build(wheel: Path) -> Path:
    """Writes the zip beside the wheel and returns its path."""
    if not wheel.is_file():
        raise SystemExit(f"{wheel}: there is no such wheel; build it with scripts/wheel.sh")
    parts = wheel.stem.split("-")
    if wheel.suffix != ".whl" or len(parts) != 5 or parts[0] != "camsplat":
        raise SystemExit(f"{wheel}: this is no wheel of camsplat; give camsplat-VERSION-PYTHON-ABI-PLATFORM.whl")
    version, tag = parts[1], parts[4]
    platform = next((name for pattern, name in PLATFORMS if re.fullmatch(pattern, tag)), None)
    if platform is None:
        raise SystemExit(f"{wheel}: Blender has no platform for the tag {tag}; build the wheel on Linux, macOS or Windows")
    manifest = (EXTENSION / "blender_manifest.toml").read_text(encoding="utf-8")
    manifest = manifest.replace('version = "0.0.0"', f'version = "{version}"', 1)
    manifest = manifest.replace("platforms = []", f'platforms = ["{platform}"]', 1)
    manifest = manifest.replace('wheels = ["./wheels/"]', f'wheels = ["./wheels/{wheel.name}"]', 1)
    file = wheel.with_name(f"camsplat-blender-{version}-{platform}.zip")
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("blender_manifest.toml", manifest)
        for source in sorted(EXTENSION.glob("*.py")):
            archive.write(source, source.name)
        archive.write(wheel, f"wheels/{wheel.name}")
    return file


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: python blender/build.py WHEEL")
    print(build(Path(sys.argv[1])))
