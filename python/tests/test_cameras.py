"""Cameras as arrays: axes, lenses, files, refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import camsplat
from conftest import write_splats


def pose(position: tuple[float, float, float] = (0, 0, 0)) -> np.ndarray:
    """A camera that looks along +z with y down."""
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return matrix


def test_axes_are_those_that_the_name_says(tmp_path: Path) -> None:
    """If this failed, images of somebody's own poses would be mirrored, upside down or of what is behind the camera."""
    # In front, one to the right and one below, by OpenCV's axes.
    centres = np.array([[0.0, 0.0, 4.0], [1.0, 0.0, 4.0], [0.0, 1.0, 4.0]])
    write_splats(tmp_path / "three.ply", centres, np.eye(3), scale=0.05)
    cameras = camsplat.Cameras(pose()[None], size=(80, 60), K=np.array([[80.0, 0, 40], [0, 80, 30], [0, 0, 1]]))
    [(image, depth)] = camsplat.render(tmp_path / "three.ply", cameras, depth=True)
    assert image.shape == (60, 80, 3) and depth is not None and depth.shape == (60, 80)
    # The pixel that a splat is on: focal length times offset over depth, from the principal point.
    for channel, (x, y) in enumerate([(40, 30), (60, 30), (40, 50)]):
        found = image[y, x]
        assert found[channel] > 0.8 and found.sum() - found[channel] < 0.05, (channel, found)
        assert depth[y, x] == pytest.approx(4.0, rel=1e-3)
    assert depth[5, 5] == 0 and image[5, 5].max() == 0
    # The same camera by OpenGL's axes: y up, z backward.
    flipped = camsplat.Cameras((pose() @ np.diag([1.0, -1, -1, 1]))[None], convention="opengl", size=(80, 60))
    assert np.array_equal(flipped.poses, cameras.poses)
    assert np.array_equal(flipped.poses_opengl @ np.diag([1.0, -1, -1, 1]), flipped.poses)
    [(straight, none)] = camsplat.render(tmp_path / "three.ply", cameras, alpha=True)
    assert straight.shape == (60, 80, 4) and none is None
    # A pixel's centre is half a pixel from the splat's, of variance 1, and 0.3 more of the low-pass.
    assert straight[30, 40, 3] == pytest.approx(0.99 * np.exp(-0.25 / 1.3), rel=1e-2) and straight[5, 5, 3] == 0


def test_cameras_survive_the_way_through_files(tmp_path: Path) -> None:
    """If this failed, kept and scored cameras would not be those that were given."""
    rng = np.random.default_rng(7)
    rotations = np.linalg.qr(rng.normal(size=(20, 3, 3)))[0]
    rotations *= np.sign(np.linalg.det(rotations))[:, None, None]
    poses = np.tile(np.eye(4), (20, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotations, rng.normal(size=(20, 3)) * 1e5
    K = np.tile(np.eye(3), (20, 1, 1))
    K[:, 0, 0], K[:, 1, 1] = rng.uniform(300, 900, 20), rng.uniform(300, 900, 20)
    K[:, :2, 2] = rng.uniform(200, 300, (20, 2))
    cameras = camsplat.Cameras(poses, size=rng.integers(400, 600, (20, 2)), K=K, names=[f"photo {i}.jpg" for i in range(20)])
    camsplat._camsplat.write_cameras(tmp_path / "some.json", *cameras.arrays())
    read = camsplat.read_cameras(tmp_path / "some.json")
    assert read.names == cameras.names and np.array_equal(read.sizes, cameras.sizes) and np.array_equal(read.K, K)
    assert np.abs(read.poses[:, :3, :3] - poses[:, :3, :3]).max() < 1e-14
    assert np.array_equal(read.positions, cameras.positions)
    assert (
        len(cameras[3:5]) == 2
        and [len(camera) for camera in cameras] == 20 * [1]
        and cameras[[4, 7]].names == ["photo 4.jpg", "photo 7.jpg"]
    )
    assert cameras[cameras.positions[:, 0] > 0].positions[:, 0].min() > 0


def test_saved_cameras_are_a_capture(tmp_path: Path) -> None:
    """If this failed, trainers would read other cameras than those in Python, or somebody's folder would be written over."""
    turns = np.linspace(0, 1.5, 4)
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[:, 0, 0], poses[:, 0, 2] = np.cos(turns), np.sin(turns)
    poses[:, 2, 0], poses[:, 2, 2] = -np.sin(turns), np.cos(turns)
    poses[:, :3, 3] = np.arange(12).reshape(4, 3) + 0.25
    K = np.array([[500.0, 0, 310], [0, 510, 250], [0, 0, 1]])
    cameras = camsplat.Cameras(poses, size=(640, 480), K=K, names=["a", "b.jpg", "c", "d.1"])
    points = np.random.default_rng(0).normal(size=(20, 3))
    folder = cameras.save(tmp_path / "capture", points, colours=np.full((20, 3), 200))
    for part in ["transforms.json", "sparse/0"]:
        read = camsplat.read_cameras(folder / part)
        assert np.allclose(read.poses, poses, atol=1e-12) and np.allclose(read.K, K) and (read.sizes == [640, 480]).all()
        assert read.names == ["a.png", "b.jpg", "c.png", "d.1.png"]
    assert np.allclose(camsplat.read_surface(folder / "points.ply")[0], points, atol=1e-6)
    camsplat.Cameras(poses).save(tmp_path / "without points")
    for arguments, message in [((tmp_path / "capture",), "not empty"), ((tmp_path / "new", points[:, :2]), "points: the shape")]:
        with pytest.raises(camsplat.Error, match=message):
            cameras.save(*arguments)  # type: ignore[arg-type]
    for name in ["../x", "/abs", "", "a\nb"]:
        with pytest.raises(camsplat.Error, match="within images/"):
            camsplat.Cameras(poses[:1], names=[name]).save(tmp_path / "new")
    with pytest.raises(camsplat.Error, match=r"two cameras have the image a\.png"):
        camsplat.Cameras(poses[:2], names=["a", "a.png"]).save(tmp_path / "new")
    changed = camsplat.Cameras(poses)
    changed.poses[1] *= 2
    with pytest.raises(camsplat.Error, match=r"poses\[1\]"):
        changed.save(tmp_path / "new")
    with pytest.raises(camsplat.Error, match="colours"):
        cameras.save(tmp_path / "new", points, np.full((20, 3), 300))
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"poses": np.eye(4)}, "(N, 4, 4)"),
        ({"poses": np.zeros((2, 4, 4))}, "poses[0] is no rotation"),
        ({"poses": np.stack([np.eye(4), np.diag([1.0, 1, -1, 1])])}, "poses[1] is no rotation"),
        ({"poses": np.eye(4)[None] * np.nan}, "poses[0]"),
        ({"poses": np.eye(4)[None], "convention": "blender"}, "convention"),
        ({"poses": np.eye(4)[None], "fov": 0}, "fov is 0"),
        ({"poses": np.eye(4)[None], "fov": 60, "K": np.eye(3)}, "give one"),
        ({"poses": np.eye(4)[None], "K": np.zeros((3, 3))}, "focal length"),
        ({"poses": np.eye(4)[None], "K": [[1, 0.1, 0], [0, 1, 0], [0, 0, 1]]}, "skewed"),
        ({"poses": np.eye(4)[None], "K": [[1, 0, 0], [5, 1, 0], [0, 0, 2]]}, "that of intrinsics"),
        ({"poses": np.eye(4)[None], "size": (0, 4)}, "no pixels"),
        ({"poses": np.eye(4)[None], "size": (-5, 4)}, "no pixels"),
        ({"poses": np.eye(4)[None], "size": (5, 4, 3)}, "size: the shape is (3,)"),
        ({"poses": [[1], [1, 2]]}, "give an array of numbers"),
        ({"poses": [[["a"]]]}, "give an array of numbers"),
        ({"poses": np.tile(np.eye(4), (2, 1, 1)), "names": ["a", "a"]}, "names"),
    ],
)
def test_what_are_no_cameras_is_refused(arguments: dict[str, object], message: str) -> None:
    """If this failed, a mistake in somebody's arrays would become a wrong plan or a wrong image."""
    with pytest.raises(camsplat.Error) as raised:
        camsplat.Cameras(**arguments)  # type: ignore[arg-type]
    assert message in str(raised.value) and "\n" not in str(raised.value)
