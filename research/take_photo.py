#!/usr/bin/env python3
"""Takes one photo of a scene where you say, into a folder that `camsplat watch` watches.

usage: take_photo.py SCENE FOLDER X,Y,Z X,Y,Z [CAPTURE OPTIONS]      from the first place toward the second

The photo is FOLDER/0000.png and so on. The true poses are kept beside the folder (FOLDER.json, a transforms.json), for a test of what the
photos are worth; nothing else may read them. `camsplat` is on the path. docs/results/watch.md has what came out.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from photographer import unit, write_cameras

SIZE, UP = (800, 600), np.array([0.0, 1.0, 0.0])


def main():
    scene, folder = sys.argv[1], Path(sys.argv[2])
    place, toward = (np.array([float(part) for part in words.split(",")]) for words in sys.argv[3:5])
    forward = unit(toward - place)
    right = unit(np.cross(forward, UP))
    folder.mkdir(parents=True, exist_ok=True)
    log = Path(f"{folder}.json")
    taken = json.loads(log.read_text()) if log.is_file() else None
    with tempfile.TemporaryDirectory() as work:
        work = Path(work)
        write_cameras(work / "cameras.json", [(place, np.column_stack([right, np.cross(forward, right), forward]))], SIZE)
        run = ["camsplat", "capture", scene, work / "cameras.json", "--out", work / "photo", *sys.argv[5:]]
        subprocess.run(run, check=True, stdout=subprocess.DEVNULL)
        (image,) = (work / "photo/images").iterdir()
        new = json.loads((work / "cameras.json").read_text())
        name = f"{len(taken['frames']) if taken else 0:04}{image.suffix}"
        new["frames"][0]["file_path"] = f"{folder.name}/{name}"
        shutil.move(image, folder / name)
    if taken:
        new["frames"] = taken["frames"] + new["frames"]
    log.write_text(json.dumps(new, indent=1))
    print(folder / name)


if __name__ == "__main__":
    main()
