#!/usr/bin/env python3
"""Frames of a rendered walk: `camsplat frames` against every n-th frame and the sharpest of each bucket of equal time.

usage: frames_walk.py make DIR a|b|c|d|e|f    a room (room.gltf), the cameras of the walk's sub-frames, and held-out cameras
       frames_walk.py film DIR                frames with motion blur and noise, of the sub-frames that `camsplat capture` rendered
       frames_walk.py compare DIR METHOD COUNT [ITERATIONS [SKIP]]
              COUNT frames by METHOD (frames, bucket, nth) are posed by COLMAP and, with ITERATIONS, trained on. By METHOD select
              half as many frames again are posed, and the best COUNT trained on. SKIP frames are left out at the walk's beginning.

Between make and film: camsplat capture DIR/room.gltf DIR/subs.json --out DIR/subs --spp 4, and DIR/tests.json --out DIR/tests --spp 16.
Needs numpy and pillow, colmap 3.8 for compare, and camsplat on the path. docs/results/frames.md has what came out.
"""
import base64
import csv
import io
import json
import os
import shutil
import subprocess
import sys

import numpy as np
from PIL import Image

from colmap_poses import aligned, colmap, models

ROOM = np.array([6.0, 2.8, 8.0])
WIDTH, HEIGHT, FOCAL, FPS = 400, 300, 300.0, 10.0
# Per walk: seed, share of a frame that the shutter is open, and x, z, yaw in degrees (0 along -z) and the seconds to get there.
WALKS = {
    "a": (11, 0.3, [
        (4.9, 6.6, 0, 0), (4.9, 5.2, -10, 2.2), (4.9, 5.2, -10, 1.6), (4.7, 3.9, -40, 1.8), (4.2, 2.3, -95, 0.75),
        (3.2, 2.0, -110, 1.2), (3.2, 2.0, -112, 1.8), (1.9, 2.1, -150, 1.3), (1.3, 3.0, -205, 0.7),
        (1.2, 4.2, -240, 1.3), (1.2, 5.3, -262, 1.1), (1.3, 5.6, -270, 1.2), (1.9, 6.0, -330, 0.65),
        (2.6, 6.2, -358, 1.0), (2.6, 6.2, -360, 1.5), (3.6, 6.2, -400, 1.2), (4.4, 5.6, -440, 1.0),
        (4.8, 4.8, -470, 1.1), (4.9, 4.4, -520, 0.7), (4.9, 4.0, -540, 1.0)]),
    "b": (23, 0.25, [
        (1.0, 6.0, 40, 0), (1.0, 4.6, 55, 2.4), (1.0, 4.6, 55, 1.3), (1.2, 3.0, 80, 2.2), (1.7, 1.9, 150, 0.8),
        (2.9, 1.5, 175, 1.6), (2.9, 1.5, 178, 1.5), (4.0, 1.6, 210, 1.5), (4.9, 2.3, 270, 0.8), (5.0, 3.6, 285, 1.8),
        (5.0, 4.8, 300, 1.6), (4.8, 5.6, 375, 0.8), (3.8, 6.3, 390, 1.6), (3.8, 6.3, 391, 1.4), (2.4, 6.2, 345, 1.6),
        (1.6, 5.9, 410, 0.8), (1.1, 5.2, 420, 1.2)]),
    "c": (31, 0.3, [
        (1.2, 5.8, 20, 0), (1.2, 4.4, 35, 2.1), (1.2, 4.4, 36, 1.2), (1.4, 2.6, 70, 2.0), (2.2, 1.7, 140, 0.85),
        (3.6, 1.5, 185, 1.7), (3.6, 1.5, 187, 1.4), (4.9, 2.2, 262, 1.0), (5.0, 4.2, 300, 2.2), (4.8, 5.6, 372, 0.9),
        (3.8, 6.3, 392, 1.5), (3.8, 6.3, 393, 1.3), (2.2, 6.2, 340, 1.4), (1.2, 5.6, 412, 0.8), (1.1, 4.9, 425, 1.3)]),
    "e": (71, 0.25, [
        (1.2, 5.8, 45, 0), (1.2, 4.0, 80, 3.0), (1.4, 2.2, 120, 3.0), (3.0, 1.6, 175, 2.8), (4.7, 2.2, 235, 2.6),
        (4.9, 4.2, 275, 3.0), (4.6, 5.9, 320, 3.0), (3.0, 6.2, 355, 2.6), (1.6, 5.6, 390, 2.2)]),
    "f": (97, 0.3, [
        (1.8, 4.8, 0, 0), (1.8, 4.8, 150, 1.6), (1.9, 5.2, 155, 1.2), (4.4, 5.6, 140, 1.6), (4.7, 5.6, 230, 0.8),
        (3.0, 5.6, 260, 1.5), (1.3, 5.6, 280, 1.5), (1.2, 5.0, 360, 0.8), (1.2, 5.0, 365, 1.0), (1.3, 2.0, 380, 2.0),
        (1.6, 1.6, 470, 0.9), (4.6, 1.8, 480, 2.2), (5.1, 2.6, 560, 0.9), (5.1, 3.8, 630, 1.2), (4.4, 5.0, 640, 1.4)]),
}
# The way of c in another hand.
WALKS["d"] = (53, *WALKS["c"][1:])
# Stops by which the exposure of a walk drifts to either side, as a phone's does.
DRIFT = {"a": 0.0, "b": 0.0, "c": 0.5, "d": 0.5, "e": 0.5, "f": 0.5}
# Share of a frame from the first row's exposure to the last one's.
READOUT = {"a": 0.0, "b": 0.0, "c": 0.0, "d": 0.2, "e": 0.2, "f": 0.2}


class Textures:
    """Pictures for surfaces, none of them twice: COLMAP would take two shelves that are alike for one."""

    def __init__(self, rng):
        self.rng = rng

    def noise(self, n, cells):
        def smooth(count):
            grid = self.rng.random((count, count))
            x = np.linspace(0, count, n, endpoint=False)
            i = x.astype(int)
            f = x - i
            f = f * f * (3 - 2 * f)
            rows = grid[:, i % count] * (1 - f) + grid[:, (i + 1) % count] * f
            return rows[i % count] * (1 - f[:, None]) + rows[(i + 1) % count] * f[:, None]
        return (sum(w * smooth(c) for c, w in cells) / sum(w for _, w in cells))[..., None]

    def wood(self, n, width, height, base):
        picture = np.zeros((n, n, 3))
        rows, joint = max(2, int(height / 0.16)), max(1, n // 400)
        for row in range(rows):
            y, x = slice(row * n // rows, (row + 1) * n // rows), 0
            while x < n:
                length = int(self.rng.uniform(0.3, 1.2) / width * n) + 2
                picture[y, x:x + length] = np.array(base) * self.rng.uniform(0.5, 1.1)
                picture[y, x:x + joint] *= 0.4
                x += length
            picture[y.start:y.start + joint] *= 0.4
        return picture * (0.7 + 0.5 * self.noise(n, [(n // 64, 1), (n // 16, 1), (n // 4, 0.7)]))

    def plaster(self, n, width, height, base):
        return np.array(base) * (0.9 + 0.1 * self.noise(n, [(4, 1), (n // 32, 0.5), (n // 8, 0.3)]))

    def books(self, n, width, height):
        picture = np.full((n, n, 3), 0.12)
        shelves, scale = max(1, round(height / 0.4)), n / width
        for shelf in range(shelves):
            x, y, tall = 0, shelf * n // shelves, n // shelves
            while x < n:
                thick = max(3, int(self.rng.uniform(0.02, 0.07) * scale))
                top = int(self.rng.uniform(0.1, 0.35) * tall)
                colour = self.rng.uniform(0.15, 0.95, 3)
                picture[y + top:y + tall - tall // 14, x:x + thick - 1] = colour
                for _ in range(3):
                    band = y + int(self.rng.integers(top + tall // 20, tall - tall // 7))
                    picture[band:band + max(1, tall // 30), x + 1:x + thick - 2] = 1 - colour
                x += thick
        return picture * (0.85 + 0.3 * self.noise(n, [(n // 8, 1)]))

    def poster(self, n, width, height):
        shapes = self.noise(n, [(3, 1), (7, 0.8), (20, 0.6), (60, 0.4)])[..., 0]
        light = self.noise(n, [(4, 1), (12, 1), (50, 0.5)])
        colours = self.rng.random((8, 3))
        level = np.clip(((shapes - shapes.min()) / np.ptp(shapes) * 8).astype(int), 0, 7)
        return colours[level] * (0.6 + 0.6 * light)

    def brick(self, n, width, height):
        picture = np.full((n, n, 3), 0.75)
        rows, columns, joint = max(2, int(height / 0.14)), max(2, int(width / 0.3)), max(1, n // 500)
        for row in range(rows):
            for column in range(columns):
                x = int((column + 0.5 * (row % 2)) * n / columns)
                across = np.arange(x + joint, x + n // columns - joint) % n
                colour = np.array([0.7, 0.32, 0.22]) * self.rng.uniform(0.45, 1.2)
                picture[row * n // rows + joint:(row + 1) * n // rows - joint, across] = colour
        return picture * (0.75 + 0.4 * self.noise(n, [(n // 16, 1), (n // 5, 1)]))


def room():
    """The room as glTF, unlit, so that pictures of it have no noise."""
    textures, faces = Textures(np.random.default_rng(5)), []

    def quad(origin, u, v, kind, *base):
        origin, u, v = map(np.array, (origin, u, v))
        width, height = np.linalg.norm(u), np.linalg.norm(v)
        longest = max(width, height)
        n = 1024 if longest > 1.5 else 512 if longest > 0.5 else 128
        picture = getattr(textures, kind)(n, width, height, *base)
        png = io.BytesIO()
        Image.fromarray(np.clip(255 * picture, 0, 255).astype(np.uint8)).save(png, "PNG")
        faces.append((np.array([origin, origin + u, origin + u + v, origin + v], np.float32), png.getvalue()))

    def box(low, high, side, top):
        (x0, y0, z0), (x1, y1, z1) = low, high
        x, y, z = x1 - x0, y1 - y0, z1 - z0
        for origin, u, v, cover in [
            ((x0, y0, z1), (x, 0, 0), (0, y, 0), side), ((x1, y0, z0), (-x, 0, 0), (0, y, 0), side),
            ((x1, y0, z1), (0, 0, -z), (0, y, 0), side), ((x0, y0, z0), (0, 0, z), (0, y, 0), side),
            ((x0, y1, z1), (x, 0, 0), (0, 0, -z), top), ((x0, y0, z0), (x, 0, 0), (0, 0, z), side),
        ]:
            quad(origin, u, v, *cover)

    w, h, d = ROOM
    white, dark = ("plaster", (0.85, 0.83, 0.78)), ("wood", (0.45, 0.28, 0.2))
    shelf, cloth, bricks = ("books",), ("poster",), ("brick",)
    quad((0, 0, d), (w, 0, 0), (0, 0, -d), "wood", (0.75, 0.5, 0.3))
    quad((0, h, 0), (w, 0, 0), (0, 0, d), "plaster", (0.92, 0.92, 0.9))
    quad((0, 0, 0), (w, 0, 0), (0, h, 0), *bricks)
    for origin, u in [((w, 0, d), (-w, 0, 0)), ((0, 0, d), (0, 0, -d)), ((w, 0, 0), (0, 0, d))]:
        quad(origin, u, (0, h, 0), *white)
    for origin, u, height in [
        ((0.01, 1.0, 3.2), (0, 0, -1.4), 1.1), ((0.01, 1.2, 5.6), (0, 0, -0.9), 0.9),
        ((w - 0.01, 0.9, 1.5), (0, 0, 1.6), 1.2), ((w - 0.01, 1.2, 4.4), (0, 0, 1.0), 0.8),
        ((4.6, 1.0, d - 0.01), (-1.5, 0, 0), 1.1), ((1.9, 1.2, d - 0.01), (-0.9, 0, 0), 0.7),
    ]:
        quad(origin, u, (0, height, 0), "poster")
    for low, high, side, top in [
        ((0, 0, 0.5), (0.35, 2.1, 1.5), shelf, dark), ((0, 0, 6.2), (0.35, 1.9, 7.4), shelf, dark),
        ((5.65, 0, 6), (6, 2.2, 7.2), shelf, dark), ((2.4, 0.68, 3.2), (3.8, 0.76, 4.6), dark, dark),
        ((2.5, 0, 3.3), (2.6, 0.68, 3.4), dark, dark), ((3.6, 0, 4.4), (3.7, 0.68, 4.5), dark, dark),
        ((2.9, 0.76, 3.6), (3.2, 1.05, 3.9), cloth, cloth), ((3.4, 0.76, 4.1), (3.6, 0.95, 4.35), bricks, bricks),
        ((4.6, 0, 0.4), (5.8, 0.45, 1.3), cloth, cloth), ((1.2, 0, 6.9), (2.6, 0.5, 7.7), cloth, cloth),
        ((4.3, 0, 2.9), (4.8, 0.5, 3.4), shelf, dark),
    ]:
        box(low, high, side, top)

    blob, views, accessors, primitives = b"", [], [], []

    def view(data):
        nonlocal blob
        views.append({"buffer": 0, "byteOffset": len(blob), "byteLength": len(data)})
        blob += data + b"\0" * (-len(data) % 4)
        return len(views) - 1

    def accessor(values, kind, component, **more):
        accessors.append({"bufferView": view(values.tobytes()), "componentType": component, "count": len(values), "type": kind, **more})
        return len(accessors) - 1

    for number, (corners, _) in enumerate(faces):
        bounds = {"min": corners.min(0).tolist(), "max": corners.max(0).tolist()}
        attributes = {
            "POSITION": accessor(corners, "VEC3", 5126, **bounds),
            "TEXCOORD_0": accessor(np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32), "VEC2", 5126),
        }
        indices = accessor(np.array([0, 1, 2, 0, 2, 3], np.uint16), "SCALAR", 5123)
        primitives.append({"attributes": attributes, "indices": indices, "material": number})
    images = [{"bufferView": view(png), "mimeType": "image/png"} for _, png in faces]
    unlit = {"doubleSided": True, "extensions": {"KHR_materials_unlit": {}}}
    materials = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": i}}, **unlit} for i in range(len(faces))]
    return {
        "asset": {"version": "2.0"}, "extensionsUsed": ["KHR_materials_unlit"], "scene": 0, "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}], "meshes": [{"primitives": primitives}], "materials": materials,
        "textures": [{"source": i} for i in range(len(faces))], "images": images, "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(blob), "uri": "data:application/octet-stream;base64," + base64.b64encode(blob).decode()}],
    }


def looking(position, yaw, pitch, roll):
    """World-from-camera, OpenGL axes."""
    a, b, c = np.radians([yaw, pitch, roll])
    forward = np.array([np.sin(a) * np.cos(b), np.sin(b), -np.cos(a) * np.cos(b)])
    right = np.cross(forward, [0, 1, 0])
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    pose = np.eye(4)
    pose[:3, 0], pose[:3, 1] = np.cos(c) * right + np.sin(c) * up, np.cos(c) * up - np.sin(c) * right
    pose[:3, 2], pose[:3, 3] = -forward, position
    return pose


def cameras(poses):
    frames = [{"file_path": f"images/{i:05d}.png", "transform_matrix": pose.tolist()} for i, pose in enumerate(poses)]
    lens = {"w": WIDTH, "h": HEIGHT, "fl_x": FOCAL, "fl_y": FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2}
    return {"camera_model": "PINHOLE", **lens, "frames": frames}


def make(folder, walk):
    seed, shutter, way = WALKS[walk]
    readout = READOUT[walk]
    span = shutter + readout
    rng = np.random.default_rng(seed)
    times = np.cumsum([stop[3] for stop in way])
    phase = rng.uniform(0, 2 * np.pi, 12)
    jolts = np.sort(rng.uniform(0, times[-1], 26))
    strength = rng.choice([-1, 1], 26) * rng.uniform(1.0, 3.0, 26)

    def path(t):
        i = min(max(int(np.searchsorted(times, t, side="right")) - 1, 0), len(way) - 2)
        u = np.clip((t - times[i]) / (times[i + 1] - times[i]), 0, 1)
        u = u * u * (3 - 2 * u)
        return np.array(way[i][:3], float) * (1 - u) + np.array(way[i + 1][:3], float) * u

    def pose(t):
        """Where the path is, in a hand that trembles, with a jolt at each step."""
        x, z, yaw = path(t)

        def wave(k, frequency):
            return np.sin(2 * np.pi * frequency * t + phase[k])
        jolt = sum(a * np.exp(-((t - j) / 0.05) ** 2) for j, a in zip(jolts, strength))
        yaw = yaw + 0.35 * wave(0, 1.3) + 0.15 * wave(1, 3.7) + 0.5 * jolt
        pitch = -9 + 0.5 * wave(2, 0.9) + 0.12 * wave(3, 4.1) + jolt
        position = np.array([x + 0.01 * wave(6, 1.1), 1.45 + 0.015 * wave(5, 1.8), z + 0.01 * wave(7, 1.0)])
        return looking(position, yaw, pitch, 0.5 * wave(4, 0.7))

    subs, groups = [], []
    for i in range(int(times[-1] * FPS)):
        t = (i + 0.5) / FPS
        a, b = pose(t - 0.5 * shutter / FPS), pose(t + 0.5 * shutter / FPS)
        angle = np.arccos(np.clip((np.trace(a[:3, :3].T @ b[:3, :3]) - 1) / 2, -1, 1))
        # Most of what is seen is about 2.5 m away.
        blur = FOCAL * angle + FOCAL * np.linalg.norm(a[:3, 3] - b[:3, 3]) / 2.5
        number = int(np.clip(np.ceil(blur * span / shutter / 2), 2, 10 * span / shutter))
        groups.append({"subs": list(range(len(subs), len(subs) + number)), "pose": pose(t).tolist(), "blur": blur})
        subs += [pose(t + span / FPS * ((k + 0.5) / number - 0.5)) for k in range(number)]
    # Held-out views where the walk goes, evenly along its path and not its time, a little beside it.
    points = np.array([path(t) for t in np.linspace(0, times[-1], 4000)])
    steps = np.linalg.norm(np.diff(points[:, :2], axis=0), axis=1) / 2.5 + np.radians(np.abs(np.diff(points[:, 2])))
    along, tests = np.r_[0, np.cumsum(steps)], []
    for k in range(30):
        x, z, yaw = [np.interp(along[-1] * (k + 0.5) / 30, along, points[:, j]) for j in range(3)]
        position = [x + rng.uniform(-0.12, 0.12), 1.45 + rng.uniform(-0.1, 0.1), z + rng.uniform(-0.12, 0.12)]
        tests.append(looking(np.array(position), yaw + rng.uniform(-8, 8), -9 + rng.uniform(-5, 5), 0))
    os.makedirs(folder, exist_ok=True)
    for name, value in [("room.gltf", room()), ("subs.json", cameras(subs)), ("groups.json", groups), ("tests.json", cameras(tests))]:
        with open(f"{folder}/{name}", "w") as file:
            json.dump(value, file)
    with open(f"{folder}/phone.json", "w") as file:
        json.dump({"drift": DRIFT[walk], "shutter": shutter / span, "readout": readout / span}, file)
    print(f"{len(groups)} frames of {len(subs)} sub-frames; median blur {np.median([g['blur'] for g in groups]):.1f} pixels")


def film(folder):
    rng = np.random.default_rng(3)
    os.makedirs(f"{folder}/walk", exist_ok=True)
    phone = json.load(open(f"{folder}/phone.json"))
    # When each row begins to be exposed, from 0 at the first sub-frame's beginning to 1 at the last one's end.
    begins = phone["readout"] * np.linspace(0, 1, HEIGHT)
    for i, group in enumerate(json.load(open(f"{folder}/groups.json"))):
        gain = 2 ** (phone["drift"] * (0.7 * np.sin(0.06 * i) + 0.3 * np.sin(0.23 * i + 1)))
        light, number = 0, len(group["subs"])
        for k, sub in enumerate(group["subs"]):
            picture = np.asarray(Image.open(f"{folder}/subs/images/{sub:05d}.png").convert("RGB"), float)
            open_for = np.clip(np.minimum(begins + phone["shutter"], (k + 1) / number) - np.maximum(begins, k / number), 0, 1)
            light = light + (open_for / phone["shutter"])[:, None, None] * (picture / 255) ** 2.2
        mean = (gain * light) ** (1 / 2.2) * 255
        noisy = np.clip(mean + rng.normal(0, 1.5, mean.shape), 0, 255).round().astype(np.uint8)
        Image.fromarray(noisy).save(f"{folder}/walk/{i:03d}.png")


def laplacian(path):
    """Variance of the Laplacian, by which frames are usually ranked."""
    g = np.asarray(Image.open(path).convert("L"), float)
    return (g[:-2, 1:-1] + g[2:, 1:-1] + g[1:-1, :-2] + g[1:-1, 2:] - 4 * g[1:-1, 1:-1]).var()


def choose(folder, method, count, skip, out):
    names = sorted(os.listdir(f"{folder}/walk"))[skip:]
    if method == "frames":
        shutil.rmtree(f"{out}-walk", ignore_errors=True)
        os.makedirs(f"{out}-walk")
        for name in names:
            os.symlink(os.path.abspath(f"{folder}/walk/{name}"), f"{out}-walk/{name}")
        subprocess.run(["camsplat", "frames", f"{out}-walk", "--count", str(count), "--out", out, "--force"], check=True)
        return [int(row["name"][:3]) for row in csv.DictReader(open(f"{out}/frames.csv")) if row["chosen"] == "1"]
    if method == "nth":
        chosen = sorted({round(i) for i in np.linspace(0, len(names) - 1, count)})
    else:
        ends = np.linspace(0, len(names), count + 1).round().astype(int)
        sharpness = [laplacian(f"{folder}/walk/{name}") for name in names]
        chosen = [max(range(a, b), key=lambda i: sharpness[i]) for a, b in zip(ends[:-1], ends[1:])]
    os.makedirs(f"{out}/images", exist_ok=True)
    for i in chosen:
        shutil.copy(f"{folder}/walk/{names[i]}", f"{out}/images")
    return [i + skip for i in chosen]


def compare(folder, method, count, iterations=0, skip=0):
    out = f"{folder}/{method}-{count}-{skip}"
    shutil.rmtree(out, ignore_errors=True)
    by, number = ("frames", count * 3 // 2) if method == "select" else (method, count)
    chosen = choose(folder, by, number, skip, out)
    os.makedirs(f"{out}/sparse")
    database, images = ["--database_path", f"{out}/database.db"], ["--image_path", f"{out}/images"]
    log = f"{out}/colmap.log"
    single = ["--ImageReader.single_camera", "1", "--ImageReader.camera_model", "OPENCV", "--SiftExtraction.use_gpu", "0"]
    colmap(log, "feature_extractor", *database, *images, *single)
    colmap(log, "exhaustive_matcher", *database, "--SiftMatching.use_gpu", "0")
    # It fails where no pair of frames will do to begin with.
    colmap(log, "mapper", *database, *images, "--output_path", f"{out}/sparse", check=False)
    found = models(f"{out}/sparse", log)
    if not found:
        return print(f"{out}: {len(chosen)} chosen; no model")
    best = max(found, key=lambda model: len(found[model]))
    groups = json.load(open(f"{folder}/groups.json"))
    # Frames that are registered in the wrong place do not count for the alignment.
    (scale, rotation, shift), off, angle = aligned(found[best], lambda name: np.array(groups[int(name.split(".")[0])]["pose"]), 0.02)
    right = np.sum((off < 0.15) & (angle < 3))
    print(
        f"{out}: {len(chosen)} chosen, mean blur {np.mean([groups[i]['blur'] for i in chosen]):.1f} pixels; {len(found)} models, "
        f"{len(off)} registered, {right} within 0.15 m and 3 degrees; off by {100 * np.median(off):.1f} cm (at most {100 * off.max():.0f}) "
        f"and {np.median(angle):.2f} degrees"
    )
    tests = json.load(open(f"{folder}/tests.json"))
    for frame in tests["frames"]:
        pose = np.array(frame["transform_matrix"])
        pose[:3, :3], pose[:3, 3] = rotation @ pose[:3, :3], scale * rotation @ pose[:3, 3] + shift
        frame["transform_matrix"] = pose.tolist()
    os.makedirs(f"{out}/tests")
    json.dump(tests, open(f"{out}/tests/transforms.json", "w"))
    os.symlink(os.path.abspath(f"{folder}/tests/images"), f"{out}/tests/images")
    os.makedirs(f"{out}/capture/sparse")
    shutil.copytree(f"{out}/sparse/{best}", f"{out}/capture/sparse/0")
    os.symlink(os.path.abspath(f"{out}/images"), f"{out}/capture/images")
    if method == "select":
        os.rename(f"{out}/capture", f"{out}/posed")
        subprocess.run(["camsplat", "select", f"{out}/posed", "--count", str(count), "--out", f"{out}/capture"], check=True)
    if iterations == 0:
        return
    options = f"--iterations {iterations} --max-splats 15000 --sh 1 --shrink 2 --evaluate-every 0 --seed 0"
    train = ["camsplat", "train", f"{out}/capture", "--test", f"{out}/tests", "--out", f"{out}/model", *options.split()]
    subprocess.run(train, check=True, stdout=subprocess.DEVNULL)
    quality = json.load(open(f"{out}/model/train.json"))["evaluations"][-1]["quality"]
    print(f"{out}: PSNR {quality['psnr']:.2f}, SSIM {quality['ssim']:.3f}, LPIPS {quality['lpips']:.3f}")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["make", folder, walk]:
            make(folder, walk)
        case ["film", folder]:
            film(folder)
        case ["compare", folder, method, count, *rest] if len(rest) <= 2:
            compare(folder, method, int(count), *map(int, rest))
        case _:
            sys.exit(__doc__)
