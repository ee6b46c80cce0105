"""What trainers read: COLMAP models, transforms.json, clouds and pictures."""
import numpy as np
import open3d
import OpenEXR
import pycolmap
import trimesh
from PIL import Image
from table import PIXELS, SHARE, by, off, row
from views import apart, listed, nerfstudio, planned, ply, stem


def read_poses(folder, label, cameras):
    """sparse/0, transforms.json, points.ply and, where there is one, cameras.csv. Returns the points of the model."""
    model = pycolmap.Reconstruction(folder / "sparse/0")
    images = {stem(image.name): image for image in model.images.values()}
    keys = sorted(model.points3D)
    points = np.array([model.points3D[key].xyz for key in keys])
    size = np.linalg.norm(np.ptp(points, axis=0))

    def colmap(name, some):
        pose = images[name].cam_from_world()
        return np.array(images[name].camera.img_from_cam(some @ pose.rotation.matrix().T + pose.translation))
    file = f"{label}/sparse/0"
    row(file, by("pycolmap"), "projections", apart(cameras, colmap, points), "px", PIXELS, f"{len(images)} images")
    observed = [
        np.abs(model.images[element.image_id].points2D[element.point2D_idx].xy - model.images[element.image_id].project_point(point.xyz)).max()
        for point in model.points3D.values() for element in point.track.elements
    ]
    row(file, by("pycolmap"), "observations", max(observed), "px", PIXELS, f"{len(observed)} observations of {len(keys)} points")
    views = nerfstudio(folder / "transforms.json")
    worst = apart(cameras, lambda name, some: views[name].project(some), points)
    row(f"{label}/transforms.json", "json, nerfstudio's axes", "projections", worst, "px", PIXELS)
    vertex, positions = ply(folder / "points.ply")
    precision = "double" if vertex["x"].dtype == np.float64 else "float"
    cloud = open3d.io.read_point_cloud(str(folder / "points.ply"))
    for reader, read in [("plyfile", positions), ("open3d", cloud.points), ("trimesh", trimesh.load(folder / "points.ply").vertices)]:
        row(f"{label}/points.ply", by(reader), "from sparse/0", off(read, points) / size, "of their size", SHARE, f"{len(read)} points, {precision}")
    if (folder / "cameras.csv").exists():
        read = listed(folder / "cameras.csv")
        row(f"{label}/cameras.csv", by("scipy"), "projections", apart(cameras, lambda name, some: read[name].project(some), points), "px", PIXELS)
    return points


def read_plan(folder):
    """The folder of `plan`. Returns the cameras of plan.json and the points."""
    cameras = planned(folder / "plan.json")
    points = read_poses(folder, "plan", cameras)
    size, views = np.linalg.norm(np.ptp(points, axis=0)), cameras.values()
    meshes = {"trimesh": trimesh.load(folder / "frusta.ply", process=False), "open3d": open3d.io.read_triangle_mesh(str(folder / "frusta.ply"))}
    for reader, mesh in meshes.items():
        # Six vertices a camera: its centre, the corners of its image, and the mark above it.
        pyramids = np.asarray(mesh.vertices).reshape(-1, 6, 3)
        row("plan/frusta.ply", by(reader), "apexes", off(pyramids[:, 0], [view.centre for view in views]) / size, "of the scene's size", SHARE)
        corners = [view.project(pyramid[1:5]) - np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * view.lens[4:] for view, pyramid in zip(views, pyramids)]
        row("plan/frusta.ply", by(reader), "corners of the images", np.abs(corners).max(), "px", PIXELS)
    vertex, positions = ply(folder / "coverage.ply")
    read = open3d.io.read_point_cloud(str(folder / "coverage.ply")).points
    remark = f"{len(read)} points, gaps from {vertex['value'].min():.0f} to {vertex['value'].max():.0f} degrees"
    row("plan/coverage.ply", by("open3d", "plyfile"), "from each other", off(read, positions) / size, "of the scene's size", SHARE, remark)
    return cameras, points


def read_capture(folder, cameras):
    """The folder of `capture`. Returns the points."""
    points = read_poses(folder, "capture", cameras)
    read_pictures(folder / "images", folder / "linear", "capture/images, linear")
    lengths, depths = [], []
    for name, view in cameras.items():
        (depth,) = exr(folder / f"depth/{name}.exr").values()
        normals = np.stack(list(exr(folder / f"normals/{name}.exr").values()))
        lengths.append(np.abs(np.linalg.norm(normals, axis=0)[depth > 0] - 1).max())
        seen = view.seen(points)
        x, y = np.minimum(view.project(seen).astype(int), np.array(depth.shape[::-1]) - 1).T
        ratio = depth[y, x] / view.depths(seen)
        # Where a point is hidden, its pixel shows something much nearer.
        depths.append(np.median(np.abs(ratio[ratio > 0.95] - 1)))
    row("capture/depth", by("OpenEXR"), "from the points", max(depths), "of the depth", 0.02, "median of a picture of 64 x 48 pixels")
    row("capture/normals", by("OpenEXR"), "lengths from 1", max(lengths), "", 1e-5)
    return points


def exr(path):
    """Channels of an OpenEXR file by name."""
    return {name: channel.pixels for name, channel in OpenEXR.File(str(path), separate_channels=True).channels().items()}


def read_pictures(png, linear, label):
    """Pictures in 8-bit sRGB against the same in linear light, where they are opaque."""
    worst, files = 0.0, sorted(png.glob("*.png"))
    for path in files:
        picture, channels = np.asarray(Image.open(path).convert("RGBA"), float), exr(linear / f"{path.stem}.exr")
        light = np.clip(np.stack([channels[channel] for channel in "RGB"], 2), 0, 1)
        curve = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
        worst = max(worst, np.abs(picture[..., :3] - 255 * curve)[picture[..., 3] == 255].max(initial=0))
    row(label, by("pillow", "OpenEXR"), "from each other", worst, "of 255", 0.51, f"{len(files)} pictures")
