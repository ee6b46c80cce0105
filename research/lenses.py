#!/usr/bin/env python3
"""What a lens is worth by the law: plans with lenses of several angles, and half and half of two, for viewers who all have 50 degrees.

    python3 research/lenses.py SCENE ... --data DATA --out OUT [--views 100] [--lenses 35,50,65,80,95,110] [--pairs 50+95]

SCENE is one of the benchmark's, by name; of a built-in room DATA has NAME.ply and NAME.json, the
mesh.ply and task.json of `camsplat evaluate --situation NAME --prepare --surface true`. Objects are planned in the region of 50 degrees
whatever the lens. Viewers are 400 random cameras, others for the plan than for the judgement. Of a pair the first half is planned alone and
kept while the second is planned. Prints for each lens decibels over that of 50 degrees by two laws (the first edition's and one that is
steeper and ends, docs/results/law.md), the median and the 95th of 100 angles to the nearest view, and the mean logarithm of its footprint
over the viewer's. Plans are in OUT/SCENE. Needs numpy.
"""

import argparse
import json
import subprocess
from pathlib import Path

import numpy as np

SCENES = Path(__file__).parent.parent / "src/lab/benchmark/scenes.json"
# Nearest and third angle, footprint, end, weight beside objects.
LAWS = {"first edition": (1.275, 0.668, 0.834, 80, 0.0463), "steeper, ending": (6.15, 0, 0.68, 6.62, 0.0463)}


class Scene:
    def __init__(self, name, arguments):
        scene = next(scene for scene in json.loads(SCENES.read_text()) if scene["name"] == name)
        self.arguments, self.out = arguments, arguments.out / name
        self.surface = arguments.data / scene.get("file", f"{name}.ply")
        self.box, self.heights = scene.get("box"), scene.get("heights")
        if "situation" in scene:
            # A built-in room's box is that of its surface less the clearance, as `evaluate --prepare` writes it.
            region = json.loads((arguments.data / f"{name}.json").read_text())["region"]
            self.box = region["shape"]["box"]["min"] + region["shape"]["box"]["max"]
        self.region = [f"--box={','.join(map(str, self.box))}", "--up", "+y"] if self.box else []
        self.viewers = [self.random(seed) for seed in (7, 8)]
        if not self.box:
            shell = json.loads((self.viewers[0] / "plan.json").read_text())["region"]["shape"]["shell"]
            numbers = [*shell["centre"], shell["r_min"], shell["r_max"]]
            self.region = [f"--shell={','.join(map(str, numbers))}", "--floor", "none"]

    def plan(self, name, *options):
        out = self.out / name
        if not (out / "plan.json").is_file():
            command = [self.arguments.camsplat, "plan", self.surface, *self.region, "--order", "none", "--out", out, *options]
            subprocess.run(list(map(str, command)), check=True, capture_output=True)
        return out

    def random(self, seed):
        heights = [f"--heights={self.heights[0]},{self.heights[1]}"] if self.heights else []
        return self.plan(f"viewers-{seed}", "--method", "random", "--views", 400, "--fov", 50, "--seed", seed, *heights)

    def planned(self, lens, views):
        of = ["--viewers", self.viewers[0]]
        if "+" not in lens:
            return self.plan(f"{views}-{lens}", "--views", views, "--fov", lens, *of)
        first, second = lens.split("+")
        kept = self.planned(first, views // 2)
        return self.plan(f"{views}-{lens}", "--views", views - views // 2, "--fov", second, "--keep", kept, *of)

    def judged(self, plans):
        """By law and plan decibels up to a constant; the angles of the nearest views, and the logarithms of their footprints."""
        out = self.out / "looks"
        shape = ",".join(map(str, self.box)) if self.box else "object"
        subprocess.run([self.arguments.looks, self.surface, shape, self.viewers[1], out, *plans], check=True)
        read = json.loads(out.with_suffix(".json").read_text())
        ends, beside = read["ends"], np.array(read["beside"])
        near = np.fromfile(out.with_suffix(".f32"), np.float32).astype(float).reshape(len(plans), ends[-1], 3)

        def decibels(law):
            nearest, third, farther, end, background = law
            rise = nearest * near[..., 0] + third * near[..., 1] + farther * near[..., 2]
            error = np.where(beside, background, 1) / (np.exp(-rise) + np.exp(-end))
            means = np.add.reduceat(error, [0, *ends[:-1]], axis=1) / np.diff([0, *ends])
            return np.mean(-10 * np.log10(means), axis=1)

        return {name: decibels(law) for name, law in LAWS.items()}, near[..., 0], near[..., 2]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--camsplat", default="camsplat")
    parser.add_argument("--looks", default="target/release/examples/looks")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--views", type=int, default=100)
    parser.add_argument("--lenses", default="35,50,65,80,95,110")
    parser.add_argument("--pairs", default="50+95,65+95")
    arguments = parser.parse_args()
    lenses = [*arguments.lenses.split(","), *filter(None, arguments.pairs.split(","))]
    for name in arguments.scenes:
        scene = Scene(name, arguments)
        by_law, angles, footprints = scene.judged([scene.planned(lens, arguments.views) for lens in lenses])
        for i, lens in enumerate(lenses):
            over = ", ".join(f"{law} {db[i] - db[lenses.index('50')]:+.2f}" for law, db in by_law.items())
            print(f"{name} {lens}: {over}; {np.median(angles[i]):.2f}, {np.quantile(angles[i], 0.95):.2f} rad, {footprints[i].mean():.2f}")


if __name__ == "__main__":
    main()
