#!/usr/bin/env python3
"""How the error of trained splats rises with angle and footprint: forms of the law held against runs of the benchmark.

    python3 research/law.py SCENE ... --bench BENCH --data DATA --out OUT [--by views] [--good]

BENCH is the folder that `camsplat benchmark` wrote, of rooms or of objects. Of a built-in room DATA has the files NAME.ply and NAME.json,
which are mesh.ply and task.json of `camsplat evaluate --situation NAME --prepare --surface true`. Forms are fitted to the scenes of the
benchmark's fit split, to the means of layouts over test views, or with `--by views` to every test view, less its own mean over layouts;
with `--good` without random cameras and half of a sphere.

Printed for each form: its coefficients; for each scene Pearson's correlation over layouts, decibels trained for one expected, and the
standard deviation of what is left, of all layouts, those of one lens, both without random cameras or half of a sphere, and those of as many
views; of fitted forms the same of each scene by the law of the others; of these and of laws that are not fitted here what is expected of
each layout and was trained. Each scene counts the same. At the end, how many of the intervals that camsplat gives hold, how much its law's
angles and footprints, without its end, weigh when fitted to single test views of layouts of as many views in a room, and how well each
layout's splats show the photos they were trained on, before the training's half and before its end, and each set of test views.
Needs numpy and scipy.
"""

import argparse
import copy
import json
import re
import subprocess
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

SOURCES = Path(__file__).parent.parent / "src"
SCENES = SOURCES / "lab/benchmark/scenes.json"


class Scene:
    def __init__(self, name, arguments):
        scene = next(scene for scene in json.loads(SCENES.read_text()) if scene["name"] == name)
        self.name, self.fitted, self.object = name, scene["split"] == "fit", "heights" not in scene
        box = scene.get("box")
        if not box and not self.object:
            region = json.loads((arguments.data / f"{name}.json").read_text())["region"]
            box = region["shape"]["box"]["min"] + region["shape"]["box"]["max"]
        runs = arguments.bench / name / name
        results = json.loads((arguments.bench / name / "results.json").read_text())["runs"]
        inputs = [json.loads((runs / run["folder"] / "done.json").read_text())["inputs"] for run in results]
        tests = runs / inputs[0]["tests"] / "transforms.json"
        out = arguments.out / name
        surface = arguments.data / scene.get("file", f"{name}.ply")
        cameras = [runs / of["photos"] / "transforms.json" for of in inputs]
        shape = "object" if self.object else ",".join(map(str, box))
        subprocess.run([arguments.looks, surface, shape, tests, out, *cameras], check=True)
        looks = json.loads(out.with_suffix(".json").read_text())
        ends, self.beside = looks["ends"], np.array(looks["beside"])
        self.starts, self.sizes = np.array([0, *ends[:-1]]), np.diff([0, *ends])
        near = np.fromfile(out.with_suffix(".f32"), np.float32).astype(float).reshape(len(results), ends[-1], 3)
        self.first, self.third, self.farther = near[..., 0], near[..., 1], near[..., 2]
        self.log_views = np.log(np.array([run["views"] for run in results]) / 50)[:, None]
        self.one_lens = np.array(["@" not in run["method"] for run in results])
        # NAME of NAME=cameras:FILE and NAME=lenses:FILE; of ours:law.nearest=... all of it, since laws differ.
        self.layouts = [(re.split("=(?:cameras|lenses):", run["method"])[0], run["views"]) for run in results]
        self.half = np.array([method == "half" for method, _ in self.layouts])
        self.bad = self.half | np.array([method == "random" for method, _ in self.layouts])

        # The trainer leaves out photos of one colour, and `looks` test views that show little of an object.
        names = [Path(frame["file_path"]).name for frame in json.loads(tests.read_text())["frames"]]
        reports = [json.loads((runs / run["folder"] / "train.json").read_text()) for run in results]
        trained = [{view["name"]: view["quality"]["psnr"] for view in report["test_views"]} for report in reports]
        self.photos = [(photos_until(report, 0.5), photos_until(report, 1)) for report in reports]
        names = [names[view] for view in looks["shown"]]
        self.tested = np.array([name in trained[0] for name in names])
        self.psnr = np.array([[views[name] for name in names if name in views] for views in trained])
        self.sets = np.array([name.rsplit("_", 1)[0] for name in names if name in trained[0]])

    def only(self, which):
        """The same with some of its layouts."""
        part = copy.copy(self)
        for name in ("first", "third", "farther", "log_views", "one_lens", "half", "bad", "psnr"):
            setattr(part, name, getattr(self, name)[which])
        part.layouts, part.photos = ([one for one, has in zip(all_of, which) if has] for all_of in (self.layouts, self.photos))
        return part

    def silhouette(self):
        """Pixels of the surface next to one beside it, of 16 x 16 in each test view."""
        assert (self.sizes == 256).all(), "a pixel of a test view counts for nothing"
        beside = self.beside.reshape(-1, 16, 16)
        edge = np.zeros_like(beside)
        for axis in (1, 2):
            for way in (1, -1):
                other = np.roll(beside, way, axis)
                other[(slice(None),) * axis + (0 if way == 1 else -1,)] = False
                edge |= other
        return (edge & ~beside).ravel()

    def expected(self, log_error):
        """PSNR of each layout and test view that follows from the errors of its pixels, up to the scene's own level."""
        means = np.add.reduceat(np.exp(log_error), self.starts, axis=1) / self.sizes
        return (-10 * np.log10(means))[:, self.tested]

    def left(self, log_error, by):
        """What is left of PSNR, each scene with the same weight."""
        left = self.psnr - self.expected(log_error)
        if by == "layouts":
            left = left.mean(axis=1, keepdims=True)
        return (left - left.mean(axis=0)).ravel() / np.sqrt(left.size)


def photos_until(report, part):
    """How well splats showed the photos they were trained on, PSNR, in the tenth of their training that ends at this part of it."""
    count = report["iterations"]
    return np.mean([point["psnr"] for point in report["curve"] if part - 0.1 < point["iteration"] / count <= part])


def first_edition(scene, p):
    return 1.275 * scene.first + 0.668 * scene.third + 0.834 * scene.farther


def steeper(scene, p):
    """An earlier fit, to eight layouts in each of three rooms."""
    return ending(scene, [6.15, 0, 0.68, 6.62])


def former(scene, p):
    """The law of rooms until 2026-11-30."""
    return ending(scene, [3.1990838559128445, 0.7750363388219793, 0.9719354819566841, 80])


def file_of(scene):
    name = "law_of_objects.json" if scene.object else "law_of_rooms.json"
    return json.loads((SOURCES / "planner/quality" / name).read_text())


def held(scene):
    """How many 90% intervals of differences of two layouts with one lens, by camsplat's law, hold what was trained, and of how many."""
    expected, trained = scene.expected(built_in(scene, [])).mean(axis=1)[scene.one_lens], scene.psnr.mean(axis=1)[scene.one_lens]
    a, b = np.triu_indices(len(expected), 1)
    alike, each = file_of(scene)["spread"]
    wide = 1.645 * np.hypot(alike, each * (expected[a] - expected[b]))
    return np.sum(np.abs((trained - expected)[a] - (trained - expected)[b]) < wide), len(a)


def built_in(scene, p):
    """The law of camsplat."""
    law = file_of(scene)["coefficients"]
    log_error = ending(scene, [law["nearest"], law["third"], law["farther"], law["most"] or 80])
    return log_error + np.log(law["background"]) * scene.beside if scene.object else log_error


def fitted(scene, p):
    return p[0] * scene.first + p[1] * scene.third + p[2] * scene.farther


def ending(scene, p):
    """Errors end at what is shown where nothing was seen, `p[3]` above those of a camera that stands where the viewer does."""
    return -np.logaddexp(-fitted(scene, p), -p[3])


def far_beyond(scene, p):
    """Footprints cost nothing up to 2.5 times the viewer's."""
    return p[0] * scene.first + p[1] * scene.third + p[2] * np.maximum(scene.farther - np.log(2.5), 0)


def of_object(form):
    """With pixels beside the object, whose weight is the exponential of the last parameter."""
    def law(scene, p):
        return form(scene, p[:-1]) + p[-1] * scene.beside

    law.__name__ = form.__name__
    return law


def first_edition_of_objects(scene, p):
    return first_edition(scene, p) + np.log(0.0463) * scene.beside


def of_angles(name, of):
    """Without an end, by a function of the nearest view's angle."""
    def law(scene, p):
        return p[0] * of(scene.first) + p[1] * scene.third + p[2] * scene.farther

    law.__name__ = name
    return law


def weighed(scene, p):
    """The law of camsplat without its end, what it says of angles and of footprints multiplied by `p`."""
    law = file_of(scene)["coefficients"]
    return p[0] * (law["nearest"] * scene.first + law["third"] * scene.third) + p[1] * law["farther"] * scene.farther


def steeper_at_silhouettes(scene, p):
    rise = (p[0] * scene.first + p[1] * scene.third) * (1 + p[4] * scene.silhouette()) + p[2] * scene.farther
    return -np.logaddexp(-rise, -p[3])


def by_number_of_views(scene, p):
    return ending(scene, p) + p[4] * scene.log_views


def never_ending_by_number_of_views(scene, p):
    return fitted(scene, p) + p[3] * scene.log_views


def least(scene, p):
    """With an error that no photo lowers."""
    return np.logaddexp(fitted(scene, p), p[3])


def power(scene, p):
    return p[0] * scene.first ** p[3] + p[1] * scene.third ** p[3] + p[2] * scene.farther


def residuals(scenes, law, p, by):
    return np.concatenate([scene.left(law(scene, p), by) for scene in scenes])


def fit(scenes, law, start, by):
    return least_squares(lambda p: residuals(scenes, law, p, by), start, diff_step=1e-3).x


def compare(scene, log_error, which, each):
    """Prints how what is expected of layouts goes with what they trained; of each layout too where asked for."""
    expected, trained = scene.expected(log_error).mean(axis=1), scene.psnr.mean(axis=1)
    parts = {"all": scene.one_lens | True, "good": ~scene.bad, "one lens": scene.one_lens, "one lens, good": scene.one_lens & ~scene.bad}
    views = np.array([views for _, views in scene.layouts])
    left_out, without = ("half", scene.half) if scene.object else ("random", scene.bad)
    parts |= {f"{n} views, not {left_out}": (views == n) & ~without for n in np.unique(views)}
    for part, of in parts.items():
        if of.sum() < 3:
            continue
        x, y = expected[of], trained[of]
        print(f"  {scene.name} ({which}, {part}): {np.corrcoef(x, y)[0, 1]:.3f}, {np.polyfit(x, y, 1)[0]:.2f}, {(y - x).std():.2f} dB")
    if each:
        layouts = zip(scene.layouts, expected, trained)
        print("  " + "; ".join(f"{method} {views}: {x:.2f}, {y:.2f}" for (method, views), x, y in layouts))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--looks", default="target/release/examples/looks")
    parser.add_argument("--bench", type=Path, required=True)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--by", choices=["layouts", "views"], default="layouts")
    parser.add_argument("--good", action="store_true", help="fit to layouts but random cameras and half of a sphere")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    scenes = [Scene(name, arguments) for name in arguments.scenes]
    if scenes[0].object:
        angles = [("root", np.sqrt), ("logarithm", lambda g: np.log1p(g / 0.3)), ("sine", lambda g: np.sin(np.minimum(g, 1.57))),
                  ("chord", lambda g: 2 * np.sin(g / 2))]
        forms = [(fitted, []), (ending, [5]), *((of_angles(*one), []) for one in angles), (steeper_at_silhouettes, [5, 0.1]),
                 (by_number_of_views, [5, 0.1])]
        laws = [(first_edition_of_objects, []), (built_in, []), *((of_object(form), [3, 1, 0.6, *more, -4]) for form, more in forms)]
    else:
        forms = [(fitted, []), (ending, [6]), (far_beyond, []), (never_ending_by_number_of_views, [0.1]), (least, [-1]), (power, [1.2])]
        laws = [(first_edition, []), (steeper, []), (former, []), (built_in, []), *((form, [2, 0.5, 0.7, *more]) for form, more in forms)]
    of_fit = [scene.only(~scene.bad) if arguments.good else scene for scene in scenes if scene.fitted]
    for law, start in laws:
        if start and not of_fit:
            continue
        p = fit(of_fit, law, start, arguments.by) if start else []
        print(law.__name__, " ".join(f"{value:.2f}" for value in p))
        if of_fit:
            print(f"  mean square {np.sum(residuals(of_fit, law, p, arguments.by) ** 2) / len(of_fit):.2f}")
        for scene in scenes:
            compare(scene, law(scene, p), "fit" if scene.fitted else "not fitted", each=not start)
        if not start or len(of_fit) < 3:
            continue
        for scene in of_fit:
            others = fit([other for other in of_fit if other is not scene], law, start, arguments.by)
            compare(scene, law(scene, others), "by the law of the others", each=True)
    for scene in scenes:
        holding, pairs = held(scene)
        fitted_to = ", to which it was fitted," if scene.name in file_of(scene)["scenes"] else ""
        print(f"of {pairs} differences of {scene.name}{fitted_to} 90% intervals hold {holding}")
        views = np.array([views for _, views in scene.layouts])
        for count in np.unique(views):
            alike = (views == count) & ~scene.bad
            if alike.sum() >= 3 and not scene.object:
                p = fit([scene.only(alike)], weighed, [1, 1], "views")
                print(f"  {count} views, not random: angles weigh {p[0]:.2f} of what they do in the law, footprints {p[1]:.2f}")
        for (method, views), (half, end), psnr in zip(scene.layouts, scene.photos, scene.psnr):
            tests = ", ".join(f"{name} {psnr[scene.sets == name].mean():.2f}" for name in np.unique(scene.sets))
            print(f"  {method} {views}: photos {half:.2f}, {end:.2f}; test views {tests}")


if __name__ == "__main__":
    main()
