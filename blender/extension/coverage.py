"""How well the planned views cover the surface, as a colour attribute of meshes."""

from pathlib import Path

import bpy
import numpy as np
import numpy.typing as npt
from mathutils.kdtree import KDTree

ATTRIBUTE = "camsplat coverage"
"""Name of the colour attribute."""

_TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1"}


def read_coverage(file: Path) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float32]]:
    """Points, (P, 3), and their colours, (P, 4) sRGB from 0 to 1, of a plan's coverage.ply."""
    header, _, rows = file.read_bytes().partition(b"end_header\n")
    words = [line.split() for line in header.decode().splitlines()]
    table = np.frombuffer(rows, dtype=[(line[2], _TYPES[line[1]]) for line in words if line[0] == "property"])
    points = np.stack([table[axis] for axis in "xyz"], axis=1).astype(np.float64)
    colours = np.ones((len(table), 4), dtype=np.float32)
    for channel, name in enumerate(("red", "green", "blue")):
        colours[:, channel] = table[name] / np.float32(255)
    return points, colours


def paint(
    depsgraph: bpy.types.Depsgraph,
    objects: list[bpy.types.Object],
    points: npt.NDArray[np.float64],
    colours: npt.NDArray[np.float32],
) -> list[str]:
    """Gives every vertex of the objects' meshes the colour of the nearest point, and returns what was left out and why."""
    tree = KDTree(len(points))
    for i, point in enumerate(points):
        tree.insert(point, i)
    tree.balance()
    painted: set[bpy.types.Mesh] = set()
    notes = []
    for object in objects:
        reason = _obstacle(depsgraph, object, painted)
        if reason:
            notes.append(f"{object.name}: no coverage is shown, {reason}")
            continue
        evaluated = object.evaluated_get(depsgraph)
        matrix = evaluated.matrix_world
        nearest = [tree.find(matrix @ vertex.co)[1] for vertex in evaluated.data.vertices]
        attributes = object.data.color_attributes
        if ATTRIBUTE in attributes:
            attributes.remove(attributes[ATTRIBUTE])
        attribute = attributes.new(ATTRIBUTE, "BYTE_COLOR", "POINT")
        attribute.data.foreach_set("color_srgb", colours[nearest].ravel())
        painted.add(object.data)
    return notes


def _obstacle(depsgraph: bpy.types.Depsgraph, object: bpy.types.Object, painted: set[bpy.types.Mesh]) -> str | None:
    """Why the vertices of an object cannot be coloured."""
    if object.type != "MESH":
        return "as it is no mesh"
    if object.data.library is not None:
        return "as its mesh is linked from another file"
    if object.data in painted:
        return "as it shares its mesh with another object"
    if len(object.evaluated_get(depsgraph).data.vertices) != len(object.data.vertices):
        return "as its modifiers change the number of vertices"
    return None
