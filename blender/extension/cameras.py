"""Planned cameras as objects of the scene, and the scene's cameras as arrays."""

import bpy
import numpy as np
from mathutils import Matrix

import camsplat

from .lens import read_lens

COLLECTION = "camsplat"
"""Name of the collection of planned cameras."""


PLANNED = "camsplat"
"""Property of the cameras that were planned."""


def check_markers(scene: bpy.types.Scene, views: int) -> None:
    """Refuses markers that bind other cameras to the frames that planned ones get."""
    ours = set() if scene.camsplat.cameras is None else set(scene.camsplat.cameras.objects)
    for marker in scene.timeline_markers:
        if marker.camera is not None and marker.camera not in ours and 1 <= marker.frame <= views:
            raise camsplat.Error(
                f"timeline marker {marker.name}: it binds camera {marker.camera.name} to frame {marker.frame}, which a planned camera "
                "needs; unbind it, or move it past the views"
            )


def make_cameras(scene: bpy.types.Scene, planned: camsplat.Cameras, source: bpy.types.Camera | None, reach: float) -> bpy.types.Collection:
    """Makes camera objects that share a lens, one bound to each of the frames 1 to N, in place of those that were made before.

    `reach` is the distance from a camera to the farthest point that it should show; clipping is set so that it does.
    """
    data = bpy.data.cameras.new(COLLECTION) if source is None else source.copy()
    remove_cameras(scene)
    data.name = COLLECTION
    data.dof.use_dof = False
    data.clip_start, data.clip_end = min(data.clip_start, reach / 1000), max(data.clip_end, 2 * reach)
    collection = bpy.data.collections.new(COLLECTION)
    scene.collection.children.link(collection)
    for frame, (name, pose) in enumerate(zip(planned.names, planned.poses_opengl), start=1):
        camera = bpy.data.objects.new(name, data)
        collection.objects.link(camera)
        camera[PLANNED] = True
        location, rotation, _ = Matrix(pose).decompose()
        camera.rotation_mode = "QUATERNION"
        camera.location, camera.rotation_quaternion = location, rotation
        scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    scene.frame_start, scene.frame_end, scene.frame_step = 1, len(planned), 1
    scene.camera = collection.objects[0]
    scene.camsplat.cameras = collection
    return collection


def remove_cameras(scene: bpy.types.Scene) -> None:
    """Removes the cameras that were planned before, with their markers, and their collection where it holds nothing else. Cameras that
    somebody else made stay."""
    collection = scene.camsplat.cameras
    if collection is None:
        return
    cameras = [object for object in collection.objects if object.type == "CAMERA" and object.get(PLANNED)]
    if not cameras:
        return
    for marker in list(scene.timeline_markers):
        if marker.camera in cameras:
            scene.timeline_markers.remove(marker)
    lenses = {camera.data for camera in cameras}
    for camera in cameras:
        bpy.data.objects.remove(camera)
    for lens in lenses:
        if lens.users == 0:
            bpy.data.cameras.remove(lens)
    if not collection.all_objects and not collection.children:
        bpy.data.collections.remove(collection)


def planned_cameras(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The camera objects of the scene's camsplat collection, by name."""
    collection = scene.camsplat.cameras
    cameras = [] if collection is None else [object for object in collection.all_objects if object.type == "CAMERA"]
    if not cameras:
        raise camsplat.Error("the scene has no planned cameras; press Plan cameras, or choose a collection of cameras")
    return sorted(cameras, key=lambda camera: camera.name)


def read_cameras(context: bpy.types.Context) -> camsplat.Cameras:
    """The cameras as they are in the scene now, with what moves them, named as their objects."""
    objects = planned_cameras(context.scene)
    lenses = [read_lens(object.data, context.scene.render) for object in objects]
    poses = np.array([object.matrix_world for object in objects], dtype=np.float64)
    # A camera's scale changes nothing that it sees.
    poses[:, :3, :3] /= np.linalg.norm(poses[:, :3, :3], axis=1, keepdims=True)
    for object, rotation in zip(objects, poses[:, :3, :3]):
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-4 or np.linalg.det(rotation) < 0:
            raise camsplat.Error(f"camera {object.name}: a parent mirrors or shears it, and no pose does; clear the parent's scale")
    return camsplat.Cameras(
        poses,
        size=[(lens.width, lens.height) for lens in lenses],
        K=[lens.K for lens in lenses],
        names=[object.name for object in objects],
        convention="opengl",
    )
