#!/usr/bin/env python3
"""Captures played back: what `camsplat next` would have asked for, and what photos in its order are worth.

    python3 research/playback.py --camsplat camsplat --out playback CAPTURE...

Every eighth photo is held out for tests. Of the others, four orders are compared, which begin with the first five as the photographer
took them:

    photographer    as they were taken
    advice          five at a time, those nearest to the five places that `camsplat next` names for the photos so far
    even            the walk at even steps, which knows where it will end
    random          at random

and of each order the first 10, 20 and 40 are trained on. For the photographer's order `gains.csv` has what ten more photos were expected to
gain at each number; `psnr.csv` has what was trained. Captures are COLMAP's, in binary.
"""

import argparse
import csv
import json
import math
import random
import shutil
import struct
import subprocess
import time
from pathlib import Path

FIRST, AT_A_TIME, HELD_OUT = 5, 5, 8
NUMBERS = [10, 20, 40]
GAINS = [5, 10, 20, 30, 40, 60, 80, 100]
ORDERS = ["photographer", "advice", "even", "random"]


def images_of(model):
    """Name, number and record of each image of a COLMAP model, in the order of names."""
    data, found, at = (model / "images.bin").read_bytes(), [], 8
    for _ in range(struct.unpack_from("<Q", data)[0]):
        begin = at
        number = struct.unpack_from("<I", data, at)[0]
        pose = struct.unpack_from("<7d", data, at + 4)
        at += 64
        end = data.index(b"\0", at)
        name = data[at:end].decode()
        at = end + 1 + 8 + 24 * struct.unpack_from("<Q", data, end + 1)[0]
        found.append((name, number, pose, data[begin:at]))
    return sorted(found)


def centre(pose):
    """Where a camera stands and looks, of its COLMAP pose."""
    w, x, y, z, *t = pose
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return [-sum(rows[k][i] * t[k] for k in range(3)) for i in range(3)], rows[2]


def subset(model, images, target):
    """Writes the model with some of its images; points that fewer than two of them see are gone."""
    target.mkdir(parents=True)
    shutil.copy(model / "cameras.bin", target)
    (target / "images.bin").write_bytes(struct.pack("<Q", len(images)) + b"".join(image[3] for image in images))
    kept = {image[1] for image in images}
    data, points, at = (model / "points3D.bin").read_bytes(), [], 8
    for _ in range(struct.unpack_from("<Q", data)[0]):
        (length,) = struct.unpack_from("<Q", data, at + 43)
        track = [struct.unpack_from("<II", data, at + 51 + 8 * i) for i in range(length)]
        track = [element for element in track if element[0] in kept]
        if len(track) > 1:
            elements = b"".join(struct.pack("<II", *element) for element in track)
            points.append(data[at : at + 43] + struct.pack("<Q", len(track)) + elements)
        at += 51 + 8 * length
    (target / "points3D.bin").write_bytes(struct.pack("<Q", len(points)) + b"".join(points))


def away(image, position, forward, step):
    """How far a photo is from a place, a step as much as 30 degrees."""
    place, looks = centre(image[2])
    cosine = sum(a * b for a, b in zip(looks, forward))
    return math.dist(place, position) / step + math.degrees(math.acos(max(-1, min(1, cosine)))) / 30


def forward_of(rotation):
    x, y, z, w = rotation
    return [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]


class Playback:
    def __init__(self, capture, arguments):
        self.capture, self.arguments = capture, arguments
        self.model = next(path for path in [capture / "sparse" / "0", capture / "sparse"] if (path / "images.bin").exists())
        self.work = arguments.out / capture.name
        shutil.rmtree(self.work, ignore_errors=True)
        self.work.mkdir(parents=True)
        for name in ["images", "masks"]:
            if (capture / name).exists():
                (self.work / name).symlink_to((capture / name).resolve())
        images = images_of(self.model)
        self.tests = images[HELD_OUT - 1 :: HELD_OUT]
        self.photos = [image for image in images if image not in self.tests]
        subset(self.model, self.tests, self.work / "tests")
        self.made = 0

    def run(self, *words):
        done = subprocess.run([self.arguments.camsplat, *map(str, words)], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{' '.join(map(str, words))}: {done.stderr}")
        return done.stdout

    def part(self, images):
        self.made += 1
        folder = self.work / f"part{self.made}"
        subset(self.model, images, folder)
        return folder

    def next(self, images, views):
        begun = time.monotonic()
        words = ["--views", views, "--from", images[-1][0], "--json", *self.arguments.options.split()]
        answer = json.loads(self.run("next", self.part(images), *words))
        answer["seconds"] = time.monotonic() - begun
        return answer

    def advised(self, most):
        """The order in which photos are taken that are nearest to the places that are named."""
        taken, left = self.photos[:FIRST], self.photos[FIRST:]
        while len(taken) < most and left:
            answer = self.next(taken, AT_A_TIME)
            for place in answer["next"]:
                if left:
                    pose, step = place["pose"], answer["unit_length"]
                    position, forward = pose["position"], forward_of(pose["rotation"])
                    best = min(left, key=lambda image: away(image, position, forward, step))
                    left.remove(best)
                    taken = [*taken, best]
        return taken

    def order(self, kind, number, advised):
        if kind == "advice":
            return advised[:number]
        if kind == "even":
            steps = (len(self.photos) - 1) / (number - 1)
            return [self.photos[round(i * steps)] for i in range(number)]
        if kind == "random":
            drawn = random.Random(self.arguments.seed).sample(self.photos[FIRST:], number - FIRST)
            return sorted(self.photos[:FIRST] + drawn)
        return self.photos[:number]

    def trained(self, images):
        out = self.work / f"model{self.made}"
        words = ["--iterations", self.arguments.iterations, "--shrink", self.arguments.shrink, "--max-splats", self.arguments.max_splats]
        self.run("train", self.part(images), "--test", self.work / "tests", "--out", out, "--seed", self.arguments.seed, *words)
        record = json.loads((out / "train.json").read_text())
        shutil.rmtree(out)
        return record["evaluations"][-1]["quality"]["psnr"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", nargs="+", type=Path)
    parser.add_argument("--camsplat", default="camsplat")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--iterations", type=int, default=7000)
    parser.add_argument("--shrink", type=int, default=1)
    parser.add_argument("--max-splats", type=int, default=300000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--orders", nargs="+", default=ORDERS, choices=ORDERS)
    parser.add_argument("--options", default="", help="more options of next, such as --options=--space=open")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with open(arguments.out / "gains.csv", "a", newline="") as gains, open(arguments.out / "psnr.csv", "a", newline="") as psnr:
        for capture in arguments.captures:
            playback = Playback(capture, arguments)
            wanted = [n for n in GAINS if n < len(playback.photos)] + [len(playback.photos)]
            for number in wanted if "photographer" in arguments.orders else []:
                answer = playback.next(playback.photos[:number], 10)
                row = [capture.name, number] + [round(answer[key], 3) for key in ["gain_db", "gain_sd_db", "unseen", "seconds"]]
                csv.writer(gains).writerow(row)
                gains.flush()
            numbers = [n for n in NUMBERS if n < len(playback.photos)]
            advised = playback.advised(max(numbers)) if "advice" in arguments.orders else []
            sets = [(kind, n, playback.order(kind, n, advised)) for n in numbers for kind in arguments.orders]
            if "photographer" in arguments.orders:
                sets.append(("all", len(playback.photos), playback.photos))
            for kind, number, images in sets:
                csv.writer(psnr).writerow([capture.name, kind, number, arguments.seed, round(playback.trained(images), 3)])
                psnr.flush()


if __name__ == "__main__":
    main()
