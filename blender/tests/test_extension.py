"""The extension in Blender without a window: cameras, limits, refusals, the zip."""

import json
import math
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

pytest.importorskip("bpy", reason="skipped: Blender's module bpy is not installed (pip install bpy)")
import bpy
from scenes import add_sphere, planned_poses, select, world_mesh

import camsplat


def contents() -> dict[str, int]:
    """How much there is of everything that planning makes."""
    scene = bpy.context.scene
    kinds = {"objects": bpy.data.objects, "cameras": bpy.data.cameras, "collections": bpy.data.collections, "meshes": bpy.data.meshes}
    return {**{name: len(kind) for name, kind in kinds.items()}, "markers": len(scene.timeline_markers)}


def test_cameras_stand_where_the_planner_puts_them(scene):
    """If this failed, cameras in Blender would be others than those that `camsplat.plan` gives for the same mesh."""
    parent = bpy.data.objects.new("parent", None)
    scene.collection.objects.link(parent)
    parent.location, parent.rotation_euler, parent.scale = (3, -1, 2), (0.3, 0.2, 1.0), (2.0, 2.0, 0.5)
    sphere = add_sphere("sphere")
    sphere.parent = parent
    sphere.location = (0.2, 0.1, 0.0)
    sphere.modifiers.new("smooth", "SUBSURF").levels = 1
    other = add_sphere("other", 0.5, (4, 1, 3))
    select(sphere, other)
    lens = bpy.data.cameras.new("lens")
    lens.sensor_fit, lens.sensor_height = "VERTICAL", 30
    scene.render.resolution_y, scene.render.pixel_aspect_y = 32, 1.5
    scene.camsplat.seed, scene.camsplat.lens = 3, lens
    bpy.ops.camsplat.plan()
    bpy.context.view_layer.update()
    vertices, faces = world_mesh(other, sphere)
    # Pixels are half as high again as they are wide: 32 of them are as high as 48 are wide.
    fov = math.degrees(2 * math.atan(32 / (50 / 30 * 48)))
    plan = camsplat.plan(vertices, faces, 6, seed=3, fov=fov, size=(64, 48))

    collection = scene.camsplat.cameras
    assert collection.name == "camsplat" and [camera.name for camera in collection.objects] == plan.cameras.names
    assert len({camera.data for camera in collection.objects}) == 1
    assert np.abs(planned_poses(scene) - plan.cameras.poses_opengl).max() < 1e-6
    assert (scene.frame_start, scene.frame_end, scene.frame_step) == (1, 6, 1)
    bound = {marker.frame: marker.camera.name for marker in scene.timeline_markers}
    assert bound == dict(zip(range(1, 7), plan.cameras.names))


def test_planning_again_replaces_the_cameras(scene):
    """If this failed, cameras and markers of older plans would pile up, and frames would show other cameras than the panel's."""
    sphere = add_sphere("sphere")
    bpy.ops.camsplat.plan()
    select(sphere)
    scene.camsplat.views = 5
    bpy.ops.camsplat.plan()
    assert contents() == {"objects": 6, "cameras": 1, "collections": 1, "meshes": 1, "markers": 5}
    assert scene.frame_end == 5 and scene.camera.name == "0000"


def test_instances_are_planned_for_where_they_are(scene, extension):
    """If this failed, instanced objects would be left out, misplaced or turned inside out."""
    sphere = add_sphere("sphere")
    collection = bpy.data.collections.new("parts")
    collection.objects.link(sphere)
    scene.collection.objects.unlink(sphere)
    instance = bpy.data.objects.new("instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", collection
    instance.location, instance.scale = (5, 0, 0), (-1, 1, 2)
    scene.collection.objects.link(instance)
    select(instance)
    vertices, faces = extension.surface.read_surface(bpy.context.evaluated_depsgraph_get(), [instance])
    assert np.allclose(vertices.min(axis=0), (4, -1, -2), atol=1e-5) and np.allclose(vertices.max(axis=0), (6, 1, 2), atol=1e-5)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    outward = np.einsum("fi,fi->f", np.cross(b - a, c - a), (a + b + c) / 3 - (5, 0, 0))
    assert (outward > 0).all()


def test_limits_are_kept(scene):
    """If this failed, cameras would stand behind walls, below the floor or in volumes to keep out of."""
    add_sphere("sphere", 0.5)
    scene.camsplat.views = 20
    bpy.ops.camsplat.plan()
    free = planned_poses(scene)[:, :3, 3]

    parent = bpy.data.objects.new("parent", None)
    parent.scale, parent.rotation_euler, parent.location = (1, 2, 1), (0, 0, math.pi / 2), (0, 1, 0)
    wall = bpy.data.objects.new("wall", None)
    wall.parent, wall.rotation_euler, wall.location = parent, (0, math.pi / 2, 0), (-1.8, 0, 0)  # free side: y > -0.8
    walls, keep_out = bpy.data.collections.new("walls"), bpy.data.collections.new("keep out")
    walls.objects.link(wall)
    bpy.ops.mesh.primitive_cube_add(size=1)
    cube = bpy.context.object
    cube.parent, cube.location, cube.scale = parent, (0, -0.6, 0), (2, 0.5, 4)  # x from 0.7 to 1.7, y from 0 to 2, z from -2 to 2
    for collection, object in ((walls, parent), (keep_out, cube)):
        scene.collection.children.link(collection)
        if object is parent:
            scene.collection.objects.link(parent)
        else:
            keep_out.objects.link(cube)
            scene.collection.objects.unlink(cube)
    scene.camsplat.walls, scene.camsplat.keep_out = walls, keep_out
    scene.camsplat.floor, scene.camsplat.floor_height = "HEIGHT", -0.2

    def behind_wall(p):
        return p[:, 1] < -0.8

    def below_floor(p):
        return p[:, 2] < -0.2

    def in_volume(p):
        return (p[:, 0] > 0.7) & (p[:, 0] < 1.7) & (p[:, 1] > 0) & (p[:, 1] < 2) & (np.abs(p[:, 2]) < 2)

    select(bpy.data.objects["sphere"])
    bpy.ops.camsplat.plan()
    limited = planned_poses(scene)[:, :3, 3]
    for broken in (behind_wall, below_floor, in_volume):
        assert broken(free).any() and not broken(limited).any(), broken.__name__


def test_what_is_not_selected_hides_and_blocks(scene, extension):
    """If this failed, cameras would stand behind or in things that renders show, and see nothing of the selected objects."""
    bpy.ops.mesh.primitive_cube_add(size=1, location=(1.0, 0, 0))
    wall = bpy.context.object
    wall.scale = (0.2, 8, 8)
    sphere = add_sphere("sphere", 0.5)
    select(sphere)
    scene.camsplat.views = 20
    bpy.ops.camsplat.plan()
    positions = planned_poses(scene)[:, :3, 3]
    assert (positions[:, 0] < 0.9).all(), positions
    # Those around the sphere, not around both.
    assert (np.linalg.norm(positions, axis=1) < 3).all(), positions
    assert "camsplat coverage" in sphere.data.color_attributes and "camsplat coverage" not in wall.data.color_attributes
    bpy.ops.camsplat.score()

    # What renders do not show is not there: here as its collection lies in one that is disabled.
    outer, inner = bpy.data.collections.new("outer"), bpy.data.collections.new("inner")
    scene.collection.children.link(outer)
    outer.children.link(inner)
    inner.objects.link(wall)
    scene.collection.objects.unlink(wall)
    outer.hide_render = True
    bpy.ops.camsplat.plan()
    assert (planned_poses(scene)[:, 0, 3] > 0.9).any()
    request = extension.planning.read_request(bpy.context, [sphere])
    assert len(request.surroundings.faces) == 0 and len(request.everything.faces) == len(request.surface.faces)


def test_a_room_is_planned_inside_of_a_box(scene):
    """If this failed, cameras of a room would stand outside of the chosen box, at other heights or nearer to a wall than asked."""
    bpy.ops.mesh.primitive_cube_add(size=2)
    room = bpy.context.object
    room.scale = (3, 2, 1.25)
    bpy.ops.mesh.primitive_cube_add(size=2)
    box = bpy.context.object
    box.location, box.scale, box.rotation_euler = (0.5, 0, 0), (1.5, 2, 1), (0, 0, math.pi / 2)
    select(room)
    settings = scene.camsplat
    settings.preset, settings.box, settings.views = "room", box, 8
    settings.use_heights, settings.heights = True, (-0.6, 0.3)
    settings.use_clearance, settings.clearance = True, 0.3
    bpy.ops.camsplat.plan()
    positions = planned_poses(scene)[:, :3, 3]
    assert (positions > np.array([-1.5, -1.5, -0.6]) - 1e-5).all() and (positions < np.array([2.5, 1.5, 0.3]) + 1e-5).all()
    assert (np.abs(positions) < (3 - 0.25, 2 - 0.25, 1.25)).all()


def test_refusals_leave_nothing(scene, tmp_path):
    """If this failed, a request that makes no sense would change the scene, or end without a line that says what to do."""
    sphere = add_sphere("sphere")
    empty = bpy.data.objects.new("empty", None)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    for object in (empty, camera):
        scene.collection.objects.link(object)
    scene.camera = camera
    before = contents()

    def refuses(words: str) -> None:
        with pytest.raises(RuntimeError, match=words):
            bpy.ops.camsplat.plan()
        assert contents() == before and scene.camsplat.cameras is None and scene.camera == camera

    select()
    refuses("nothing is selected")
    select(empty)
    refuses("empty: there is no visible mesh")
    scene.camsplat.source = "COLLECTION"
    refuses("no collection is chosen")
    scene.camsplat.source = "SELECTED"
    select(sphere)
    camera.data.shift_x = 0.1
    refuses("camera camera: its lens is shifted")
    camera.data.shift_x, camera.data.type = 0.0, "ORTHO"
    refuses("its type is ortho")
    camera.data.type = "PERSP"
    scene.camsplat.use_heights, scene.camsplat.heights = True, (50.0, 60.0)
    refuses("heights")
    scene.camsplat.use_heights = False
    marker = scene.timeline_markers.new("mine", frame=2)
    marker.camera = camera
    before["markers"] = 1
    refuses("timeline marker mine")

    for operator in (bpy.ops.camsplat.render, bpy.ops.camsplat.score):
        with pytest.raises(RuntimeError, match="no planned cameras"):
            operator()


def test_an_open_keep_out_mesh_is_refused(scene):
    """If this failed, a volume that is none would be taken, or the message would not name the object."""
    sphere = add_sphere("sphere")
    bpy.ops.mesh.primitive_plane_add()
    scene.camsplat.keep_out = bpy.data.collections.new("keep out")
    scene.collection.children.link(scene.camsplat.keep_out)
    scene.camsplat.keep_out.objects.link(bpy.context.object)
    select(sphere)
    with pytest.raises(RuntimeError, match=r"Plane.*not closed|Plane.*no volume|Plane.*volume"):
        bpy.ops.camsplat.plan()


def test_a_stopped_plan_changes_nothing(scene, extension):
    """If this failed, Esc would not stop the planner, or leave cameras of a plan that was given up."""
    add_sphere("sphere")
    scene.camsplat.views = 100
    before = contents()
    steps = extension.operators.CAMSPLAT_OT_plan.steps(None, bpy.context)
    progress = next(steps)
    while progress[1] == 0:
        progress = next(steps)
    assert progress[0] and 0 < progress[1] <= progress[2]
    steps.close()
    assert contents() == before

    request = extension.planning.read_request(bpy.context, [bpy.data.objects["sphere"]])
    run = extension.planning.Run(request, 100, extension.lens.planning_lens(scene)[1])
    run.start()
    while run.progress[1] == 0:
        run.join(0.05)
    run.stop()
    with pytest.raises(extension.planning.Stopped):
        run.outcome()


def test_coverage_is_on_the_mesh(planned, extension):
    """If this failed, meshes would show no coverage, or that of another place."""
    sphere = bpy.data.objects["sphere"]
    attribute = sphere.data.color_attributes["camsplat coverage"]
    assert attribute.domain == "POINT" and len(attribute.data) == len(sphere.data.vertices)
    colours = np.array([value.color_srgb[:3] for value in attribute.data])
    heights = np.array([vertex.co.z for vertex in sphere.data.vertices])
    assert colours[heights < -0.9, 0].mean() > colours[heights > 0.3, 0].mean() + 0.2  # yellow, where nobody looks from below

    divided = add_sphere("divided")
    divided.modifiers.new("divide", "SUBSURF")
    twin = bpy.data.objects.new("twin", sphere.data)
    planned.collection.objects.link(twin)
    points, colours = np.array([[2, 0, 1], [2, 0, -1]]), np.array([[1, 0, 0, 1], [0, 0, 1, 1]], dtype=np.float32)
    notes = extension.coverage.paint(bpy.context.evaluated_depsgraph_get(), [sphere, divided, twin], points, colours)
    assert [note.split(":")[0] for note in notes] == ["divided", "twin"] and not divided.data.color_attributes
    attribute = sphere.data.color_attributes["camsplat coverage"]
    assert [tuple(attribute.data[i].color_srgb) for i in (heights.argmax(), heights.argmin())] == [(1, 0, 0, 1), (0, 0, 1, 1)]


def test_a_window_stays_usable(scene, extension):
    """If this failed, a timer or the status line would be left after planning, or Esc would not end it."""
    removed, lines = [], []
    window_manager = SimpleNamespace(
        progress_begin=lambda low, high: None,
        progress_update=lambda value: None,
        progress_end=lambda: None,
        event_timer_remove=removed.append,
    )
    context = SimpleNamespace(window_manager=window_manager, workspace=SimpleNamespace(status_text_set=lines.append))

    class Counting(extension.operators.SteppedOperator):
        _timer = "timer"
        reports: ClassVar[list] = []

        def steps(self, context):
            yield "counting", 1, 2
            if self.fails:
                raise camsplat.Error("it went wrong; do it right")
            return "counted"

        def report(self, kind, line):
            self.reports.append((kind, line))

    def events(*kinds, fails=False, value="PRESS"):
        operator = Counting()
        operator.fails = fails
        operator._begin(context)
        return [operator.modal(context, SimpleNamespace(type=kind, value=value)) for kind in kinds]

    runs, ends, stops = {"RUNNING_MODAL"}, {"FINISHED"}, {"CANCELLED"}
    assert events("MOUSEMOVE", "TIMER", "TIMER") == [runs, runs, ends]
    assert events("TIMER", "ESC") == [runs, stops]
    # The key that closed a dialog is let go only now.
    assert events("TIMER", "ESC", "TIMER", value="RELEASE") == [runs, runs, ends]
    assert events("TIMER", "TIMER", fails=True) == [runs, stops]
    assert removed == ["timer"] * 4 and lines == ["camsplat: counting, 1 of 2; Esc stops", None] * 4
    assert Counting.reports == [
        ({"INFO"}, "counted"),
        ({"WARNING"}, "stopped; nothing is changed"),
        ({"INFO"}, "counted"),
        ({"ERROR"}, "it went wrong; do it right"),
    ]


def test_the_zip_is_a_valid_extension(tmp_path):
    """If this failed, Blender would refuse to install the extension."""
    wheel = tmp_path / "camsplat-1.2.3-cp39-abi3-manylinux_2_34_x86_64.whl"
    wheel.write_bytes(b"a wheel's bytes")
    script = Path(__file__).resolve().parent.parent / "build.py"
    printed = subprocess.run([sys.executable, script, wheel], capture_output=True, text=True, check=True).stdout.strip()
    assert printed == str(tmp_path / "camsplat-blender-1.2.3-linux-x64.zip")
    tool = next(Path(bpy.utils.resource_path("LOCAL")).glob("scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    checked = subprocess.run([sys.executable, tool, "validate", printed], capture_output=True, text=True)
    assert checked.returncode == 0 and "error" not in checked.stdout.lower(), checked.stdout


def test_the_guide_photographs_what_it_makes(tmp_path):
    """If this failed, the zip would not install, or the guide's script would photograph another thing than it makes."""
    root = Path(__file__).resolve().parents[2]
    zips = sorted((root / "dist").glob("camsplat-blender-*.zip"))
    if not zips:
        pytest.skip("skipped: there is no zip in dist; scripts/wheel.sh and blender/build.py make it")
    guide = (root / "docs/guide/blender.md").read_text(encoding="utf-8")
    script = guide.split("```python\n")[1].split("```")[0]
    named = f"camsplat-blender-{camsplat.__version__}-linux-x64.zip"
    assert script.count(named) == 1 and script.count("/tmp/capture") == 1, script
    # Small pictures; the rest is as in the guide.
    small = "scene = bpy.context.scene; scene.render.engine, scene.render.resolution_percentage, scene.cycles.samples = 'CYCLES', 3, 4"
    shown = "print('meshes', [object.name for object in bpy.data.objects if object.type == 'MESH'])"
    script = script.replace(named, str(zips[-1])).replace("/tmp/capture", str(tmp_path / "capture"))
    script = script.replace("bpy.ops.camsplat.plan()", f"{small}\nbpy.ops.camsplat.plan()\n{shown}")
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "resources")}
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=environment, cwd=tmp_path)
    assert ran.returncode == 0 and "meshes ['Suzanne']" in ran.stdout, ran.stdout + ran.stderr
    frames = json.loads((tmp_path / "capture/transforms.json").read_text(encoding="utf-8"))["frames"]
    assert len(frames) == 12 and all((tmp_path / "capture" / frame["file_path"]).is_file() for frame in frames)
    points = camsplat.read_surface(tmp_path / "capture/points.ply")[0]
    assert np.abs(points[:, :2]).max() < 1.5 and points[:, 2].min() > -0.1 and points[:, 2].max() < 2.1, points
