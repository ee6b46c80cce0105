"""Pinhole cameras, as plan.json and transforms.json have them, and what they see."""
import csv
import json
from pathlib import Path

import numpy as np
from plyfile import PlyData
from scipy.spatial.transform import Rotation

# From the camera axes of OpenGL (Y up, Z back) to those of OpenCV (Y down, Z forward), and back.
FLIP = np.diag([1.0, -1.0, -1.0])
# Points that are projected by a camera at most.
MOST = 300


class View:
    """Centre, rotation (world from camera, OpenCV axes) and lens: fx, fy, cx, cy, width, height in pixels."""

    def __init__(self, centre, rotation, lens):
        self.centre, self.rotation, self.lens = np.array(centre, float), np.array(rotation, float), [float(v) for v in lens]

    def depths(self, points):
        return (points - self.centre) @ self.rotation[:, 2]

    def project(self, points):
        p = (points - self.centre) @ self.rotation
        return p[:, :2] / p[:, 2:] * self.lens[:2] + self.lens[2:4]

    def seen(self, points):
        """Points before the camera that it shows, hidden ones among them."""
        ahead = points[self.depths(points) > 0]
        pixels = self.project(ahead)
        return ahead[((pixels >= 0) & (pixels <= self.lens[4:])).all(1)]


def stem(name):
    return Path(name).stem


def ply(path):
    """Vertices of a PLY file, and their positions in double precision."""
    vertex = PlyData.read(path)["vertex"]
    return vertex, np.stack([np.asarray(vertex[axis], float) for axis in "xyz"], 1)


def planned(path):
    """Cameras of a plan.json by name."""
    views = {}
    for camera in json.loads(path.read_text())["cameras"]:
        pose, k = camera["pose"], camera["intrinsics"]
        lens = [*k["focal"], *k["principal"], k["width"], k["height"]]
        views[camera["name"]] = View(pose["position"], Rotation.from_quat(pose["rotation"]).as_matrix(), lens)
    return views


def nerfstudio(path):
    """Cameras of a transforms.json as nerfstudio describes it: camera-to-world in OpenGL axes."""
    file, views = json.loads(path.read_text()), {}
    for frame in file["frames"]:
        pose, has = np.array(frame["transform_matrix"]), file | frame
        lens = [has[key] for key in ("fl_x", "fl_y", "cx", "cy", "w", "h")]
        views[stem(frame["file_path"])] = View(pose[:3, 3], pose[:3, :3] @ FLIP, lens)
    return views


def listed(path):
    """Cameras of a cameras.csv."""
    views = {}
    for line in csv.DictReader(open(path)):
        centre, quaternion, forward, lens = (
            [float(line[key]) for key in keys.split()] for keys in ("x y z", "qx qy qz qw", "forward_x forward_y forward_z", "fx fy cx cy w h"))
        view = views[stem(line["name"])] = View(centre, Rotation.from_quat(quaternion).as_matrix(), lens)
        assert np.abs(view.rotation[:, 2] - forward).max() < 1e-9, f"{path} contradicts itself"
    return views


def apart(cameras, project, points):
    """Largest distance in pixels between where cameras and where `project(name, points)` show the points that these cameras see."""
    seen = {name: view.seen(points)[:MOST] for name, view in cameras.items()}
    return max((np.abs(project(name, some) - cameras[name].project(some)).max() for name, some in seen.items() if len(some)), default=np.nan)
