"""Meshes, planes and boxes of the scene in world space, as camsplat takes them."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np
import numpy.typing as npt

import camsplat

MESH_TYPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
"""Types of objects that Blender evaluates to a mesh."""


MOST_AROUND = 20_000_000
"""Triangles of what is not selected, at most: more would take gigabytes."""


class Surface(NamedTuple):
    """A triangle mesh in world space: vertices, (V, 3) float64, and faces, (F, 3), counter-clockwise from outside."""

    vertices: npt.NDArray[np.float64]
    faces: npt.NDArray[np.int64]


def planned_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """The objects that the settings choose to plan for."""
    settings = context.scene.camsplat
    if settings.source == "SELECTED":
        if not context.selected_objects:
            raise camsplat.Error("nothing is selected; select the objects to plan for")
        return list(context.selected_objects)
    if settings.collection is None:
        raise camsplat.Error("no collection is chosen; choose one under Plan for")
    return list(settings.collection.all_objects)


def read_surface(depsgraph: bpy.types.Depsgraph, objects: Iterable[bpy.types.Object]) -> Surface:
    """The evaluated meshes of objects and of all that they instance, joined."""
    chosen = list(objects)
    originals = {object.original for object in chosen}
    surface = join(*_meshes(depsgraph, lambda owner, _: owner in originals))
    if len(surface.faces) == 0:
        names = ", ".join(object.name for object in chosen[:3]) + (", ..." if len(chosen) > 3 else "")
        raise camsplat.Error(f"{names or 'the collection'}: there is no visible mesh with faces; choose objects that the viewport shows")
    return surface


def read_surroundings(depsgraph: bpy.types.Depsgraph, objects: Iterable[bpy.types.Object], aside: Iterable[bpy.types.Object]) -> Surface:
    """The evaluated meshes of all other objects that the viewport and renders show, but for those `aside`, joined; may be empty."""
    left_out = {object.original for object in (*objects, *aside)}
    rendered = set(_rendered(depsgraph.scene.original.collection))

    def is_around(owner: bpy.types.Object, object: bpy.types.Object) -> bool:
        return owner in rendered and owner not in left_out and not owner.hide_render and not object.hide_render

    parts, faces = [], 0
    for part in _meshes(depsgraph, is_around):
        parts.append(part)
        faces += len(part.faces)
        if faces > MOST_AROUND:
            raise camsplat.Error(
                f"what is not selected has more than {MOST_AROUND:,} triangles, instances counted; hide what is far away or small "
                "in the viewport or in renders"
            )
    return join(*parts)


def read_volumes(depsgraph: bpy.types.Depsgraph, collection: bpy.types.Collection) -> dict[str, Surface]:
    """The meshes of a collection's objects, by name."""
    candidates = [object for object in collection.all_objects if object.type in MESH_TYPES or object.is_instancer]
    if not candidates:
        raise camsplat.Error(f"collection {collection.name}: it has no mesh to keep out of; add closed meshes, or choose none")
    return {object.name: read_surface(depsgraph, [object]) for object in candidates}


def read_walls(collection: bpy.types.Collection) -> list[tuple[float, ...]]:
    """For each object of a collection its origin and its local +Z, in world space."""
    if not collection.all_objects:
        raise camsplat.Error(f"collection {collection.name}: it has no objects to be walls; add planes or empties, or choose none")
    walls = []
    for object in collection.all_objects:
        matrix = np.array(object.matrix_world, dtype=np.float64)
        if abs(np.linalg.det(matrix[:3, :3])) < 1e-12 * np.abs(matrix[:3, :3]).max() ** 3 or not matrix[:3, :3].any():
            raise camsplat.Error(f"{object.name}: its scale is 0 along an axis, so that the wall has no normal; give it a scale")
        normal = np.linalg.inv(matrix[:3, :3]).T[:, 2]
        walls.append((*matrix[:3, 3].tolist(), *(normal / np.linalg.norm(normal)).tolist()))
    return walls


def read_box(object: bpy.types.Object) -> tuple[float, ...]:
    """The lowest and the highest corner of an object's bounding box in world space."""
    matrix = np.array(object.matrix_world, dtype=np.float64)
    corners = np.array(object.bound_box) @ matrix[:3, :3].T + matrix[:3, 3]
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not (high > low).all():
        raise camsplat.Error(f"{object.name}: its bounding box has no volume; choose a mesh with one, such as a cube")
    return (*low.tolist(), *high.tolist())


def sample_points(surface: Surface, count: int, seed: int) -> npt.NDArray[np.float64]:
    """Points spread evenly over the surface."""
    random = np.random.default_rng(seed)
    corners = surface.vertices[surface.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    of = corners[random.choice(len(corners), size=count, p=areas / areas.sum())]
    u, v = random.random((2, count, 1))
    is_beyond = u + v > 1
    u, v = np.where(is_beyond, 1 - u, u), np.where(is_beyond, 1 - v, v)
    points: npt.NDArray[np.float64] = of[:, 0] + u * (of[:, 1] - of[:, 0]) + v * (of[:, 2] - of[:, 0])
    return points


def write_obj(file: Path, surface: Surface) -> None:
    """Writes a mesh as OBJ, with all digits."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in surface.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (surface.faces + 1).tolist()]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _rendered(collection: bpy.types.Collection) -> Iterable[bpy.types.Object]:
    """Objects of a collection and of those in it, but for collections that are disabled in renders."""
    if not collection.hide_render:
        yield from collection.objects
        for child in collection.children:
            yield from _rendered(child)


def join(*parts: Surface) -> Surface:
    """Surfaces as one, in this order."""
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts)])
    vertices = [np.empty((0, 3)), *(part.vertices for part in parts)]
    faces = [np.empty((0, 3), dtype=np.int64), *(part.faces + offset for part, offset in zip(parts, offsets))]
    return Surface(np.concatenate(vertices), np.concatenate(faces))


def _meshes(depsgraph: bpy.types.Depsgraph, takes: Callable[[bpy.types.Object, bpy.types.Object], bool]) -> Iterable[Surface]:
    """The visible meshes that are taken, by the object that they belong to and the one whose mesh they are; one for each instance."""
    for instance in depsgraph.object_instances:
        owner = instance.parent if instance.is_instance else instance.object
        is_mesh = instance.show_self and instance.object.type in MESH_TYPES
        if is_mesh and takes(owner.original, instance.object.original):
            yield _world_mesh(instance.object, np.array(instance.matrix_world, dtype=np.float64))


def _world_mesh(object: bpy.types.Object, matrix: npt.NDArray[np.float64]) -> Surface:
    mesh = object.to_mesh()
    if mesh is None:
        return join()
    mesh.calc_loop_triangles()
    local = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", local)
    faces = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
    mesh.loop_triangles.foreach_get("vertices", faces)
    object.to_mesh_clear()
    turned = faces.reshape(-1, 3).astype(np.int64)
    if np.linalg.det(matrix[:3, :3]) < 0:  # mirrored
        turned = turned[:, ::-1]
    return Surface(local.reshape(-1, 3).astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3], turned)
