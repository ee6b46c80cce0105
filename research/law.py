#!/usr/bin/env python3
"""How the error of trained splats rises with angle in rooms: forms of the law held against docs/results/rooms.csv.

    python3 research/law.py --camsplat camsplat --looks target/release/examples/looks --data DATA --out OUT

Plans of each method are made again (`random`, `grid` and `rings` are those that were trained, `acp` and `ours` those of the program as it
is), and 120 viewers at eye height drawn at random. `two-rooms` is the surface that `camsplat evaluate --situation two-rooms --prepare
--surface true` writes, as DATA/two-rooms.ply. Fitted to the rooms of the benchmark's fit split, and printed for all: coefficients; Pearson's
correlation, decibels trained for one expected, and the standard deviation of what is left. Needs numpy and scipy.
"""

import argparse
import csv
import json
import subprocess
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

RESULTS = Path(__file__).parent.parent / "docs/results/rooms.csv"
# Box, heights of viewers, and whether laws are fitted to it.
ROOMS = {
    "staircase2": ("-8,0.6,0.7,6.5,5,2.3", "2.6,3.6", True),
    "living-room": ("-0.3693,0.141,-3.4913,4.9786,2.735,0.4487", "1.2,1.8", True),
    "two-rooms": ("0.13,0.13,0.13,9.87,2.47,4.87", None, True),
    "dining-room": ("-5.8,-0.95,-4.2,4.4,7.45,9.3", "2.7,4.6", False),
    "classroom": ("-2.8,0.3,-5,2.7,2.6,5.6", "1.2,1.8", False),
}
RUNS = [("random", 100), ("random", 300), ("grid", 100), ("rings", 100), ("acp", 100), ("acp", 300), ("ours", 100), ("ours", 300)]


class Room:
    def __init__(self, name, arguments):
        box, heights, self.fitted = ROOMS[name]
        self.name = name
        surface = next(file for file in [arguments.data / f"{name}.glb", arguments.data / f"{name}.ply"] if file.is_file())
        trained = {(row["method"], int(row["views"])): float(row["mean"])
                   for row in csv.DictReader(RESULTS.open()) if row["scene"] == name and row["metric"] == "PSNR"}

        def plan(method, views, *options):
            out = arguments.out / f"{name}-{method}-{views}-{options[1]}"
            if not (out / "plan.json").is_file():
                words = ["plan", surface, f"--box={box}", "--views", views, "--fov", 50, "--order", "none", "--out", out, *options]
                words += [] if method == "ours" else ["--method", method]
                subprocess.run([arguments.camsplat, *map(str, words)], check=True, capture_output=True)
            return out

        tests = plan("random", 120, "--seed", 777, *([f"--heights={heights}"] if heights else []))
        seen = ["--viewers", f"heights:{heights}"] if heights else []
        plans = [plan(method, views, "--seed", 0, *(seen if method == "ours" else [])) for method, views in RUNS]
        out = arguments.out / name
        subprocess.run([arguments.looks, surface, box, tests, out, *plans], check=True)
        self.psnr = np.array([trained[run] for run in RUNS])
        ends = json.loads(out.with_suffix(".json").read_text())["ends"]
        self.starts, self.sizes = np.array([0, *ends[:-1]]), np.diff([0, *ends])
        near = np.fromfile(out.with_suffix(".f32"), np.float32).astype(float).reshape(len(RUNS), ends[-1], 3)
        self.first, self.third, self.farther = near[..., 0], near[..., 1], near[..., 2]
        self.unseen = self.first >= 2

    def expected(self, log_error):
        """Mean over viewers of the PSNR that follows from the errors of their pixels, by layout, up to the room's own level."""
        means = np.add.reduceat(np.exp(log_error), self.starts, axis=1) / self.sizes
        return np.mean(-10 * np.log10(means), axis=1)


def first_edition(room, p):
    return 1.275 * room.first + 0.668 * room.third + 0.834 * room.farther


def steeper(room, p):
    return p[0] * room.first + p[1] * room.third + p[2] * room.farther


def saturating(room, p):
    """Errors end at what is shown where nothing was seen, `p[3]` above those of a camera that stands where the viewer does."""
    z = p[0] * room.first + p[1] * room.third + p[2] * room.farther
    return -np.logaddexp(-np.where(room.unseen, 60, z), -p[3])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--camsplat", default="camsplat")
    parser.add_argument("--looks", default="target/release/examples/looks")
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    rooms = [Room(name, arguments) for name in ROOMS]
    for law, start in [(first_edition, []), (steeper, [1.5, 0.5, 0.5]), (saturating, [4, 0.5, 0.5, 6])]:
        def residuals(p, law=law):
            left = [room.psnr - room.expected(law(room, p)) for room in rooms if room.fitted]
            return np.concatenate([one - one.mean() for one in left])

        p = least_squares(residuals, start, diff_step=1e-3).x if start else []
        print(law.__name__, " ".join(f"{value:.2f}" for value in p))
        for room in rooms:
            expected = room.expected(law(room, p))
            slope = np.polyfit(expected, room.psnr, 1)[0]
            left = room.psnr - expected
            of = "fit" if room.fitted else "test"
            print(f"  {room.name} ({of}): {np.corrcoef(expected, room.psnr)[0, 1]:.3f}, {slope:.2f}, {left.std():.2f} dB; "
                  + ", ".join(f"{method} {views} {value:+.1f}" for (method, views), value in zip(RUNS, left - left.mean())))


if __name__ == "__main__":
    main()
