#!/usr/bin/env python3
"""How the error of trained splats rises with angle and footprint in rooms: forms of the law held against runs of the benchmark.

    python3 research/law.py ROOM ... --bench BENCH --data DATA --out OUT [--by views]

BENCH is the folder that `camsplat benchmark` wrote. Of a built-in room DATA has NAME.ply and NAME.json, the mesh.ply and task.json of
`camsplat evaluate --situation NAME --prepare --surface true`. Forms are fitted to the rooms of the benchmark's fit split, to the means of
layouts over test views, or with `--by views` to every test view, less its own mean over layouts. Printed for each form: its coefficients;
for each room Pearson's correlation over layouts, decibels trained for one expected, and the standard deviation of what is left, of all
layouts, of those of one lens, and of both without random cameras. Each room counts the same. Needs numpy and scipy.
"""

import argparse
import json
import subprocess
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

SCENES = Path(__file__).parent.parent / "src/lab/benchmark/scenes.json"


class Room:
    def __init__(self, name, arguments):
        scene = next(scene for scene in json.loads(SCENES.read_text()) if scene["name"] == name)
        self.name, self.fitted, box = name, scene["split"] == "fit", scene.get("box")
        if not box:
            region = json.loads((arguments.data / f"{name}.json").read_text())["region"]
            box = region["shape"]["box"]["min"] + region["shape"]["box"]["max"]
        runs = arguments.bench / name / name
        results = json.loads((arguments.bench / name / "results.json").read_text())["runs"]
        inputs = [json.loads((runs / run["folder"] / "done.json").read_text())["inputs"] for run in results]
        tests = runs / inputs[0]["tests"] / "transforms.json"
        out = arguments.out / name
        surface = arguments.data / scene.get("file", f"{name}.ply")
        cameras = [runs / of["photos"] / "transforms.json" for of in inputs]
        subprocess.run([arguments.looks, surface, ",".join(map(str, box)), tests, out, *cameras], check=True)
        ends = json.loads(out.with_suffix(".json").read_text())["ends"]
        self.starts, self.sizes = np.array([0, *ends[:-1]]), np.diff([0, *ends])
        near = np.fromfile(out.with_suffix(".f32"), np.float32).astype(float).reshape(len(results), ends[-1], 3)
        self.first, self.third, self.farther = near[..., 0], near[..., 1], near[..., 2]
        self.one_lens = np.array(["@" not in run["method"] for run in results])
        self.random = np.array([run["method"] == "random" for run in results])

        # The trainer leaves out photos of one colour, which `looks` does not know.
        names = [Path(frame["file_path"]).name for frame in json.loads(tests.read_text())["frames"]]
        trained = [json.loads((runs / run["folder"] / "train.json").read_text())["test_views"] for run in results]
        trained = [{view["name"]: view["quality"]["psnr"] for view in views} for views in trained]
        self.tested = np.array([name in trained[0] for name in names])
        if len(names) != len(ends):
            raise RuntimeError(f"{name}: some test views show too little of the surface")
        self.psnr = np.array([[views[name] for name in names if name in views] for views in trained])

    def expected(self, log_error):
        """PSNR of each layout and test view that follows from the errors of its pixels, up to the room's own level."""
        means = np.add.reduceat(np.exp(log_error), self.starts, axis=1) / self.sizes
        return (-10 * np.log10(means))[:, self.tested]

    def left(self, log_error, by):
        """What is left of PSNR, each room with the same weight."""
        left = self.psnr - self.expected(log_error)
        if by == "layouts":
            left = left.mean(axis=1, keepdims=True)
        return (left - left.mean(axis=0)).ravel() / np.sqrt(left.size)


def first_edition(room, p):
    return 1.275 * room.first + 0.668 * room.third + 0.834 * room.farther


def steeper(room, p):
    """An earlier fit, to eight layouts in each of three rooms."""
    return ending(room, [6.15, 0, 0.68, 6.62])


def fitted(room, p):
    return p[0] * room.first + p[1] * room.third + p[2] * room.farther


def ending(room, p):
    """Errors end at what is shown where nothing was seen, `p[3]` above those of a camera that stands where the viewer does."""
    return -np.logaddexp(-fitted(room, p), -p[3])


def far_beyond(room, p):
    """Footprints cost nothing up to 2.5 times the viewer's."""
    return p[0] * room.first + p[1] * room.third + p[2] * np.maximum(room.farther - np.log(2.5), 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="+")
    parser.add_argument("--looks", default="target/release/examples/looks")
    parser.add_argument("--bench", type=Path, required=True)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--by", choices=["layouts", "views"], default="layouts")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    rooms = [Room(name, arguments) for name in arguments.rooms]
    laws = [(first_edition, []), (steeper, []), (fitted, [2, 0.5, 0.7]), (ending, [3, 0.5, 0.7, 6]), (far_beyond, [2, 0.5, 0.7])]
    for law, start in laws:
        def residuals(p, law=law):
            return np.concatenate([room.left(law(room, p), arguments.by) for room in rooms if room.fitted])

        p = least_squares(residuals, start, diff_step=1e-3).x if start else []
        print(law.__name__, " ".join(f"{value:.2f}" for value in p), f"mean square {np.sum(residuals(p) ** 2) / sum(room.fitted for room in rooms):.2f}")
        for room in rooms:
            expected, trained = room.expected(law(room, p)).mean(axis=1), room.psnr.mean(axis=1)
            parts = {"all": room.one_lens | True, "not random": ~room.random, "one lens": room.one_lens}
            for which, of in {**parts, "one lens, not random": room.one_lens & ~room.random}.items():
                x, y = expected[of], trained[of]
                print(f"  {room.name} ({'fit' if room.fitted else 'not fitted'}, {which}): {np.corrcoef(x, y)[0, 1]:.3f}, "
                      f"{np.polyfit(x, y, 1)[0]:.2f}, {(y - x).std():.2f} dB")


if __name__ == "__main__":
    main()
