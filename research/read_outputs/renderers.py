"""Exports for renderers and robots."""
import json
import re
import subprocess
import sys

import numpy as np
import pygltflib
import trimesh
import yaml
from pxr import Gf, Usd, UsdGeom
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation
from table import MODULES, PIXELS, SINGLE, by, package, row
from views import FLIP, MOST, View, apart

# Blender's own projection of points by the cameras of a file. A root that carries an offset is put at the origin first, and the points
# with it: Blender computes in single precision.
BLENDER = """
import bpy, json, os, sys
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
file, request, answer = sys.argv[1:]
bpy.ops.wm.read_factory_settings(use_empty=True)
if file.endswith(".glb"):
    bpy.ops.import_scene.gltf(filepath=file)
else:
    exec(open(file).read())
scene, read = bpy.context.scene, {}
for root in [o for o in bpy.data.objects if o.children]:
    offset, root.location = root.location.copy(), (0, 0, 0)
for name, (w, h, points) in json.load(open(request)).items():
    camera = bpy.data.objects[name]
    scene.render.resolution_x, scene.render.resolution_y = w, h
    bpy.context.view_layer.update()
    moved = [[a - b for a, b in zip(p, offset)] if camera.parent else p for p in points]
    seen = [world_to_camera_view(scene, camera, Vector(p)) for p in moved]
    read[name] = [[[p.x * w, (1 - p.y) * h] for p in seen], camera.data.clip_start, camera.data.clip_end]
with open(answer, "w") as out:
    json.dump(read, out)
# Blender as a module may fault while Python takes it down.
os._exit(0)
"""
VALIDATE = """
require("gltf-validator").validateBytes(new Uint8Array(require("fs").readFileSync(process.argv[1])))
    .then(said => console.log(said.issues.numErrors + said.issues.numWarnings))
"""


def turn(up, axis):
    """The shortest rotation from up to an axis, by which exports turn the scene."""
    cross = np.cross(up, axis)
    sine = np.linalg.norm(cross)
    return np.eye(3) if sine < 1e-12 else Rotation.from_rotvec(cross / sine * np.arctan2(sine, np.dot(up, axis))).as_matrix()


def clipped(cameras, points, planes):
    """Points of all that the cameras see that lie before the near or behind the far plane."""
    depths = {name: view.depths(view.seen(points)) for name, view in cameras.items()}
    return sum(((depth < planes(name)[0]) | (depth > planes(name)[1])).sum() for name, depth in depths.items())


def read(folder, cameras, points, up):
    read_blender(folder, cameras, points, up)
    read_gltf(folder / "cameras.glb", cameras, points, turn(up, [0, 1, 0]))
    read_usd(folder / "cameras.usda", cameras, points, turn(up, [0, 0, 1]))
    for name, load in [("pose_array.yaml", yaml.safe_load), ("pose_array.json", json.load)]:
        read_ros(folder / name, load, cameras, points)


def read_blender(folder, cameras, points, up):
    upright = turn(up, [0, 0, 1])
    for file in (folder / "blender_cameras.py", folder / "cameras.glb"):
        said = re.search(r"less \((.*?)\)", file.read_text()) if file.suffix == ".py" else None
        offset = np.array(said[1].split(","), float) if said else np.zeros(3)
        request, answer = folder.parent / "blender-request.json", folder.parent / "blender-answer.json"
        asked = {name: [*map(int, view.lens[4:]), ((view.seen(points)[:MOST] - offset) @ upright.T).tolist()] for name, view in cameras.items()}
        request.write_text(json.dumps(asked))
        subprocess.run([sys.executable, "-c", BLENDER, file, request, answer], check=True, stdout=subprocess.DEVNULL)
        read = json.loads(answer.read_text())
        seen = apart(cameras, lambda name, some: np.array(read[name][0]), points)
        row(f"export/{file.name}", by("bpy"), "projections", seen, "px", SINGLE, "single precision")
        row(f"export/{file.name}", by("bpy"), "clipped", clipped(cameras, points, lambda name: read[name][1:]), "points", 0)


def read_gltf(file, cameras, points, upright):
    said = subprocess.run(["node", "-e", VALIDATE, file.resolve()], cwd=MODULES.parent, check=True, text=True, capture_output=True)
    row("export/cameras.glb", f"gltf-validator {package('gltf-validator')[1]}", "errors and warnings", int(said.stdout), "", 0)
    document, scene = pygltflib.GLTF2().load(file), trimesh.load(file, force="scene")
    root = next(node for node in document.nodes if node.children)
    nodes = {node.name: node for node in document.nodes if node.camera is not None}
    lenses = {name: document.cameras[node.camera].perspective for name, node in nodes.items()}
    above = Rotation.from_quat(root.rotation)

    def project(name, some, centre, rotation):
        lens, (w, h) = lenses[name], cameras[name].lens[4:]
        half = np.tan(lens.yfov / 2)
        return View(centre, rotation @ FLIP, [w / 2 / half / lens.aspectRatio, h / 2 / half, w / 2, h / 2, w, h]).project(some @ upright.T)

    def by_hand(name, some):
        centre = above.apply(nodes[name].translation) + (root.translation or np.zeros(3))
        return project(name, some, centre, (above * Rotation.from_quat(nodes[name].rotation)).as_matrix())

    def by_trimesh(name, some):
        pose = scene.graph.get(name)[0]
        return project(name, some, pose[:3, 3], pose[:3, :3])
    row("export/cameras.glb", by("pygltflib"), "projections", apart(cameras, by_hand, points), "px", PIXELS)
    # trimesh makes the first camera that of its scene and forgets what it hangs from ("TODO" in its reader).
    kept = {name: view for name, view in cameras.items() if scene.graph.transforms.parents.get(name) == root.name}
    remark = f"{len(kept)} of {len(cameras)} cameras: it detaches one from its root"
    row("export/cameras.glb", by("trimesh"), "projections", apart(kept, by_trimesh, points), "px", PIXELS, remark)
    beyond = clipped(cameras, points, lambda name: (lenses[name].znear, lenses[name].zfar or np.inf))
    row("export/cameras.glb", by("pygltflib"), "clipped", beyond, "points", 0)


def read_usd(file, cameras, points, upright):
    stage = Usd.Stage.Open(str(file))
    found = [UsdGeom.Camera(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Camera)]
    read = {camera.GetPrim().GetDisplayName(): camera.GetCamera(Usd.TimeCode.Default()) for camera in found}

    def project(name, some):
        frustum = read[name].frustum
        matrix = frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix()
        seen = np.array([matrix.Transform(Gf.Vec3d(*point)) for point in (some @ upright.T).tolist()])
        return (seen[:, :2] * [0.5, -0.5] + 0.5) * cameras[name].lens[4:]

    def planes(name):
        return read[name].clippingRange.min, read[name].clippingRange.max
    row("export/cameras.usda", by("usd-core"), "projections", apart(cameras, project, points), "px", PIXELS)
    row("export/cameras.usda", by("usd-core"), "clipped", clipped(cameras, points, planes), "points", 0)


def read_ros(file, load, cameras, points):
    """A PoseArray as a message of ROS 2, by way of its bytes."""
    store, kind = get_typestore(Stores.ROS2_HUMBLE), "geometry_msgs/msg/PoseArray"
    types = {name.rsplit("/", 1)[1]: made for name, made in store.types.items() if name.startswith(("geometry_msgs", "std_msgs", "builtin"))}
    said = load(open(file))
    header = types["Header"](stamp=types["Time"](**said["header"]["stamp"]), frame_id=said["header"]["frame_id"])
    poses = [types["Pose"](types["Point"](**pose["position"]), types["Quaternion"](**pose["orientation"])) for pose in said["poses"]]
    message = store.deserialize_cdr(store.serialize_cdr(types["PoseArray"](header=header, poses=poses), kind), kind)
    read = {}
    for (name, view), pose in zip(cameras.items(), message.poses, strict=True):
        p, q = pose.position, pose.orientation
        read[name] = View([p.x, p.y, p.z], Rotation.from_quat([q.x, q.y, q.z, q.w]).as_matrix(), view.lens)
    reader = by("rosbags", *["PyYAML"] * (file.suffix == ".yaml"))
    worst = apart(cameras, lambda name, some: read[name].project(some), points)
    row(f"export/{file.name}", reader, "projections", worst, "px", PIXELS, "a message of ROS 2, to bytes and back")
