#!/usr/bin/env python3
"""A simulated photographer: what photos are worth that follow the advice of `camsplat next`, beside other ways to take them.

    python3 research/photographer.py --camsplat camsplat --out OUT SCENE.glb[:BOX] ...

A room has the box (X0,Y0,Z0,X1,Y1,Z1) in which people can stand; what is asked for advice knows only that it is a room.

Every way begins with the same ten photos from one side, and every photo misses its place by 4% of its distance from the middle of the
scene and its aim by 8 degrees (standard deviations); of places that are named, every fifth is skipped. Photos are rendered, and their poses
known.

    advice    five at a time, by `camsplat next` for the photos so far
    once      all by one `camsplat plan --keep` for the first ten
    orbit     a walk around at even steps and one height; in a room along its walls, looking across
    habit     half of the orbit's photos, then details: from half as far
    random    at random in the region that a plan for the true surface has
    perfect   a plan for the true surface, which misses nothing: what a perfect scan and a perfect hand would give

Each is trained on with 20 and with 40 photos, and tested on 40 views at random in that region, which nothing else sees. Appends to
OUT/psnr.csv.
"""

import argparse
import csv
import json
import math
import random
import shutil
import subprocess
from pathlib import Path

FIRST, AT_A_TIME, SKIPPED, TESTS = 10, 5, 5, 40
NUMBERS = [20, 40]
OFF, TURNED = 0.04, math.radians(8)
SIZE, FOV = (400, 300), 60
WAYS = ["advice", "once", "orbit", "habit", "random", "perfect"]


def add(a, b, factor=1.0):
    return [x + factor * y for x, y in zip(a, b)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    length = math.sqrt(dot(a, a))
    return [x / length for x in a]


def axes_of(rotation):
    """Right, down and forward of a quaternion x, y, z, w."""
    x, y, z, w = rotation
    return (
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
        [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
        [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    )


class Photographer:
    def __init__(self, scene, arguments):
        file, _, box = scene.partition(":")
        self.file, self.arguments = Path(file), arguments
        self.work = arguments.out / self.file.stem / str(arguments.seed)
        shutil.rmtree(self.work, ignore_errors=True)
        self.work.mkdir(parents=True)
        self.preset = ["--preset", "room"] if box else []
        self.stands = [f"--box={box}"] if box else []
        self.lens = ["--fov", FOV, "--size", f"{SIZE[0]}x{SIZE[1]}"]
        self.made = 0
        self.tests = self.planned("tests", TESTS, "--method", "random", "--seed", 1000 + arguments.seed)
        self.region = json.loads((self.work / "tests" / "plan.json").read_text())["region"]
        self.up = self.region["up"]
        shape = self.region["shape"]
        self.box = (shape["box"]["min"], shape["box"]["max"]) if "box" in shape else None
        if self.box:
            self.centre = [0.5 * (a + b) for a, b in zip(*self.box)]
        else:
            self.centre, self.radius = shape["shell"]["centre"], 0.5 * (shape["shell"]["r_min"] + shape["shell"]["r_max"])
        self.photograph(self.tests, self.work / "views")

    def run(self, *words):
        done = subprocess.run([self.arguments.camsplat, *map(str, words)], capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{' '.join(map(str, words))}: {done.stderr}")
        return done.stdout

    def planned(self, name, views, *options):
        """Poses of a plan for the true surface: position, and right, down and forward."""
        self.run("plan", self.file, "--views", views, "--out", self.work / name, *self.preset, *self.stands, *self.lens, *options)
        return self.poses(self.work / name, views)

    def poses(self, folder, views):
        cameras = json.loads((folder / "plan.json").read_text())["cameras"][:views]
        return [(camera["pose"]["position"], *axes_of(camera["pose"]["rotation"])) for camera in cameras]

    def looking(self, position, toward):
        forward = unit(add(toward, position, -1))
        right = unit(cross(forward, self.up))
        return position, right, cross(forward, right), forward

    def orbit(self, number, part=1.0, scale=1.0):
        """Cameras around the middle at even steps and one height, over a part of the circle; in a room near its walls, looking across."""
        side = unit(cross(self.up, [1, 0, 0] if abs(self.up[0]) < 0.9 else [0, 1, 0]))
        other = cross(self.up, side)
        poses = []
        for i in range(number):
            angle = 2 * math.pi * part * i / number
            a, b = math.cos(angle), math.sin(angle)
            if self.box:
                half = [0.5 * (high - low) for low, high in zip(*self.box)]
                reach = [0.8 * scale * sum(abs(axis[k]) * half[k] for k in range(3)) for axis in (side, other)]
                largest = max(abs(a), abs(b))
                place = add(add(self.centre, side, reach[0] * a / largest), other, reach[1] * b / largest)
                poses.append(self.looking(place, self.centre))
            else:
                height = math.sin(math.radians(25))
                level = math.cos(math.radians(25)) * self.radius * scale
                place = add(add(add(self.centre, side, level * a), other, level * b), self.up, height * self.radius * scale)
                poses.append(self.looking(place, self.centre))
        return poses

    def missed(self, pose):
        """The pose as a hand meets it."""
        draw = self.draw.gauss
        position, right, down, forward = pose
        away = math.dist(position, self.centre) if not self.box else 2.5
        position = [x + OFF * away * draw(0, 1) / math.sqrt(3) for x in position]
        aside, below = (math.tan(TURNED) * draw(0, 1) / math.sqrt(2) for _ in range(2))
        aim = add(add(forward, right, aside), down, below)
        forward = unit(aim)
        right = unit(cross(down, forward))
        return position, right, cross(forward, right), forward

    def photograph(self, poses, folder):
        """Renders photos into a capture."""
        shutil.rmtree(folder, ignore_errors=True)
        focal = 0.5 * SIZE[0] / math.tan(math.radians(FOV / 2))
        frames = []
        for i, (position, right, down, forward) in enumerate(poses):
            rows = [[right[k], -down[k], -forward[k], position[k]] for k in range(3)] + [[0, 0, 0, 1]]
            frames.append({"file_path": f"{i:04}.png", "transform_matrix": rows})
        cameras = folder.with_suffix(".json")
        lens = {"fl_x": focal, "fl_y": focal, "cx": SIZE[0] / 2, "cy": SIZE[1] / 2, "w": SIZE[0], "h": SIZE[1]}
        cameras.write_text(json.dumps({**lens, "frames": frames}))
        self.run("capture", self.file, cameras, "--out", folder, *self.arguments.light.split())
        return folder

    def advised(self, number):
        poses = list(self.first)
        named = 0
        while len(poses) < number:
            self.made += 1
            capture = self.photograph(poses, self.work / f"so-far{self.made}")
            answer = json.loads(self.run("next", capture, "--views", AT_A_TIME, "--json", *self.preset, *self.arguments.options.split()))
            for place in answer["next"]:
                named += 1
                if named % SKIPPED and len(poses) < number:
                    poses.append(self.missed((place["pose"]["position"], *axes_of(place["pose"]["rotation"]))))
            shutil.rmtree(capture)
        return poses

    def once(self, number):
        capture = self.photograph(self.first, self.work / "first")
        named = math.ceil((number - FIRST) * SKIPPED / (SKIPPED - 1))
        kept = ["--keep", capture, "--views", named, "--out", self.work / f"once{number}"]
        self.run("plan", capture, *kept, "--space", "open", *self.preset)
        poses = self.poses(self.work / f"once{number}", named)
        poses = [pose for i, pose in enumerate(poses, 1) if i % SKIPPED][: number - FIRST]
        return self.first + [self.missed(pose) for pose in poses]

    def taken(self, way, number):
        self.draw = random.Random(f"{way} {number} {self.arguments.seed}")
        more = number - FIRST
        if way == "advice":
            return self.advised(number)
        if way == "once":
            return self.once(number)
        if way == "orbit":
            return self.first + [self.missed(pose) for pose in self.orbit(more)]
        if way == "habit":
            details = self.orbit(more - more // 2, scale=0.5 if self.box else 0.75)
            return self.first + [self.missed(pose) for pose in self.orbit(more // 2) + details]
        if way == "random":
            return self.first + self.planned(f"random{number}", more, "--method", "random", "--seed", self.arguments.seed)
        return self.planned(f"perfect{number}", number, "--seed", self.arguments.seed)

    def compare(self, writer, file):
        self.draw = random.Random(self.arguments.seed)
        self.first = [self.missed(pose) for pose in self.orbit(FIRST, part=0.2)]
        for number in NUMBERS:
            for way in self.arguments.ways:
                capture = self.photograph(self.taken(way, number), self.work / f"{way}{number}-photos")
                out = self.work / "model"
                shutil.rmtree(out, ignore_errors=True)
                words = [
                    "--iterations",
                    self.arguments.iterations,
                    "--seed",
                    self.arguments.seed,
                    "--max-splats",
                    self.arguments.max_splats,
                ]
                self.run("train", capture, "--test", self.work / "views", "--out", out, *words)
                psnr = json.loads((out / "train.json").read_text())["evaluations"][-1]["quality"]["psnr"]
                writer.writerow([self.file.stem, way, number, self.arguments.seed, round(psnr, 3)])
                file.flush()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--camsplat", default="camsplat")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--ways", nargs="+", default=WAYS, choices=WAYS)
    parser.add_argument("--iterations", type=int, default=5000)
    parser.add_argument("--max-splats", type=int, default=200000)
    parser.add_argument("--light", default="", help="options of capture, such as --light=--env=sky.hdr")
    parser.add_argument("--options", default="", help="more options of next, such as --options=--space=open")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    with open(arguments.out / "psnr.csv", "a", newline="") as file:
        for scene in arguments.scenes:
            Photographer(scene, arguments).compare(csv.writer(file), file)


if __name__ == "__main__":
    main()
