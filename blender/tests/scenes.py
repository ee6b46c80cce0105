"""Objects for the tests' scenes, and what is read from them."""

import bpy
import numpy as np


def add_sphere(name: str, radius: float = 1.0, location: tuple[float, float, float] = (0, 0, 0)) -> bpy.types.Object:
    """A selected sphere."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8, radius=radius, location=location)
    sphere = bpy.context.object
    sphere.name = name
    return sphere


def add_light(sphere: bpy.types.Object) -> None:
    """Makes an object shine."""
    material = bpy.data.materials.new("light")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    emission, output = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeOutputMaterial")
    links.new(emission.outputs[0], output.inputs[0])
    sphere.data.materials.append(material)


def world_mesh(*objects: bpy.types.Object) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of mesh objects with their modifiers, in world space."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    vertices, faces = [], []
    for object in objects:
        mesh = bpy.data.meshes.new_from_object(object.evaluated_get(depsgraph))
        mesh.calc_loop_triangles()
        matrix = np.array(object.matrix_world, dtype=np.float64)
        local = np.array([vertex.co for vertex in mesh.vertices], dtype=np.float64)
        triangles = np.array([triangle.vertices for triangle in mesh.loop_triangles])
        faces.append(triangles + sum(len(part) for part in vertices))
        vertices.append(local @ matrix[:3, :3].T + matrix[:3, 3])
        bpy.data.meshes.remove(mesh)
    return np.concatenate(vertices), np.concatenate(faces)


def select(*objects: bpy.types.Object) -> None:
    """Selects these objects only."""
    bpy.ops.object.select_all(action="DESELECT")
    for object in objects:
        object.select_set(True)


def planned_poses(scene: bpy.types.Scene) -> np.ndarray:
    """World matrices of the planned cameras, by name."""
    bpy.context.view_layer.update()
    cameras = sorted(scene.camsplat.cameras.objects, key=lambda camera: camera.name)
    return np.array([camera.matrix_world for camera in cameras], dtype=np.float64)
