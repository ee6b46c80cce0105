"""What the scripts share that compare COLMAP's poses with the true ones: running it, reading its models, aligning them."""
import os
import subprocess

import numpy as np


def colmap(log, *arguments, check=True):
    """Runs colmap without a display; what it prints goes to the end of a file."""
    environment = dict(os.environ, QT_QPA_PLATFORM="offscreen")
    with open(log, "a") as file:
        subprocess.run(["colmap", *arguments], check=check, env=environment, stdout=file, stderr=file)


def models(sparse, log):
    """The models of COLMAP's output folder, by name: a list of name of the photo, centre and world-from-camera rotation each."""
    found = {}
    for model in sorted(os.listdir(sparse)):
        path = f"{sparse}/{model}"
        colmap(log, "model_converter", "--input_path", path, "--output_path", path, "--output_type", "TXT")
        lines = [line.split() for line in open(f"{path}/images.txt") if not line.startswith("#")][::2]
        found[model] = [(line[9], *world_from_camera(*map(float, line[1:8]))) for line in lines]
    return found


def world_from_camera(w, x, y, z, *shift):
    """Centre and rotation of COLMAP's camera-from-world quaternion and translation."""
    world = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]).T
    return -world @ np.array(shift), world


def similarity(a, b):
    """Scale, rotation and shift that take points a to points b (Umeyama 1991)."""
    ma, mb = a.mean(0), b.mean(0)
    u, s, v = np.linalg.svd((b - mb).T @ (a - ma) / len(a))
    sign = np.diag([1, 1, np.sign(np.linalg.det(u @ v))])
    rotation = u @ sign @ v
    scale = np.trace(np.diag(s) @ sign) / ((a - ma) ** 2).sum() * len(a)
    return scale, rotation, mb - scale * rotation @ ma


def aligned(model, truth, slack):
    """The similarity from the true poses (OpenGL axes, by name of the photo) to a model, and how far off its photos are: distances in
    true units, and degrees. Photos farther off than `slack`, and than three times the median, do not count for the alignment."""
    true = np.array([truth(name)[:3, 3] for name, _, _ in model])
    found = np.array([centre for _, centre, _ in model])
    kept = np.ones(len(found), bool)
    for _ in range(10):
        scale, rotation, shift = similarity(true[kept], found[kept])
        off = np.linalg.norm(scale * true @ rotation.T + shift - found, axis=1) / scale
        kept = off <= max(3 * np.median(off), slack)
    turned = [(world, truth(name)[:3, :3] @ np.diag([1, -1, -1])) for name, _, world in model]
    cosine = [(np.trace((rotation @ b).T @ a) - 1) / 2 for a, b in turned]
    return (scale, rotation, shift), off, np.degrees(np.arccos(np.clip(cosine, -1, 1)))
