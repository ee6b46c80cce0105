#!/usr/bin/env python3
"""What photos are worth that people took by `take_photo.py`, beside an orbit and a perfect plan of as many.

    python3 research/readers.py --camsplat camsplat --out OUT SCENE[:BOX] FOLDER ...

Of each folder the photos that COLMAP places count, rendered again at their true poses (FOLDER.json) as the photographer renders them; splats
are trained on them and tested on 40 views at random. A line each: whose photos, seed, how many of them, PSNR. Needs numpy and pycolmap.
"""

import argparse
import json
from pathlib import Path

import numpy as np

from hundreds import placed
from photographer import Known, Scene


def taken(folder, work):
    """True poses of the photos that COLMAP places: place, and columns right, down and forward."""
    names = set(placed(sorted(folder.glob("*.png")), work)[0])
    frames = json.loads(Path(f"{folder}.json").read_text())["frames"]
    matrices = [np.array(frame["transform_matrix"]) for frame in frames if Path(frame["file_path"]).name in names]
    return [(matrix[:3, 3], matrix[:3, :3] * [1, -1, -1]) for matrix in matrices]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--camsplat", default="camsplat")
    parser.add_argument("--device", default="", help="as of camsplat")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--iterations", type=int, default=3000)
    parser.add_argument("--max-splats", type=int, default=100000)
    parser.add_argument("--light", nargs="+", default=[], help="options of capture")
    arguments = parser.parse_args()
    arguments.sfm = False
    arguments.out.mkdir(parents=True, exist_ok=True)
    people = {}
    for i, folder in enumerate(arguments.folders):
        work = arguments.out / f"sfm{i}"
        work.mkdir(exist_ok=True)
        people[str(folder)] = taken(folder, work)
    most = max(map(len, people.values()))
    for seed in arguments.seeds:
        scene = Scene(arguments.scene, arguments, seed)
        others = {"orbit": scene.orbit(most), "plan": scene.planned("plan", most)}
        for number, (name, poses) in enumerate({**people, **others}.items()):
            album = Known(scene, f"album{number}")
            album.add(poses)
            print(name, seed, len(album), round(album.trained(), 2), flush=True)


if __name__ == "__main__":
    main()
