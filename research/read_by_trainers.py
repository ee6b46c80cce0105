#!/usr/bin/env python3
"""Loads a folder with photos that camsplat wrote as trainers load it, and says how far their cameras are from camsplat's.

usage: python3 research/read_by_trainers.py CAPTURE [--gsplat CHECKOUT]

CAPTURE is the folder of `camsplat capture` or `camsplat select`. It is loaded by the two dataparsers of nerfstudio that read such folders,
nerfstudio-data (transforms.json and points.ply) and colmap (sparse/0), and by Parser and Dataset of gsplat's examples/simple_trainer.py
(sparse/0), which are in a checkout of gsplat and in no package. Every photo is opened. Loaders turn, move and scale the scene: that is
undone by the transforms that they return. Three things are compared with camsplat's own transforms.json and points.ply: centres of the
cameras, seed points, and projections. Points that a camera sees by transforms.json are projected with its lens, distortion included; rays
that nerfstudio casts through these pixels should meet them, and gsplat's undistorted photo should take its pixels for them from there.

What a loader prints is shown after `says`. A loader that is missing is passed over. The exit status is 1 where no loader is installed,
where one fails or asks a question, and where a deviation is beyond its bound, which is that of single precision.

Needs no GPU:
    pip install numpy scipy plyfile opencv-python-headless
    pip install nerfstudio "numpy<2"
    pip install torch pycolmap imageio pillow tqdm piexif       for gsplat; up to 1.5.3 with rmbrualla/pycolmap instead, and numpy<2
"""
import argparse
import contextlib
import importlib
import io
import json
import sys
import traceback
import warnings
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import cv2
import numpy as np
from plyfile import PlyData
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

# Bounds: pixels, and shares of the scene's size, the diagonal of cameras and seed points.
PIXELS, SHARE = 0.02, 1e-5
# Points that are projected by a camera at most.
MOST = 300


class Reference:
    """Cameras of transforms.json, by the names of their photos, and the points of points.ply."""

    def __init__(self, folder):
        file = json.loads((folder / "transforms.json").read_text())
        self.frames = {Path(frame["file_path"]).relative_to("images").as_posix(): file | frame for frame in file["frames"]}
        vertex = PlyData.read(folder / "points.ply")["vertex"]
        self.points = np.stack([np.asarray(vertex[axis], float) for axis in "xyz"], 1)
        self.size = np.linalg.norm(np.ptp(np.concatenate([self.points, [self.centre(name) for name in self.frames]]), axis=0))

    def centre(self, name):
        return np.array(self.frames[name]["transform_matrix"])[:3, 3]

    def size_of(self, name):
        return self.frames[name]["w"], self.frames[name]["h"]

    def seen(self, name):
        """Points inside the photo, hidden ones among them, and their pixels."""
        frame = self.frames[name]
        pose = np.array(frame["transform_matrix"]) @ np.diag([1.0, -1.0, -1.0, 1.0])
        local = (self.points - pose[:3, 3]) @ pose[:3, :3]
        k = np.array([[frame["fl_x"], 0, frame["cx"]], [0, frame["fl_y"], frame["cy"]], [0, 0, 1.0]])
        # Beyond the photo's edge the polynomials of lenses may turn back, so that the pinhole decides first.
        ahead = local[:, 2] > 0
        straight = local[ahead] / local[ahead, 2:] @ k.T
        near = ((straight[:, :2] > 0) & (straight[:, :2] < self.size_of(name))).all(1)
        some, local = self.points[ahead][near], local[ahead][near]
        if not len(some):
            return some, np.empty((0, 2))
        k1, k2, p1, p2, k3, k4 = (frame.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3", "k4"))
        if frame["camera_model"] == "OPENCV_FISHEYE":
            pixels, _ = cv2.fisheye.projectPoints(local[:, None], np.zeros(3), np.zeros(3), k, np.array([k1, k2, k3, k4]))
        else:
            pixels, _ = cv2.projectPoints(local, np.zeros(3), np.zeros(3), k, np.array([k1, k2, p1, p2, k3]))
        pixels = pixels.reshape(-1, 2)
        inside = ((pixels > 0) & (pixels < self.size_of(name))).all(1)
        chosen = np.flatnonzero(inside)[:: max(inside.sum() // MOST, 1)][:MOST]
        return some[chosen], pixels[chosen]


class Loaded:
    """What a loader made of the folder, in camsplat's frame: centres by name, seed points, sizes of photos; and distances in pixels."""

    def __init__(self):
        self.centres, self.seeds, self.sizes, self.pixels = {}, None, set(), []

    def add(self, name, size, camera_size, centre):
        assert size == camera_size, f"{name} has {size} pixels, its camera {camera_size}"
        self.sizes.add(size)
        self.centres[name] = centre

    def check(self, reference):
        """Prints the deviations and returns those that are beyond their bounds."""
        faults = []
        if set(self.centres) != set(reference.frames):
            faults.append(f"photos: {len(self.centres)} of {len(reference.frames)}")
        centres = max(np.linalg.norm(centre - reference.centre(name)) for name, centre in self.centres.items())
        if len(self.seeds) != len(reference.points):
            faults.append(f"seed points: {len(self.seeds)} of {len(reference.points)}")
        # Models have them in an order of their own.
        sets = self.seeds, reference.points
        seeds = max(cKDTree(a).query(b)[0].max() for a, b in (sets, sets[::-1]))
        sizes = " and ".join(f"{w} x {h}" for w, h in sorted(self.sizes))
        print(f"    {len(self.centres)} images, {sizes}, {len(self.seeds)} seed points")
        # What is not a number is beyond every bound.
        pixels = max(map(np.max, self.pixels), default=np.nan)
        share = f"{reference.size:.3g} is the scene's size"
        print(f"    off by at most: centres {centres:.2g}, seed points {seeds:.2g} ({share}); projections {pixels:.2g} px")
        bound = SHARE * reference.size
        values = {"centres": centres / bound, "seed points": seeds / bound, "projections": pixels / PIXELS}
        return faults + [f"{what}: {times:.3g} times the bound" for what, times in values.items() if not times <= 1]


def nerfstudio(folder, reference, module, config, **options):
    """The dataparser as `ns-train splatfacto` sets it up, both splits, and the photos as nerfstudio's dataset has them."""
    import torch
    from nerfstudio.data.datasets.base_dataset import InputDataset
    parser = getattr(importlib.import_module(f"nerfstudio.data.dataparsers.{module}"), config)
    parser = parser(data=folder, load_3D_points=True, **options).setup()
    loaded = Loaded()
    for split in ("train", "val"):
        outputs = parser.get_dataparser_outputs(split=split)
        turn, scale = outputs.dataparser_transform.double().numpy(), outputs.dataparser_scale
        dataset = InputDataset(outputs)
        for i, path in enumerate(outputs.image_filenames):
            name = path.relative_to(folder / "images").as_posix()
            (height, width, _), cameras = dataset[i]["image"].shape, outputs.cameras
            centre = (cameras.camera_to_worlds[i, :, 3].double().numpy() / scale - turn[:, 3]) @ turn[:, :3]
            loaded.add(name, (width, height), (cameras.width[i].item(), cameras.height[i].item()), centre)
            points, pixels = reference.seen(name)
            if not len(points):
                continue
            # Coordinates are row and column.
            rays = cameras.generate_rays(camera_indices=i, coords=torch.tensor(pixels[:, ::-1].copy(), dtype=torch.float32))
            origins, directions = rays.origins.double().numpy(), rays.directions.double().numpy()
            way = (points @ turn[:, :3].T + turn[:, 3]) * scale - origins
            aside = np.linalg.norm(np.cross(way, directions), axis=1) / np.linalg.norm(way, axis=1)
            loaded.pixels.append(np.where((way * directions).sum(1) > 0, aside * cameras.fx[i].item(), np.inf))
    loaded.seeds = (outputs.metadata["points3D_xyz"].double().numpy() / scale - turn[:, 3]) @ turn[:, :3]
    return loaded


def gsplat(folder, reference, checkout):
    """Parser and Dataset as simple_trainer.py sets them up with --data_factor 1, both splits."""
    sys.path.insert(0, str(checkout / "examples"))
    from datasets.colmap import Dataset, Parser
    parser = Parser(data_dir=str(folder), factor=1, normalize=True, test_every=8)
    scale = np.cbrt(np.linalg.det(parser.transform[:3, :3]))
    turn, shift = parser.transform[:3, :3] / scale, parser.transform[:3, 3]
    loaded = Loaded()
    for split in ("train", "val"):
        dataset = Dataset(parser, split=split)
        for i in range(len(dataset)):
            index, data = dataset.indices[i], dataset[i]
            name, camera = parser.image_names[index], parser.camera_ids[index]
            pose, k = data["camtoworld"].double().numpy(), data["K"].double().numpy()
            size = data["image"].shape[1], data["image"].shape[0]
            loaded.add(name, size, tuple(parser.imsize_dict[camera]), (parser.camtoworlds[index][:3, 3] - shift) @ turn / scale)
            points, pixels = reference.seen(name)
            local = ((points @ parser.transform[:3, :3].T + shift) - pose[:3, 3]) @ pose[:3, :3]
            seen = (local / local[:, 2:] @ k.T)[:, :2]
            if camera in parser.mapx_dict:
                # Maps that say where in the photo as stored each pixel of the undistorted and cropped one comes from.
                kept = ((seen >= 0) & (seen <= np.array(size) - 1)).all(1)
                local, pixels = local[kept], pixels[kept]
                at = (seen[kept] + parser.roi_undist_dict[camera][:2]).T[::-1]
                maps = parser.mapx_dict[camera], parser.mapy_dict[camera]
                seen = np.stack([map_coordinates(values, at, order=1) for values in maps], 1)
            if len(seen):
                loaded.pixels.append(np.where(local[:, 2] > 0, np.abs(seen - pixels).max(1), np.inf))
    loaded.seeds = (parser.points - shift) @ turn / scale
    return loaded


def tried(label, load, folder, reference):
    """Whether the loader took the folder as it is; None where the loader is missing."""
    heard = io.StringIO()
    try:
        with contextlib.redirect_stdout(heard), contextlib.redirect_stderr(heard):
            loaded = load(folder, reference)
        failure = None
    except ImportError as error:
        print(f"{label}: not installed ({error})")
        return None
    except (Exception, SystemExit) as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        failure = f"{type(error).__name__}: {error} ({place.filename}, line {place.lineno})"
    print(label)
    for line in heard.getvalue().replace("\r", "\n").splitlines():
        if line.strip() and "it/s]" not in line:
            print(f"    says: {line.strip()}")
    if failure:
        print(f"    FAILED: {failure}")
        return False
    faults = loaded.check(reference)
    for fault in faults:
        print(f"    DEVIATES: {fault}")
    return not faults


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("--gsplat", type=Path, metavar="CHECKOUT", help="folder of gsplat's sources, for its examples")
    arguments = parser.parse_args()
    folder = arguments.capture.resolve()
    for name in ("transforms.json", "points.ply"):
        if not (folder / name).is_file():
            sys.exit(f"{folder} has no {name}: it is not a folder of `camsplat capture` or `camsplat select`")
    reference = Reference(folder)
    # Whoever asks finds nobody there.
    sys.stdin = io.StringIO()
    # These are of packages about each other.
    warnings.simplefilter("ignore")
    try:
        release = f"nerfstudio {version('nerfstudio')}"
    except PackageNotFoundError:
        release = "nerfstudio"
    loaders = {
        f"{release}, nerfstudio-data": lambda *given: nerfstudio(*given, "nerfstudio_dataparser", "NerfstudioDataParserConfig"),
        f"{release}, colmap --colmap-path sparse/0 --downscale-factor 1": lambda *given: nerfstudio(
            *given, "colmap_dataparser", "ColmapDataParserConfig", colmap_path=Path("sparse/0"), downscale_factor=1),
    }
    if arguments.gsplat:
        loaders["gsplat, simple_trainer.py --data_factor 1"] = lambda *given: gsplat(*given, arguments.gsplat)
    results = [tried(label, load, folder, reference) for label, load in loaders.items()]
    if not arguments.gsplat:
        print("gsplat: not installed (--gsplat CHECKOUT)")
    if all(result is None for result in results):
        sys.exit("no loader is installed")
    sys.exit(any(result is False for result in results))


if __name__ == "__main__":
    main()
