#!/usr/bin/env python3
"""What hundreds of photos cost `camsplat watch`: COLMAP's time and memory as they become more, by what the command runs.

usage: hundreds.py make DIR COUNT               a furnished room (room.gltf) and cameras around it, ten rounds of 52 at several heights
       hundreds.py register DIR COUNT [COUNT]   photos DIR/photos/images, as many as each count one after another: a line each

Between the two: camsplat capture DIR/room.gltf DIR/cameras.json --out DIR/photos --spp 4 --light traced. After them the advice:
camsplat next DIR/sfm/sparse/0 --preset room --views 10. Needs numpy, pillow and pycolmap. docs/results/watch.md has what came out.
"""
import json
import os
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np

import frames_walk

REGISTER = Path(__file__).parent.parent / "src/app/watch/register.py"
HEIGHTS = [1.45, 1.0, 1.9, 1.45, 1.2, 1.7, 1.45, 1.0, 1.9, 1.6]
TURNS = [0, 35, -35, 180, 60, -60, 150, -150, 90, 20]
PITCHES = [-9, -20, -5, -12, 0, -30, -9, 5, -25, -9]


def make(folder, count):
    rng, poses = np.random.default_rng(1), []
    for i in range(count):
        angle, turn = i / 52 * 2 * np.pi, i // 52 % 10
        x, z = 3 + (1.7 - 0.08 * turn) * np.cos(angle), 4 + (2.6 - 0.12 * turn) * np.sin(angle)
        yaw = np.degrees(np.arctan2(x - 3, 4 - z)) + TURNS[turn]
        place = np.array([x, HEIGHTS[turn], z]) + rng.normal(0, 0.03, 3)
        poses.append(frames_walk.looking(place, yaw + rng.normal(0, 3), PITCHES[turn] + rng.normal(0, 3), rng.normal(0, 2)))
    frames_walk.WIDTH, frames_walk.HEIGHT, frames_walk.FOCAL = 640, 480, 480.0
    folder.mkdir(exist_ok=True)
    (folder / "room.gltf").write_text(json.dumps(frames_walk.room()))
    (folder / "cameras.json").write_text(json.dumps(frames_walk.cameras(poses)))


def placed(files, work):
    """Names of the photos that COLMAP places, going on in the folder `work`, and its memory in MB."""
    photos = [[file.name, str(file.resolve()), "lens", zlib.crc32(file.read_bytes())] for file in files]
    run = subprocess.Popen([sys.executable, REGISTER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    # Its input stays open until it has ended.
    run.stdin.write(json.dumps({"work": str(work.resolve()), "photos": photos}) + "\n")
    run.stdin.flush()
    posed = json.loads(run.stdout.read().strip().splitlines()[-1])["posed"]
    _, _, usage = os.wait4(run.pid, 0)
    return posed, usage.ru_maxrss / 1024


def register(folder, count):
    start = time.time()
    posed, memory = placed(sorted((folder / "photos/images").iterdir())[:count], folder / "sfm")
    print(f"{count} photos, {len(posed)} with a pose: {time.time() - start:.1f} s, {memory:.0f} MB", flush=True)


if __name__ == "__main__":
    what, folder, *counts = sys.argv[1:]
    for count in map(int, counts):
        (make if what == "make" else register)(Path(folder), count)
