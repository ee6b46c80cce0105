#!/usr/bin/env python3
"""What correcting poses (`camsplat train --refine-poses`) is worth: captures whose training poses are disturbed by known errors, or not at all.

usage: poses.py CAMSPLAT OUT CAPTURE [OPTION ...]    options are for `camsplat train`

Every camera that is trained on is turned about its own place by an angle, and moved by that part of its distance from what it looks at;
directions are random, sizes normal. Test poses stay. Runs with the option show test views from where the model looks most like them. Runs
without are compared from the given test poses and, as "fitted", from poses that Gauss-Newton steps on finite differences find on their
models' own pictures, made by `camsplat render`, so that no comparison has the fit of test views on one side alone. Means over two seeds.
Needs numpy and pillow. docs/results/poses.md has what came out.
"""
import json
import os
import subprocess
import sys

import numpy as np
from PIL import Image

SIZES = (0.0, 0.1, 0.3, 1.0)
SEEDS = 2
# Steps of the differences: radians and units of the cameras' extent.
STEP, ROUNDS = 2e-3, 4


def run(*command):
    """Runs a command; ends where it fails."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def turn(vector):
    """The matrix of a rotation vector."""
    angle = np.linalg.norm(vector)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def disturbed(frames, degrees, away, seed):
    """Frames whose cameras are turned by so many degrees, and moved by as many parts of the distance to what they see."""
    rng = np.random.default_rng(seed)
    changed = []
    for frame in frames:
        pose = np.array(frame["transform_matrix"], float)
        size = np.radians(degrees) / np.sqrt(3)
        pose[:3, :3] = turn(size * rng.normal(size=3)) @ pose[:3, :3]
        pose[:3, 3] += size * away * rng.normal(size=3)
        changed.append({**frame, "transform_matrix": pose.tolist()})
    return changed


def frames_of(capture, file="transforms.json"):
    """The head of a transforms.json, and its frames whose photos are there, by name, with absolute paths."""
    head = json.load(open(f"{capture}/{file}"))
    frames = []
    for frame in head.pop("frames"):
        path = os.path.abspath(os.path.join(capture, frame["file_path"]))
        path = path if os.path.isfile(path) else f"{path}.png"
        frames += [{**frame, "file_path": path}] if os.path.isfile(path) else []
    return head, sorted(frames, key=lambda frame: frame["file_path"])


def split(capture):
    """What a capture is trained on and tested with: its own test photos, or every eighth. Each a head and frames."""
    if os.path.isfile(f"{capture}/transforms_train.json"):
        (head, train), (_, tests) = [frames_of(capture, f"transforms_{part}.json") for part in ("train", "test")]
        # Few of the hundreds that there are.
        return head, train[:: max(1, len(train) // 50)], tests[:: max(1, len(tests) // 16)]
    head, frames = frames_of(capture)
    return head, [frame for i, frame in enumerate(frames) if i % 8], frames[::8]


def write(folder, head, frames):
    """Writes a capture of photos that lie elsewhere: as links beside its file."""
    os.makedirs(f"{folder}/images", exist_ok=True)
    entries = []
    for frame in frames:
        name = os.path.basename(frame["file_path"])
        if not os.path.lexists(f"{folder}/images/{name}"):
            os.symlink(frame["file_path"], f"{folder}/images/{name}")
        entries.append({**frame, "file_path": f"images/{name}"})
    with open(f"{folder}/transforms.json", "w") as file:
        json.dump({**head, "frames": entries}, file)


def fitted(camsplat, out, head, tests, extent):
    """Mean PSNR of a model's pictures from where they look most like the test photos, which its run has written."""
    names = [os.path.splitext(os.path.basename(frame["file_path"]))[0] for frame in tests]
    photos = [picture(f"{out}/reference/{name}.png") for name in names]
    # What a straightened photo does not show is black in both pictures that the run has written.
    known = [((photo + picture(f"{out}/test/{name}.png")).max(2) > 0)[..., None] for photo, name in zip(photos, names)]
    changes, best = np.zeros((len(tests), 6)), np.full(len(tests), -np.inf)
    steps = [np.zeros(6)] + [sign * STEP * np.eye(6)[k] for k in range(6) for sign in (1, -1)]
    for _ in range(ROUNDS):
        shown = draw(camsplat, out, head, [[moved(frame, change + step, extent) for step in steps] for frame, change in zip(tests, changes)], photos[0].shape)
        for i, (photo, pictures) in enumerate(zip(photos, shown)):
            pictures = [known[i] * one for one in pictures]
            best[i] = max(best[i], -10 * np.log10(np.mean((pictures[0] - photo) ** 2)))
            slopes = np.stack([(pictures[1 + 2 * k] - pictures[2 + 2 * k]).ravel() / (2 * STEP) for k in range(6)], 1)
            left = (photo - pictures[0]).ravel()
            # What no pose explains counts for less.
            products = slopes.T * np.minimum(1, 0.05 / np.maximum(np.abs(left), 1e-6))
            change = np.linalg.solve(products @ slopes + 1e-6 * np.trace(products @ slopes) * np.eye(6), products @ left)
            changes[i] += np.clip(change, -0.01, 0.01)
    return best.mean()


def moved(frame, change, extent):
    """A frame whose camera is turned about its own place and moved."""
    pose = np.array(frame["transform_matrix"], float)
    pose[:3, :3] = turn(change[:3]) @ pose[:3, :3]
    pose[:3, 3] += extent * change[3:]
    return {**frame, "transform_matrix": pose.tolist()}


def picture(path):
    """Colours from 0 to 1."""
    return np.asarray(Image.open(path).convert("RGB"), float) / 255


def draw(camsplat, out, head, frames, shape):
    """A model's pictures of several frames for each test photo, of the size of a picture's shape."""
    named = [{**frame, "file_path": f"images/{i:04d}-{k:02d}.png"} for i, some in enumerate(frames) for k, frame in enumerate(some)]
    os.makedirs(f"{out}/looks", exist_ok=True)
    shrunk = shape[1] / head["w"] if "w" in head else 1
    lens = {key: head[key] * shrunk for key in ("fl_x", "fl_y", "cx", "cy") if key in head}
    angles = {key: head[key] for key in ("camera_angle_x", "camera_angle_y") if key in head}
    with open(f"{out}/looks/transforms.json", "w") as file:
        json.dump({**angles, **lens, "w": shape[1], "h": shape[0], "frames": named}, file)
    background = "white" if json.load(open(f"{out}/train.json"))["config"]["background"] == "white" else "black"
    run(camsplat, "render", f"{out}/point_cloud.ply", f"{out}/looks/transforms.json", "--out", f"{out}/looks/drawn", "--force",
        "--background", background)
    drawn = {os.path.splitext(name)[0]: os.path.join(where, name) for where, _, names in os.walk(f"{out}/looks/drawn") for name in names}
    return [[picture(drawn[f"{i:04d}-{k:02d}"]) for k in range(len(some))] for i, some in enumerate(frames)]


def off(folder, truth, centre, away):
    """Mean angle in degrees by which cameras of a folder see points about the subject's middle elsewhere than the true ones."""
    found = {os.path.splitext(os.path.basename(frame["file_path"]))[0]: frame for frame in json.load(open(f"{folder}/transforms.json"))["frames"]}
    points = centre + 0.3 * away * np.random.default_rng(0).uniform(-1, 1, (100, 3))

    def seen(frame):
        pose = np.array(frame["transform_matrix"], float)
        local = (points - pose[:3, 3]) @ pose[:3, :3]
        return local / np.linalg.norm(local, axis=1, keepdims=True)

    pairs = [(seen(frame), seen(found[os.path.splitext(os.path.basename(frame["file_path"]))[0]])) for frame in truth]
    return np.degrees(np.mean([np.linalg.norm(a - b, axis=1) for a, b in pairs]))


def main():
    """Makes the table of a capture."""
    camsplat, out, capture, *options = sys.argv[1:]
    head, train, tests = split(capture)
    centre = middle(train)
    away = np.median([np.linalg.norm(np.array(frame["transform_matrix"])[:3, 3] - centre) for frame in train])
    write(f"{out}/tests", head, tests)
    print(f"{len(train)} photos, {len(tests)} test views\n")
    print("| poses turned and moved by | PSNR without | fitted, without | with `--refine-poses` | gain | subject seen off by, and corrected |\n|---|---|---|---|---|---|")
    for degrees in SIZES:
        rows = []
        for seed in range(SEEDS):
            write(f"{out}/photos", head, disturbed(train, degrees, away, seed))
            both = []
            for name, option in (("plain", []), ("refined", ["--refine-poses"])):
                folder = f"{out}/{name}"
                run(camsplat, "train", f"{out}/photos", "--out", folder, "--force", "--test", f"{out}/tests", "--evaluate-every", 0, "--seed", seed, *option, *options)
                record = json.load(open(f"{folder}/train.json"))
                both.append(np.mean([view["quality"]["psnr"] for view in record["test_views"]]))
            extent = record["photos"]["extent"]
            rows.append([both[0], fitted(camsplat, f"{out}/plain", head, tests, extent), both[1], off(f"{out}/photos", train, centre, away), off(f"{out}/refined/refined", train, centre, away)])
        plain, fit, refined, before, after = np.array(rows).T
        gain = refined - fit
        print(f"| {degrees}° | {plain.mean():.2f} | {fit.mean():.2f} | {refined.mean():.2f} | {gain.mean():+.2f} ± {gain.std(ddof=1):.2f} | {before.mean():.3f}°, {after.mean():.3f}° |", flush=True)


def middle(frames):
    """The point that cameras look at: nearest to their axes by least squares."""
    poses = [np.array(frame["transform_matrix"], float) for frame in frames]
    projections = [np.eye(3) - np.outer(pose[:3, 2], pose[:3, 2]) for pose in poses]
    return np.linalg.solve(sum(projections), sum(p @ pose[:3, 3] for p, pose in zip(projections, poses)))


if __name__ == "__main__":
    main()
