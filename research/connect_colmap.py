#!/usr/bin/env python3
"""Which photos of a plan COLMAP registers, with and without `plan --connect`.

usage: connect_colmap.py make DIR            the scenes: a room (room.gltf), a rock (rock.gltf), and photos that are kept of each
       connect_colmap.py register CAPTURE... COLMAP on what `camsplat capture` rendered of a plan; a line each
       connect_colmap.py pairs CAPTURE...    matches of its pairs of photos by their angle at the origin, after register

Needs numpy and pillow, and colmap 3.8 for register. docs/results/others.md has the commands between the two and what came out.
"""
import base64
import io
import json
import os
import shutil
import sqlite3
import sys

import numpy as np
from PIL import Image

from colmap_poses import aligned, colmap, models
from frames_walk import looking, room


def solid_noise(rng, places, cells):
    """Smooth noise between 0 and 1 at places in [-1, 1]^3, on grids of so many cells a side, weighted."""
    total = np.zeros(places.shape[:-1])
    for count, weight in cells:
        grid = rng.random((count + 1,) * 3)
        x = (places + 1) / 2 * count
        i = np.clip(x.astype(int), 0, count - 1)
        f = x - i
        f = f * f * (3 - 2 * f)
        for corner in np.ndindex(2, 2, 2):
            share = np.prod([f[..., k] if corner[k] else 1 - f[..., k] for k in range(3)], 0)
            total += weight * share * grid[tuple(i[..., k] + corner[k] for k in range(3))]
    return total / sum(weight for _, weight in cells)


def rock(seed):
    """A rough rock about as large as the unit sphere, with a pattern that is nowhere the same; matte, as glTF."""
    rng = np.random.default_rng(seed)

    def directions(height):
        v, u = np.meshgrid(np.linspace(0, np.pi, height), np.linspace(0, 2 * np.pi, 2 * height), indexing="ij")
        return np.stack([np.sin(v) * np.cos(u), np.cos(v), -np.sin(v) * np.sin(u)], -1)
    way = directions(97)
    radius = 0.55 + 0.45 * solid_noise(rng, way, [(3, 1), (8, 0.4)])
    rows, columns = way.shape[:2]
    positions = (way * radius[..., None]).reshape(-1, 3).astype(np.float32)
    v, u = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 1, columns), indexing="ij")
    texture_at = np.stack([u, v], -1).reshape(-1, 2).astype(np.float32)
    corner = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    triangles = np.stack([a, b, c, a, c, d], -1).reshape(-1).astype(np.uint32)
    texels = directions(1024)
    level = solid_noise(rng, texels, [(6, 1), (16, 0.8), (50, 0.8), (150, 0.5)])
    level = np.clip((level - level.min()) / np.ptp(level) * 12, 0, 11).astype(int)
    colour = rng.random((12, 3))[level] * (0.5 + 0.5 * solid_noise(rng, texels, [(30, 1), (120, 1)])[..., None])
    picture = io.BytesIO()
    Image.fromarray((255 * colour).astype(np.uint8)).save(picture, "JPEG", quality=92)
    parts = [positions.tobytes(), texture_at.tobytes(), triangles.tobytes(), picture.getvalue()]
    starts = np.cumsum([0] + [len(part) + -len(part) % 4 for part in parts])
    blob = b"".join(part + b"\0" * (-len(part) % 4) for part in parts)
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": len(positions), "type": "VEC3", "min": positions.min(0).tolist(),
         "max": positions.max(0).tolist()},
        {"bufferView": 1, "componentType": 5126, "count": len(texture_at), "type": "VEC2"},
        {"bufferView": 2, "componentType": 5125, "count": len(triangles), "type": "SCALAR"},
    ]
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 1}}
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "materials": [material], "textures": [{"source": 0}], "images": [{"bufferView": 3, "mimeType": "image/jpeg"}], "accessors": accessors,
        "bufferViews": [{"buffer": 0, "byteOffset": int(start), "byteLength": len(part)} for start, part in zip(starts, parts)],
        "buffers": [{"byteLength": len(blob), "uri": "data:application/octet-stream;base64," + base64.b64encode(blob).decode()}],
    }


def cameras(poses, width, height, fov):
    focal = width / 2 / np.tan(np.radians(fov) / 2)
    frames = [{"file_path": f"images/k{i:03d}.png", "transform_matrix": pose.tolist()} for i, pose in enumerate(poses)]
    lens = {"w": width, "h": height, "fl_x": focal, "fl_y": focal, "cx": width / 2, "cy": height / 2}
    return {"camera_model": "PINHOLE", **lens, "frames": frames}


def make(folder):
    os.makedirs(folder, exist_ok=True)
    # A ring around the rock, a little from above; and a walk along one side of the room that looks across.
    ring = [looking(np.array([2.6 * np.sin(a), 0.7, 2.6 * np.cos(a)]), -np.degrees(a), -15, 0) for a in np.arange(24) * 2 * np.pi / 24]
    walk = [looking(np.array([5.0, 1.5, z]), -90 + turn, -8, 0) for z, turn in zip(np.linspace(1.8, 6.8, 20), np.linspace(25, -25, 20))]
    for name, value in [("room.gltf", room()), ("rock.gltf", rock(3)), ("ring.json", cameras(ring, 800, 600, 50)),
                        ("walk.json", cameras(walk, 640, 480, 65))]:
        with open(f"{folder}/{name}", "w") as file:
            json.dump(value, file)


def poses(folder):
    """What transforms.json says of a capture's lens, and the pose of each photo by its name without extension."""
    record = json.load(open(f"{folder}/transforms.json"))
    stem = lambda path: os.path.splitext(os.path.basename(path))[0]
    lens = record if "fl_x" in record else record["frames"][0]
    return lens, {stem(frame["file_path"]): np.array(frame["transform_matrix"]) for frame in record["frames"]}


def register(folder):
    out = f"{folder}/colmap"
    shutil.rmtree(out, ignore_errors=True)
    os.makedirs(f"{out}/sparse")
    lens, _ = poses(folder)
    database, images, log = ["--database_path", f"{out}/database.db"], ["--image_path", f"{folder}/images"], f"{out}/colmap.log"
    known = ",".join(str(lens[key]) for key in ("fl_x", "fl_y", "cx", "cy"))
    single = ["--ImageReader.single_camera", "1", "--ImageReader.camera_model", "PINHOLE", "--ImageReader.camera_params", known]
    colmap(log, "feature_extractor", *database, *images, *single, "--SiftExtraction.use_gpu", "0")
    colmap(log, "exhaustive_matcher", *database, "--SiftMatching.use_gpu", "0")
    # It fails where no pair of photos will do to begin with.
    colmap(log, "mapper", *database, *images, "--output_path", f"{out}/sparse", "--Mapper.ba_refine_focal_length", "0", check=False)
    measure(folder)


def measure(folder):
    """Photos of the largest model that are in place: within a fiftieth of the cameras' mean distance from their centre, and 2 degrees."""
    _, truth = poses(folder)
    found = models(f"{folder}/colmap/sparse", f"{folder}/colmap/colmap.log")
    best = [(os.path.splitext(name)[0], *pose) for name, *pose in max(found.values(), key=len, default=[])]
    right = set()
    if len(best) > 3:
        true = np.array([truth[name][:3, 3] for name, _, _ in best])
        size = np.linalg.norm(true - true.mean(0), axis=1).mean()
        _, off, angle = aligned(best, truth.__getitem__, 0.02 * size)
        right = {name for (name, _, _), ok in zip(best, (off < 0.02 * size) & (angle < 2)) if ok}
    planned = [name for name in truth if not name.startswith("k")]
    print(
        f"{folder}: {len(found)} models; {len(best)} of {len(truth)} registered, {len(right)} in place; of {len(planned)} planned "
        f"{len(right.intersection(planned))} in place", flush=True
    )


def pairs(folder):
    _, truth = poses(folder)
    database = sqlite3.connect(f"{folder}/colmap/database.db")
    name = {image: os.path.splitext(file)[0] for image, file in database.execute("select image_id, name from images")}
    angles, matches = [], []
    for pair, rows in database.execute("select pair_id, rows from two_view_geometries"):
        a, b = [truth[name[image]][:3, 3] for image in divmod(pair, 2147483647)]
        angles.append(np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))))
        matches.append(rows)
    angles, matches = np.array(angles), np.array(matches)
    for low, high in [(0, 10), (10, 20), (20, 25), (25, 30), (30, 40), (40, 60)]:
        within = matches[(angles >= low) & (angles < high)]
        if len(within) > 0:
            print(f"{folder}: {low} to {high} degrees: {len(within)} pairs, median {np.median(within):.0f}, most {within.max()}")


if __name__ == "__main__":
    match sys.argv[1:]:
        case ["make", folder]:
            make(folder)
        case ["register", *folders] if folders:
            for folder in folders:
                register(folder)
        case ["pairs", *folders] if folders:
            for folder in folders:
                pairs(folder)
        case _:
            sys.exit(__doc__)
