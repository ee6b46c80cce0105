"""Rendered captures and scores: what files say is what images show."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("bpy", reason="skipped: Blender's module bpy is not installed (pip install bpy)")
import bpy
from scenes import add_light, add_sphere, planned_poses, world_mesh

import camsplat


def pixels(file: Path) -> np.ndarray:
    """An image's (H, W, 3) values, the first row at the top."""
    image = bpy.data.images.load(str(file))
    width, height = image.size
    values = np.array(image.pixels[:]).reshape(height, width, -1)[::-1, :, :3]
    bpy.data.images.remove(image)
    return values


def project(pose: np.ndarray, lens: dict, point: np.ndarray) -> np.ndarray:
    """Where a world-from-camera pose in OpenGL axes shows a point, in pixels from the top left corner."""
    x, y, z = pose[:3, :3].T @ (point - pose[:3, 3])
    return np.array([lens["fl_x"] * x / -z + lens["cx"], lens["fl_y"] * -y / -z + lens["cy"]])


LENSES = {
    "landscape": {"resolution_x": 64, "resolution_y": 48},
    "portrait": {"resolution_x": 48, "resolution_y": 64},
    "percentage": {"resolution_x": 130, "resolution_y": 97, "resolution_percentage": 50},
    "vertical": {"resolution_x": 64, "resolution_y": 48, "sensor_fit": "VERTICAL", "sensor_height": 20.0},
    "horizontal": {"resolution_x": 48, "resolution_y": 64, "sensor_fit": "HORIZONTAL", "sensor_width": 24.0},
    "pixels": {"resolution_x": 48, "resolution_y": 48, "pixel_aspect_x": 1.5},
    "tall pixels": {"resolution_x": 64, "resolution_y": 32, "pixel_aspect_y": 1.6, "sensor_fit": "VERTICAL"},
    "shifted": {"shift_x": 0.1, "shift_y": -0.08},
    "shifted portrait": {"resolution_x": 48, "resolution_y": 64, "pixel_aspect_x": 1.2, "shift_x": 0.1, "shift_y": -0.08},
}


@pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES)
def test_a_point_is_where_the_files_say(planned, tmp_path, lens):
    """If this failed, trainers would be told other cameras than those that took the images."""
    bpy.data.objects["sphere"].hide_render = True
    light = add_sphere("light", 0.08, (2.3, 0.2, 0.5))
    add_light(light)
    for name, value in lens.items():
        setattr(planned.render if hasattr(planned.render, name) else planned.camera.data, name, value)
    bpy.ops.camsplat.render()

    folder = tmp_path / "capture"
    written = json.loads((folder / "transforms.json").read_text())
    colmap = camsplat.read_cameras(folder / "sparse" / "0")
    assert sorted(file.name for file in (folder / "images").iterdir()) == colmap.names == [f"{i:04}.png" for i in range(6)]
    seen = 0
    for frame, pose, K in zip(written["frames"], colmap.poses_opengl, colmap.K):
        view = {**written, **frame}  # what all frames share is at the top
        brightness = pixels(folder / view["file_path"]).sum(axis=2)
        brightness[brightness < 0.3] = 0  # dither
        assert brightness.shape == (view["h"], view["w"])
        if np.concatenate([brightness[[0, -1]].ravel(), brightness[:, [0, -1]].ravel()]).any():
            continue  # cut off
        rows, columns = np.nonzero(brightness)
        centre = np.array([np.average(at + 0.5, weights=brightness[rows, columns]) for at in (columns, rows)])
        point = np.array(light.location)
        assert np.abs(project(np.array(view["transform_matrix"]), view, point) - centre).max() < 0.5
        model = {"fl_x": K[0, 0], "fl_y": K[1, 1], "cx": K[0, 2], "cy": K[1, 2]}
        assert np.abs(project(pose, model, point) - centre).max() < 0.5
        seen += 1
    assert seen >= 4


def test_a_capture_is_trained_on(planned, tmp_path):
    """If this failed, `camsplat train` would refuse the folder that Render capture writes."""
    add_light(bpy.data.objects["sphere"])
    bpy.ops.camsplat.render()
    training = camsplat.train(tmp_path / "capture", out=tmp_path / "model", iterations=10, max_splats=1000)
    assert training.record["splats"] > 0
    points, _ = camsplat.read_surface(tmp_path / "capture" / "points.ply")
    assert len(points) == 5000 and np.linalg.norm(points - (2, 0, 0), axis=1).max() < 1 + 1e-6


def test_the_score_is_the_commands(planned, tmp_path):
    """If this failed, the panel would show another expected quality than `camsplat score` for the same cameras."""
    of_plan = planned.camsplat.expected
    bpy.ops.camsplat.score()
    # A plan that gains nothing says why, too.
    assert of_plan.startswith(planned.camsplat.expected)
    planned.camsplat.cameras.objects[2].location.z += 2.5
    bpy.ops.camsplat.score()
    assert planned.camsplat.expected != of_plan

    planned.cycles.samples = 1
    bpy.ops.camsplat.render()
    vertices, faces = world_mesh(bpy.data.objects["sphere"])
    lines = [f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist()] + [f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist()]
    (tmp_path / "surface.obj").write_text("".join(lines))
    command = [sys.executable, "-m", "camsplat", "score", "surface.obj", "capture/transforms.json", "--up=z", "--floor=-0.5"]
    printed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert f"expected {planned.camsplat.expected}" in printed
    score = camsplat.score(vertices, camsplat.read_cameras(tmp_path / "capture"), faces, floor=-0.5)
    assert planned.camsplat.expected.startswith(f"{round(score.db, 2) + 0.0:+.2f} dB (sd {score.sd:.2f})")


def test_rendering_restores_the_settings(planned, tmp_path):
    """If this failed, the next render of the user's would have another size, camera, format or folder."""
    render, image = planned.render, planned.render.image_settings
    render.filepath, render.resolution_percentage, image.file_format, image.color_depth = "//mine", 75, "OPEN_EXR", "32"
    render.use_border, render.use_crop_to_border, render.border_max_x, render.use_stamp = True, True, 0.5, True
    planned.frame_start, planned.frame_end, planned.camera = 3, 8, planned.camsplat.cameras.objects[4]

    def state():
        settings = {name: getattr(render, name) for name in render.bl_rna.properties.keys()}
        simple = {name: value for name, value in settings.items() if isinstance(value, (str, int, float, bool))}
        markers = [(marker.frame, marker.camera.name) for marker in planned.timeline_markers]
        format = (image.file_format, image.color_mode, image.color_depth, image.compression)
        return simple, format, markers, planned.camera.name, planned.frame_start, planned.frame_end, planned.frame_current

    before = state()
    bpy.ops.camsplat.render()
    assert state() == before and pixels(tmp_path / "capture" / "images" / "0000.png").shape == (36, 48, 3)

    files = sorted(tmp_path.rglob("*"))
    with pytest.raises(RuntimeError, match="there is something here already"):
        bpy.ops.camsplat.render()
    planned.camsplat.folder = "//other"
    planned.camsplat.cameras.objects[1].name = "a/b"
    with pytest.raises(RuntimeError, match="rename the camera"):
        bpy.ops.camsplat.render()
    planned.camsplat.cameras.objects[1].data.type = "PANO"
    with pytest.raises(RuntimeError, match="its type is pano"):
        bpy.ops.camsplat.render()
    assert state()[0] == before[0] and sorted(tmp_path.rglob("*")) == files


def test_a_stopped_render_leaves_nothing(planned, extension, tmp_path):
    """If this failed, Esc would leave half a capture, or the scene with the settings of a capture."""
    camera, path, files = planned.camera, planned.render.filepath, sorted(tmp_path.rglob("*"))
    steps = extension.operators.CAMSPLAT_OT_render.steps(None, bpy.context)
    assert [next(steps), next(steps)] == [("rendering", 0, 6), ("rendering", 1, 6)]
    assert planned.render.filepath != path
    steps.close()
    assert sorted(tmp_path.rglob("*")) == files
    assert (planned.camera, planned.render.filepath, planned.timeline_markers[0].camera.name) == (camera, path, "0000")


def test_a_moved_camera_is_written_where_it_is(planned, tmp_path):
    """If this failed, trainers would be told where a camera was planned, not where its image was taken."""
    planned.cycles.samples = 1
    poses = planned_poses(planned)
    camera = planned.camsplat.cameras.objects[3]
    camera.location.x += 0.25
    camera.scale = (2, 2, 2)
    target = bpy.data.objects.new("target", None)
    target.location = (2, 0, 0.5)
    planned.collection.objects.link(target)
    track = camera.constraints.new("TRACK_TO")
    track.target, track.track_axis, track.up_axis = target, "TRACK_NEGATIVE_Z", "UP_Y"
    bpy.ops.camsplat.render()

    transforms = json.loads((tmp_path / "capture" / "transforms.json").read_text())
    written = np.array([frame["transform_matrix"] for frame in transforms["frames"]])
    colmap = camsplat.read_cameras(tmp_path / "capture" / "sparse" / "0").poses_opengl
    assert np.abs(written - colmap).max() < 1e-6
    still = [i for i in range(6) if i != 3]
    assert np.abs(written[still] - poses[still]).max() < 1e-6
    assert np.allclose(written[3, :3, 3], poses[3, :3, 3] + (0.25, 0, 0), atol=1e-6)
    towards = np.array([2, 0, 0.5]) - written[3, :3, 3]
    assert np.allclose(-written[3, :3, 2], towards / np.linalg.norm(towards), atol=1e-5)
