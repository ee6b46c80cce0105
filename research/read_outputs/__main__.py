r"""Reads the files that camsplat writes with other programs, and says how far what these see is from camsplat's own cameras.

usage: python3 research/read_outputs cloud FILE       a house in UTM coordinates as a cloud, PLY in double precision
       python3 research/read_outputs run CAMSPLAT SURFACE DIR --geo PLACE --takeoff METRES [--env HDR] \
           [options of `camsplat plan`]

`run` plans for the surface and exports the plan. Of a glTF surface it also takes small photos, selects among them, makes a proxy, trains
splats and renders them, and does these four again with the capture moved far away from the origin. Every file is read, and points of the
surface are projected by the cameras as read and by those of plan.json. DIR/table.md has the largest deviation of each; the exit status is 1
where a file is refused or a deviation is beyond its bound. docs/results/others.md has what came out.

Needs Python 3.11 and Node.js:
    pip install numpy scipy pillow pycolmap open3d trimesh plyfile pygltflib usd-core bpy==4.2.0 pyyaml rosbags pymavlink mavsdk \
        fastkml lxml geojson shapely pyproj OpenEXR
    npm install @playcanvas/splat-transform gltf-validator        and NODE_MODULES=their folder, node_modules
"""
import argparse
import json
import shutil
import sys
from pathlib import Path

import missions
import numpy as np
import pycolmap
import renderers
import splats
from plyfile import PlyData, PlyElement
from poses import read_capture, read_plan
from table import TABLE, program
from views import View, ply

FAR = np.array([500_000.0, 5_000_000.0, 100.0])
COLOURS = ("red", "green", "blue")


def write_cloud(path, positions, colours):
    vertex = np.empty(len(positions), [(axis, "f8") for axis in "xyz"] + [(name, "u1") for name in COLOURS])
    for i in range(3):
        vertex["xyz"[i]], vertex[COLOURS[i]] = positions[:, i], colours[:, i]
    PlyData([PlyElement.describe(vertex, "vertex")]).write(path)


def cloud(path):
    """Walls and roof of a house of 12 by 8 by 6 metres."""
    rng, count = np.random.default_rng(0), 20_000
    side, at = rng.integers(0, 5, count), rng.uniform(0, 1, (count, 3)) * [12, 8, 6]
    for k, (axis, value) in enumerate([(0, 0), (0, 12), (1, 0), (1, 8), (2, 6)]):
        at[side == k, axis] = value
    write_cloud(path, at + FAR + [123.25, 456.5, 0], (20 * at).astype(np.uint8))


def far(capture, out):
    """The same capture far away from the origin, its model written by COLMAP's own library."""
    shutil.copytree(capture, out, ignore=shutil.ignore_patterns("transforms.json", "points.ply", "cameras.csv"))
    model = pycolmap.Reconstruction(capture / "sparse/0")
    model.transform(pycolmap.Sim3d(1.0, pycolmap.Rotation3d(), FAR))
    model.write_binary(out / "sparse/0")
    file = json.loads((capture / "transforms.json").read_text())
    for frame in file["frames"]:
        for i in range(3):
            frame["transform_matrix"][i][3] += FAR[i]
    (out / "transforms.json").write_text(json.dumps(file))
    vertex, positions = ply(capture / "points.ply")
    write_cloud(out / "points.ply", positions + FAR, np.stack([vertex[name] for name in COLOURS], 1))


def run(camsplat, surface, work, place, takeoff, environment, options):
    work.mkdir(parents=True)
    program(camsplat, "plan", surface, "--views", 12, "--iterations", 20, "--size", "320x240", "--out", work / "plan", *options)
    cameras, points = read_plan(work / "plan")
    up = np.array(json.loads((work / "plan/plan.json").read_text())["region"]["up"])
    program(camsplat, "export", work / "plan", "--geo", place, "--takeoff", takeoff, "--gimbal", "-90,90", "--out", work / "export")
    renderers.read(work / "export", cameras, points, up)
    missions.read(work / "export", cameras, missions.Earth(place, up), takeoff)
    if surface.suffix in (".glb", ".gltf"):
        capture = work / "capture"
        shown = ["--size", "64x48", "--spp", 4, "--depth", "--normals", "--exr", *(["--env", environment] if environment else [])]
        program(camsplat, "capture", surface, work / "plan", *shown, "--out", capture)
        cameras = {name: View(view.centre, view.rotation, np.array(view.lens) / 5) for name, view in cameras.items()}
        points = read_capture(capture, cameras)
        splats.read(camsplat, capture, cameras, points, "", work)
        far(capture, work / "capture-far")
        moved = {name: View(view.centre + FAR, view.rotation, view.lens) for name, view in cameras.items()}
        splats.read(camsplat, work / "capture-far", moved, points + FAR, "-far", work)
    (work / "table.md").write_text(TABLE.text())
    sys.exit(TABLE.verdict())


match sys.argv[1:]:
    case ["cloud", path]:
        cloud(path)
    case ["run", camsplat, surface, work, *rest]:
        parser = argparse.ArgumentParser()
        parser.add_argument("--geo", required=True)
        parser.add_argument("--takeoff", type=float, required=True)
        parser.add_argument("--env")
        known, options = parser.parse_known_args(rest)
        run(camsplat, Path(surface), Path(work), known.geo, known.takeoff, known.env, options)
    case _:
        sys.exit(__doc__)
