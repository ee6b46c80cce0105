#!/usr/bin/env python3
"""A simulated photographer: what photos are worth that follow the advice of `camsplat next`, beside other ways to take them.

    python3 research/photographer.py --camsplat camsplat --out OUT SCENE.glb[:BOX] ...

A room has the box (X0,Y0,Z0,X1,Y1,Z1) in which people can stand; what is asked for advice knows only that it is a room.

Every way begins with the same ten photos from one side, and every photo misses its place by 4% of its distance from the middle of the
scene and its aim by 8 degrees (standard deviations); of places that are named, every fifth is skipped. Photos are rendered.

    advice    by `camsplat next` for the photos so far, five at a time up to 40, then ten
    nearest   one at a time, of five that `camsplat next` names the nearest to the photo before: COVER's embodied protocol
    once      all by one `camsplat plan --keep` for the first ten
    orbit     a walk around at even steps and one height; in a room along its walls, looking across
    habit     half of the orbit's photos, then details: from half as far
    random    at random in the region that a plan for the true surface has
    perfect   a plan for the true surface, which misses nothing: what a perfect scan and a perfect hand would give
    more      the orbit's photos and the ten that `camsplat next` then names, which miss nothing: what these gain in truth

Splats are trained on the photos and tested on 40 views at random in that region, which nothing else sees. Appends to OUT/psnr.csv: scene,
way, photos, seed, PSNR, photos with a pose, length of the way from photo to photo; and to OUT/gains.csv, of advice and orbit: scene, way,
photos, seed, what ten more photos are expected to gain, share of what viewers look at that no photo shows.

Poses are known, unless `--sfm` is given: then photos are blurred, their exposure drifts, and COLMAP poses them, one after another as they
are taken (src/app/watch/register.py); what has no pose is lost. It needs pycolmap and pillow. Needs numpy.
"""

import argparse
import csv
import json
import math
import random
import shutil
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np

FIRST, SKIPPED, TESTS, MORE = 10, 5, 40, 10
OFF, TURNED = 0.04, math.radians(8)
SIZE, FOV = (400, 300), 60
# With --sfm: photos are as many times as large for COLMAP; blur in pixels of these, and exposure in stops from photo to photo.
LARGER, BLUR, DRIFT = 2, 1.0, 0.1
WAYS = ["advice", "nearest", "once", "orbit", "habit", "random", "perfect", "more"]
# Also trained on: advice from ten photos to the next.
STEPS = [10, 30, 60, 80]
REGISTER = Path(__file__).parent.parent / "src/app/watch/register.py"


def unit(a):
    return a / np.linalg.norm(a)


def axes_of(rotation):
    """Columns right, down and forward of a quaternion x, y, z, w."""
    x, y, z, w = rotation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def poses_of(cameras):
    """Poses of plan.json or of an answer of `next`: place, and columns right, down and forward."""
    return [(np.array(camera["pose"]["position"]), axes_of(camera["pose"]["rotation"])) for camera in cameras]


def write_cameras(file, poses, size, folder=""):
    """A transforms.json of pinhole cameras."""
    focal = 0.5 * size[0] / math.tan(math.radians(FOV / 2))
    frames = []
    for i, (position, axes) in enumerate(poses):
        matrix = np.eye(4)
        matrix[:3] = np.column_stack([axes * [1, -1, -1], position])
        frames.append({"file_path": f"{folder}{i:04}.png", "transform_matrix": matrix.tolist()})
    lens = {"fl_x": focal, "fl_y": focal, "cx": size[0] / 2, "cy": size[1] / 2, "w": size[0], "h": size[1]}
    file.write_text(json.dumps({**lens, "frames": frames}))


class Scene:
    """A scene with the truth about it, and ways to take photos of it."""

    def __init__(self, scene, arguments, seed):
        file, _, box = scene.partition(":")
        self.file, self.arguments, self.seed = Path(file), arguments, seed
        self.name = self.file.stem
        self.work = arguments.out / self.name / str(seed)
        shutil.rmtree(self.work, ignore_errors=True)
        self.work.mkdir(parents=True)
        light = next((option for option in arguments.light if option.startswith(f"{self.name}:")), None)
        light = light or next((option for option in arguments.light if ":" not in option), "")
        self.light = light.removeprefix(f"{self.name}:").split()
        # Advice is by poses and points: what light the photos are in makes no difference.
        self.quick = [*(option for option in self.light if option.startswith("--env")), "--spp", 1, "--light", "traced"]
        self.preset = ["--preset", "room"] if box else []
        self.stands = [f"--box={box}"] if box else []
        self.tests = self.planned("tests", TESTS, "--method", "random", "--seed", 1000 + seed)
        region = json.loads((self.work / "tests" / "plan.json").read_text())["region"]
        self.up = np.array(region["up"])
        shape = region["shape"]
        self.box = np.array([shape["box"]["min"], shape["box"]["max"]]) if "box" in shape else None
        if self.box is not None:
            self.centre = self.box.mean(axis=0)
        else:
            self.centre = np.array(shape["shell"]["centre"])
            self.radius = 0.5 * (shape["shell"]["r_min"] + shape["shell"]["r_max"])
        self.draw = random.Random(seed)
        self.first = [self.missed(pose) for pose in self.orbit(FIRST, part=0.2)]
        self.views = self.photographed(self.tests, "views")

    def run(self, *words):
        device = ["--device", self.arguments.device] if self.arguments.device else []
        done = subprocess.run([self.arguments.camsplat, *map(str, words), *device], capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{' '.join(map(str, words))}: {done.stderr.strip()}")
        return done.stdout

    def photographed(self, poses, name, *options, larger=1):
        """Renders photos into a capture; without options in the scene's light."""
        folder = self.work / name
        shutil.rmtree(folder, ignore_errors=True)
        cameras = folder.with_suffix(".json")
        write_cameras(cameras, poses, [larger * side for side in SIZE])
        self.run("capture", self.file, cameras, "--out", folder, *(options or self.light))
        return folder

    def planned(self, name, views, *options):
        """Poses of a plan for the true surface."""
        lens = ["--fov", FOV, "--size", f"{SIZE[0]}x{SIZE[1]}"]
        self.run("plan", self.file, "--views", views, "--out", self.work / name, *self.preset, *self.stands, *lens, *options)
        return poses_of(json.loads((self.work / name / "plan.json").read_text())["cameras"][:views])

    def looking(self, position, toward):
        forward = unit(toward - position)
        right = unit(np.cross(forward, self.up))
        return position, np.column_stack([right, np.cross(forward, right), forward])

    def orbit(self, number, part=1.0, scale=1.0):
        """Cameras around the middle at even steps and one height, over a part of the circle; in a room near its walls, looking across."""
        side = unit(np.cross(self.up, [1, 0, 0] if abs(self.up[0]) < 0.9 else [0, 1, 0]))
        other = np.cross(self.up, side)
        poses = []
        for i in range(number):
            angle = 2 * math.pi * part * i / number
            a, b = math.cos(angle), math.sin(angle)
            if self.box is not None:
                half = 0.5 * (self.box[1] - self.box[0])
                reach = [0.8 * scale * np.abs(axis) @ half for axis in (side, other)]
                largest = max(abs(a), abs(b))
                place = self.centre + side * (reach[0] * a / largest) + other * (reach[1] * b / largest)
            else:
                lifted = math.radians(25)
                level = math.cos(lifted) * (a * side + b * other)
                place = self.centre + self.radius * scale * (level + math.sin(lifted) * self.up)
            poses.append(self.looking(place, self.centre))
        return poses

    def missed(self, pose):
        """The pose as a hand meets it."""
        def drawn(count):
            return np.array([self.draw.gauss(0, 1) for _ in range(count)]) / math.sqrt(count)
        position, axes = pose
        away = np.linalg.norm(position - self.centre) if self.box is None else 2.5
        position = position + OFF * away * drawn(3)
        forward = unit(axes[:, 2] + axes[:, :2] @ (math.tan(TURNED) * drawn(2)))
        right = unit(np.cross(axes[:, 1], forward))
        return position, np.column_stack([right, np.cross(forward, right), forward])

    def kept(self, poses, named=0):
        """Of places that are named those that are not skipped, missed; `named` were named before."""
        return [self.missed(pose) for i, pose in enumerate(poses, named + 1) if i % SKIPPED]

    def album(self, name):
        return (Sfm if self.arguments.sfm else Known)(self, name)

    # The ways. Each yields albums with as many photos as are asked for.

    def advice(self, numbers):
        album = self.album("advice")
        album.add(self.first)
        named = 0
        for number in sorted({*numbers, *STEPS}):
            if number > max(numbers):
                return
            while len(album) < number:
                asked = 5 if len(album) < 40 else 10
                places = album.next(asked)["poses"]
                album.add(self.kept(places, named)[: number - len(album)])
                named += asked
            yield number, album

    def nearest(self, numbers):
        album = self.album("nearest")
        album.add(self.first)
        named = 0
        for number in numbers:
            while len(album) < number:
                album.add(self.kept(album.next(5)["poses"][:1], named))
                named += 1
            yield number, album

    def once(self, numbers):
        for number in numbers:
            album = self.album("once")
            album.add(self.first)
            album.add(self.kept(album.planned(math.ceil((number - FIRST) * SKIPPED / (SKIPPED - 1))))[: number - FIRST])
            yield number, album

    def of(self, name, numbers, poses):
        for number in numbers:
            album = self.album(name)
            album.add(poses(number))
            yield number, album

    def walk(self, number):
        return self.first + [self.missed(pose) for pose in self.orbit(number - FIRST)]

    def details(self, number):
        more = number - FIRST
        near = self.orbit(more - more // 2, scale=0.75 if self.box is None else 0.5)
        return self.first + [self.missed(pose) for pose in self.orbit(more // 2) + near]

    def even(self, number):
        return self.first + self.planned(f"random{number}", number - FIRST, "--method", "random", "--seed", self.seed)

    def taken(self, way, numbers):
        ways = {
            "orbit": lambda: self.of(way, numbers, self.walk),
            "habit": lambda: self.of(way, numbers, self.details),
            "random": lambda: self.of(way, numbers, self.even),
            "perfect": lambda: self.of(way, numbers, lambda number: self.planned(f"perfect{number}", number, "--seed", self.seed)),
            "advice": lambda: self.advice(numbers),
            "nearest": lambda: self.nearest(numbers),
            "once": lambda: self.once(numbers),
        }
        return ways[way]()


class Known:
    """Photos with their true poses."""

    def __init__(self, scene, name):
        self.scene, self.name = scene, name
        self.poses = []

    def __len__(self):
        return len(self.poses)

    @property
    def posed(self):
        return len(self.poses)

    @property
    def length(self):
        return sum(np.linalg.norm(b - a) for (a, _), (b, _) in zip(self.poses, self.poses[1:]))

    def add(self, poses):
        self.poses = self.poses + list(poses)

    def next(self, number):
        capture = self.scene.photographed(self.poses, f"{self.name}-points", *self.scene.quick)
        options = [*self.scene.preset, *self.scene.arguments.options.split()]
        answer = json.loads(self.scene.run("next", capture, "--views", number, "--json", *options))
        return {**answer, "poses": poses_of(answer["next"])}

    def planned(self, number):
        capture = self.scene.photographed(self.poses, f"{self.name}-points", *self.scene.quick)
        out = self.scene.work / f"{self.name}-plan"
        kept = ["--keep", capture, "--views", number, "--out", out, "--force"]
        self.scene.run("plan", capture, *kept, "--space", "open", *self.scene.preset)
        return poses_of(json.loads((out / "plan.json").read_text())["cameras"][:number])

    def trained(self):
        capture = self.scene.photographed(self.poses, f"{self.name}-photos")
        return self.scene_trained(capture, self.scene.views)

    def scene_trained(self, capture, views, *options):
        scene = self.scene
        out = scene.work / f"{self.name}-model"
        shutil.rmtree(out, ignore_errors=True)
        words = ["--iterations", scene.arguments.iterations, "--seed", scene.seed, "--max-splats", scene.arguments.max_splats]
        scene.run("train", capture, "--test", views, "--out", out, *words, "--evaluate-every", 0, *options)
        return json.loads((out / "train.json").read_text())["evaluations"][-1]["quality"]["psnr"]


class Sfm(Known):
    """Photos that are blurred, of exposures that drift, with the poses that COLMAP finds for them."""

    def __init__(self, scene, name):
        super().__init__(scene, name)
        self.hand = random.Random(f"{name} {scene.seed}")
        self.folder = scene.work / f"{name}-sfm"
        shutil.rmtree(self.folder, ignore_errors=True)
        for images in ("photos", "cut"):
            (self.folder / images).mkdir(parents=True)
        self.exposure = 0.0

    @property
    def posed(self):
        return 0 if self.model is None else self.model.num_reg_images()

    def add(self, poses):
        from PIL import Image

        # COLMAP sees an object before its surroundings, splats are trained on the object alone.
        batch = self.scene.photographed(poses, f"{self.name}-batch", *self.scene.light, "--background", "env", larger=LARGER)
        alone = self.scene.photographed(poses, f"{self.name}-alone", *self.scene.quick, larger=LARGER)
        for i, file in enumerate(sorted((batch / "images").iterdir())):
            with Image.open(file) as image, Image.open(alone / "images" / file.name) as shape:
                pixels = np.asarray(image.convert("RGB")) / 255.0
                alpha = np.asarray(shape.convert("RGBA"))[..., 3:] / 255.0
            self.exposure = max(-0.5, min(0.5, self.exposure + self.hand.gauss(0, DRIFT)))
            pixels, alpha = np.split(self.blurred(np.concatenate([pixels**2.2, alpha], axis=2)), [3], axis=2)
            pixels = np.clip(pixels * 2**self.exposure, 0, 1) ** (1 / 2.2)
            for folder, values in (("photos", pixels), ("cut", np.concatenate([pixels, alpha], axis=2))):
                name = self.folder / folder / f"{len(self.poses) + i:04}.png"
                Image.fromarray((values * 255).round().astype(np.uint8)).save(name)
        super().add(poses)
        self.register()

    def blurred(self, pixels):
        """Moved along a direction at random while the shutter was open."""
        angle, length = self.hand.uniform(0, math.pi), abs(self.hand.gauss(0, BLUR))
        steps = np.linspace(-0.5, 0.5, 7) * length
        edge = math.ceil(length) + 1
        padded = np.pad(pixels, ((edge, edge), (edge, edge), (0, 0)), mode="edge")
        total = np.zeros_like(pixels)
        for step in steps:
            x, y = edge + step * math.cos(angle), edge + step * math.sin(angle)
            left, top = math.floor(x), math.floor(y)
            for dy, by in ((0, 1 - (y - top)), (1, y - top)):
                for dx, part in ((0, 1 - (x - left)), (1, x - left)):
                    total += by * part * padded[top + dy :, left + dx :][: pixels.shape[0], : pixels.shape[1]]
        return total / len(steps)

    def register(self):
        """Poses by what `camsplat watch` runs, and what leads from their frame to the true one."""
        import pycolmap

        files = sorted((self.folder / "photos").iterdir())
        photos = [[file.name, str(file.resolve()), "lens", zlib.crc32(file.read_bytes())] for file in files]
        request = {"work": str(self.folder.resolve()), "photos": photos}
        # Its input stays open until it has ended.
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        with subprocess.Popen([sys.executable, REGISTER], **pipes, text=True) as done:
            done.stdin.write(json.dumps(request) + "\n")
            done.stdin.flush()
            done.stdout.read()
        sparse = self.folder / "sparse/0"
        self.model = pycolmap.Reconstruction(sparse) if sparse.is_dir() else None
        if self.model is None:
            return
        found, true, turns = [], [], np.zeros((3, 3))
        for image in self.model.images.values():
            if image.has_pose:
                position, axes = self.poses[int(image.name.split(".")[0])]
                found.append(image.projection_center())
                true.append(position)
                turns += axes @ image.cam_from_world().rotation.matrix()
        # By where they look: the first photos stand in a row, which leaves open how the scene is turned about that.
        u, _, v = np.linalg.svd(turns)
        self.turn = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
        found, true = np.array(found), np.array(true)
        middle = [found.mean(axis=0), true.mean(axis=0)]
        self.scale = np.linalg.norm(true - middle[1]) / np.linalg.norm(found - middle[0])
        self.shift = middle[1] - self.scale * self.turn @ middle[0]

    def to_true(self, poses):
        return [(self.scale * self.turn @ position + self.shift, self.turn @ axes) for position, axes in poses]

    def next(self, number):
        if self.model is None:
            # What the page says then: smaller steps.
            return {"gain_db": float("nan"), "unseen": 1.0, "poses": self.scene.orbit(number, part=0.2)}
        # As `watch` does: nearer where the last photos were lost.
        placed = {int(image.name.split(".")[0]) for image in self.model.images.values() if image.has_pose}
        recent = range(max(0, len(self.poses) - 10), len(self.poses))
        connect = 5 + 15 * sum(i in placed for i in recent) / len(recent)
        options = [*self.scene.preset, "--connect", f"{connect:.1f}", *self.scene.arguments.options.split()]
        answer = json.loads(self.scene.run("next", self.folder / "sparse/0", "--views", number, "--json", *options))
        return {**answer, "poses": self.to_true(poses_of(answer["next"]))}

    def planned(self, number):
        if self.model is None:
            return self.next(number)["poses"]
        out = self.scene.work / f"{self.name}-plan"
        model = self.folder / "sparse/0"
        self.scene.run("plan", model, "--keep", model, "--views", number, "--out", out, "--force", "--space", "open", *self.scene.preset)
        return self.to_true(poses_of(json.loads((out / "plan.json").read_text())["cameras"][:number]))

    def trained(self):
        if self.model is None:
            return float("nan")
        # Test views go to the frame of COLMAP.
        views = self.scene.work / f"{self.name}-views"
        shutil.rmtree(views, ignore_errors=True)
        views.mkdir()
        turned = [(self.turn.T @ (position - self.shift) / self.scale, self.turn.T @ axes) for position, axes in self.scene.tests]
        write_cameras(views / "transforms.json", turned, SIZE, "images/")
        shutil.copytree(self.scene.views / "images", views / "images")
        capture = self.scene.work / f"{self.name}-capture"
        shutil.rmtree(capture, ignore_errors=True)
        shutil.copytree(self.folder / "sparse", capture / "sparse")
        shutil.copytree(self.folder / ("cut" if self.scene.box is None else "photos"), capture / "images")
        return self.scene_trained(capture, views, "--shrink", LARGER, "--refine-poses", "--exposure")


def compare(scene, arguments, ways, numbers):
    """One scene and seed; rows that are there are not made again."""
    psnr, gains = arguments.out / "psnr.csv", arguments.out / "gains.csv"
    done = {tuple(row[:4]) for row in csv.reader(psnr.open())} if psnr.is_file() else set()

    def missing(way, number):
        return (scene.name, way, str(number), str(scene.seed)) not in done

    def write(file, *row):
        with open(file, "a", newline="") as opened:
            csv.writer(opened).writerow([scene.name, *row])

    for way in ways:
        if way == "more":
            continue
        scene.draw = random.Random(f"{way} {scene.seed}")
        for number, album in scene.taken(way, numbers):
            if missing(way, number):
                write(psnr, way, number, scene.seed, round(album.trained(), 3), album.posed, round(album.length, 2))
                if way in ("advice", "orbit"):
                    answer = album.next(MORE)
                    write(gains, way, number, scene.seed, round(answer["gain_db"], 3), round(answer["unseen"], 4))
            if way == "orbit" and "more" in ways and missing("more", number):
                album.add(album.next(MORE)["poses"])
                write(psnr, "more", number, scene.seed, round(album.trained(), 3), album.posed, round(album.length, 2))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--camsplat", default="camsplat")
    parser.add_argument("--device", default="", help="as of camsplat")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--ways", nargs="+", default=WAYS, choices=WAYS)
    parser.add_argument("--numbers", type=int, nargs="+", default=[20, 40, 100])
    parser.add_argument("--iterations", type=int, default=5000)
    parser.add_argument("--max-splats", type=int, default=200000)
    parser.add_argument("--light", nargs="+", default=[], help="options of capture, for all scenes or SCENE:OPTIONS for one")
    parser.add_argument("--options", default="", help="more options of next, such as --options=--space=open")
    parser.add_argument("--sfm", action="store_true", help="photos by hand, posed by COLMAP")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for seed in arguments.seeds:
        for scene in arguments.scenes:
            compare(Scene(scene, arguments, seed), arguments, arguments.ways, arguments.numbers)


if __name__ == "__main__":
    main()
