"""Choices of photos, coarse surfaces, trained splats and their pictures."""
import csv
import json

import numpy as np
import open3d
from PIL import Image
from poses import read_pictures, read_poses
from scipy.spatial import cKDTree
from table import PIXELS, SHARE, by, off, package, program, row
from views import apart, listed, nerfstudio, ply, stem


def read(camsplat, capture, cameras, points, label, work):
    """Runs `select`, `proxy`, `train` and `render` on a capture and reads what they write; `cameras` and `points` are the capture's."""
    selected, proxy = work / f"select{label}", work / f"proxy{label}.ply"
    model, pictures = work / f"train{label}", work / f"render{label}"
    size = np.linalg.norm(np.ptp(points, axis=0))
    program(camsplat, "select", capture, "--count", 4, "--suggest", 1, "--out", selected)
    names = {stem(line["name"]) for line in csv.DictReader(open(selected / "chosen.csv"))}
    chosen = read_poses(selected, selected.name, {name: cameras[name] for name in names})
    worst = cKDTree(points).query(chosen)[0].max() / size
    row(f"{selected.name}/sparse/0", by("pycolmap"), "points from the capture's", worst, "of their size", SHARE)
    suggested, again = nerfstudio(selected / "suggested.json"), listed(selected / "suggested.csv")
    worst = apart(suggested, lambda name, some: again[name].project(some), points)
    row(f"{selected.name}/suggested.json, .csv", by("scipy"), "projections", worst, "px", PIXELS)
    (_, unseen), cloud = ply(selected / "unseen.ply"), open3d.io.read_point_cloud(str(selected / "unseen.ply"))
    apart_by = off(cloud.points, unseen) / size
    row(f"{selected.name}/unseen.ply", by("open3d", "plyfile"), "from each other", apart_by, "of the size", SHARE, f"{len(unseen)} points")
    # Photos as small as these are too few for stereo in most rooms.
    if program(camsplat, "proxy", capture, "--out", proxy, required=False):
        read_proxy(proxy, size)
    program(camsplat, "train", capture, "--iterations", 60, "--max-splats", 400, "--test-every", 4, "--out", model)
    read_splats(model / "point_cloud.ply", f"{model.name}/point_cloud.ply", points)
    errors = [np.mean((shown(path) - shown(model / "reference" / path.name)) ** 2) for path in (model / "test").glob("*.png")]
    said = json.loads((model / "train.json").read_text())["evaluations"][-1]["quality"]["psnr"]
    row(f"{model.name}/test, reference", by("pillow"), "PSNR from train.json", abs(np.mean(-10 * np.log10(errors)) - said), "dB", 0.01)
    for kind in ("png", "exr"):
        asked = [model / "point_cloud.ply", capture / "transforms.json", "--format", kind, "--out", pictures / kind]
        program(camsplat, "render", *asked)
    read_pictures(pictures / "png", pictures / "exr", pictures.name)


def read_proxy(path, size):
    cloud, (_, positions) = open3d.io.read_point_cloud(str(path)), ply(path)
    row(path.name, by("open3d", "plyfile"), "from each other", off(cloud.points, positions) / size, "of their size", SHARE, f"{len(positions)} points")
    lengths = np.linalg.norm(np.asarray(cloud.normals), axis=1)
    row(path.name, by("open3d"), "lengths of normals from 1", np.abs(lengths - 1).max(), "", 1e-5)


def shown(path):
    return np.asarray(Image.open(path).convert("RGB"), float) / 255


def read_splats(path, label, points):
    """Trained splats, and what splat-transform makes of them in its own formats."""
    vertex, positions = ply(path)
    header = path.read_bytes().split(b"end_header", 1)[0].decode()
    said = [line.split()[3:] for line in header.splitlines() if line.startswith("comment camsplat offset")]
    offset = np.array(said[0] if said else [0, 0, 0], float)
    low, high = points.min(0), points.max(0)
    outside = np.maximum(low - positions - offset, positions + offset - high).max() / np.linalg.norm(high - low)
    remark = f"{len(positions)} splats" + (f", less {', '.join(said[0])}" if said else "")
    row(label, by("plyfile"), "outside of the points", max(outside, 0), "of their size", 0.5, remark)
    folder, version = package("@playcanvas/splat-transform")
    extent = np.ptp(positions, axis=0).max()
    # .compressed.ply has 10 bits of the extent of 256 splats and more; .spz has 12 bits after the point.
    for through, bound in [(None, 0), (".compressed.ply", extent / 2 ** 10), (".spz", 1 / 2 ** 12)]:
        source = path if through is None else path.with_name(f"through{through}")
        if through:
            program("node", folder / "bin/cli.mjs", "-q", "-w", path, source)
        program("node", folder / "bin/cli.mjs", "-q", "-w", source, path.with_name("read.csv"))
        lines = list(csv.DictReader(open(path.with_name("read.csv"))))
        read = np.array([[float(line[axis]) for axis in "xyz"] for line in lines])
        # Packed files have an order of their own.
        worst = cKDTree(read).query(positions)[0].max() if len(read) == len(positions) else np.nan
        reader = f"splat-transform {version}" + f", through {through}" * bool(through)
        row(label, reader, "positions", worst, "units", bound, f"{len(read)} splats")
        if through is None:
            names = [name for name in lines[0] if name not in "xyz"]
            worst = max(np.abs(np.asarray(vertex[name], float) - [float(line[name]) for line in lines]).max() for name in names)
            row(label, reader, "all other properties", worst, "", 1e-6, f"{len(names)} a splat")
