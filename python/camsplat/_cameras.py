"""Cameras and surfaces as arrays, and the files in which commands take them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Optional, Protocol, Union, runtime_checkable

import numpy as np
import numpy.typing as npt

from . import _camsplat
from ._camsplat import Error

Floats = npt.NDArray[np.float64]
PathLike = Union[str, os.PathLike[str]]

_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""OpenGL axes (x right, y up, z backward) from OpenCV axes, and back."""


class Cameras:
    """N pinhole cameras.

    Attributes:
        poses: (N, 4, 4) float64, world from camera, in the units of the scene. OpenCV axes: x right, y down, z forward.
        K: (N, 3, 3) float64, intrinsics in pixels; the top left corner of an image is (0, 0).
        sizes: (N, 2) uint32, width and height in pixels.
        names: N names, of the images where there are any.

    >>> cameras = Cameras(np.eye(4)[None], size=(640, 480), fov=60)
    >>> cameras.positions, cameras.K[0, 0, 0].round(3)
    (array([[0., 0., 0.]]), np.float64(554.256))
    """

    def __init__(
        self,
        poses: npt.ArrayLike,
        *,
        size: npt.ArrayLike = (800, 800),
        fov: Optional[float] = None,
        K: Optional[npt.ArrayLike] = None,
        names: Optional[Sequence[str]] = None,
        convention: str = "opencv",
    ) -> None:
        """Cameras of poses and one lens, or one for each.

        Args:
            poses: (N, 4, 4) or (N, 3, 4), world from camera.
            size: width and height in pixels, or (N, 2).
            fov: horizontal field of view in degrees, 50 where K is not given either.
            K: (3, 3) or (N, 3, 3) intrinsics in pixels, in place of `fov`.
            names: one for each camera, none twice; 0000, 0001, ... where there are none.
            convention: axes of the poses, "opencv" or "opengl" (x right, y up, z backward; NeRF and Blender).

        Raises:
            Error: where a shape is wrong, or a pose is no rotation and translation.
        """
        given = _numbers(poses, "poses")
        if given.ndim != 3 or given.shape[1:] not in [(4, 4), (3, 4)]:
            raise Error(f"poses: the shape is {given.shape}; give (N, 4, 4), world from camera")
        count = len(given)
        self.poses: Floats = np.tile(np.eye(4), (count, 1, 1))
        self.poses[:, :3] = given[:, :3]
        if convention == "opengl":
            self.poses = self.poses @ _FLIP
        elif convention != "opencv":
            raise Error(f"convention: {convention!r} is none; give 'opencv' or 'opengl'")
        _check_poses(self.poses)
        sides = _numbers(size, "size")
        if sides.shape not in [(2,), (count, 2)]:
            raise Error(f"size: the shape is {sides.shape}; give width and height, or ({count}, 2)")
        if ((sides < 1) | (sides > 65_535) | (sides != np.floor(sides))).any():
            raise Error("size: an image has no pixels; give width and height from 1 to 65535")
        self.sizes: npt.NDArray[np.uint32] = np.array(np.broadcast_to(sides, (count, 2)), dtype=np.uint32)
        self.K: Floats = _intrinsics(self.sizes, fov, K)
        self.names: list[str] = [f"{i:04}" for i in range(count)] if names is None else [str(name) for name in names]
        if len(self.names) != count or len(set(self.names)) != count:
            raise Error(f"names: {len(set(self.names))} different ones for {count} cameras; give one for each")

    def __len__(self) -> int:
        return len(self.poses)

    def __repr__(self) -> str:
        return f"<camsplat.Cameras: {len(self)}>"

    def __iter__(self) -> Iterator[Cameras]:
        """The cameras one by one, each as `Cameras` of one."""
        return (self[i] for i in range(len(self)))

    def __getitem__(self, which: Union[int, slice, Sequence[int], npt.NDArray[Any]]) -> Cameras:
        """Some of the cameras: a slice, an index, or an array of indices or of booleans."""
        index = np.atleast_1d(np.arange(len(self))[which])
        return Cameras(self.poses[index], size=self.sizes[index], K=self.K[index], names=[self.names[i] for i in index])

    @property
    def positions(self) -> Floats:
        """(N, 3): where the cameras stand."""
        return self.poses[:, :3, 3]

    @property
    def directions(self) -> Floats:
        """(N, 3): the unit vectors along which they look."""
        return self.poses[:, :3, 2]

    @property
    def poses_opengl(self) -> Floats:
        """(N, 4, 4), world from camera, in OpenGL axes: x right, y up, z backward."""
        return self.poses @ _FLIP

    def save(self, folder: PathLike, points: Optional[npt.ArrayLike] = None, colours: Optional[npt.ArrayLike] = None) -> Path:
        """Writes the files of a capture for these cameras: transforms.json, sparse/0, points.ply and cameras.csv.

        Trainers read the folder once the photos are there: `folder`/images/NAME, with .png after names that have no extension.

        Args:
            folder: one that does not exist yet or is empty.
            points: (P, 3) positions that trainers begin from.
            colours: (P, 3), 0 to 255, of the points; grey where they are left out.

        Returns:
            The folder.

        Raises:
            Error: where a shape is wrong, a point is not finite, or the folder cannot be written.
        """
        positions = _points(np.empty((0, 3)) if points is None else points, "points")
        if colours is None:
            paint: npt.NDArray[np.uint8] = np.empty((0, 3), dtype=np.uint8)
        else:
            given = np.asarray(colours)
            if given.shape != positions.shape or not np.issubdtype(given.dtype, np.integer) or (given < 0).any() or (given > 255).any():
                raise Error(f"colours: the shape is {given.shape}, of {given.dtype}; give {positions.shape} integers from 0 to 255")
            paint = given.astype(np.uint8)
        for name in self.names:
            parts = Path(name).parts
            if not parts or Path(name).is_absolute() or ".." in parts or not name.isprintable():
                raise Error(f"names: {name!r} is no name of an image within images/; rename the camera")
        _camsplat.write_capture(folder, *self.arrays(), positions, paint)
        return Path(folder)

    def arrays(self) -> tuple[list[str], Floats, Floats, npt.NDArray[np.uint32]]:
        """As the native part has them.

        Raises:
            Error: where an attribute was changed into what is no cameras.
        """
        checked = Cameras(self.poses, size=self.sizes, K=self.K, names=self.names)
        lenses = np.stack([checked.K[:, 0, 0], checked.K[:, 1, 1], checked.K[:, 0, 2], checked.K[:, 1, 2]], axis=1)
        return checked.names, np.ascontiguousarray(checked.poses), np.ascontiguousarray(lenses), checked.sizes


def read_cameras(path: PathLike) -> Cameras:
    """Reads cameras: a COLMAP or NSVF folder, transforms.json, plan.json or the folder of a plan, or a .log trajectory.

    Of a lens with distortion the pinhole part is taken.
    """
    names, poses, lenses, sizes, _ = _camsplat.read_cameras(path)
    K = np.zeros((len(names), 3, 3))
    K[:, 0, 0], K[:, 1, 1], K[:, 0, 2], K[:, 1, 2], K[:, 2, 2] = *lenses.T, 1.0
    return Cameras(poses, size=sizes, K=K, names=names)


def read_surface(path: PathLike) -> tuple[Floats, Optional[npt.NDArray[np.uint32]]]:
    """Reads a surface of any format that the command reads: vertices, (V, 3) float64, and faces, (F, 3) uint32, or points and `None`.

    Positions are in the units and the frame of the file.
    """
    vertices, faces, _ = _camsplat.read_surface(path)
    return vertices, faces


def _check_poses(poses: Floats) -> None:
    is_finite: npt.NDArray[np.bool_] = np.all(np.isfinite(poses), axis=(1, 2))
    rotations = np.where(is_finite[:, None, None], poses[:, :3, :3], 0.0)
    off = np.abs(rotations @ rotations.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    bad = ~(is_finite & (off < 1e-4) & (np.linalg.det(rotations) > 0))
    if bad.any():
        raise Error(f"poses[{int(np.argmax(bad))}] is no rotation and translation; give world from camera, finite and without scale")


def _numbers(given: Any, name: str) -> Floats:
    """An array in double precision."""
    try:
        numbers: Floats = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise Error(f"{name}: {' '.join(str(error).split())}; give an array of numbers") from None
    return numbers


def _points(given: Any, name: str) -> Floats:
    """Points as (P, 3) little-endian numbers in double precision."""
    points: Floats = np.ascontiguousarray(_numbers(given, name), dtype="<f8")
    if points.ndim != 2 or points.shape[1] != 3:
        raise Error(f"{name}: the shape is {points.shape}; give (N, 3)")
    bad: npt.NDArray[np.bool_] = ~np.all(np.isfinite(points), axis=1)
    if bad.any():
        raise Error(f"{name}[{int(np.argmax(bad))}] is not finite; leave it out")
    return points


def _intrinsics(sizes: npt.NDArray[np.uint32], fov: Optional[float], K: Optional[npt.ArrayLike]) -> Floats:
    count = len(sizes)
    if K is None:
        degrees = 50.0 if fov is None else float(fov)
        if not 0 < degrees < 180:
            raise Error(f"fov is {degrees}; give degrees between 0 and 180")
        of_fov = np.zeros((count, 3, 3))
        of_fov[:, 0, 0] = of_fov[:, 1, 1] = 0.5 * sizes[:, 0] / np.tan(np.radians(degrees) / 2)
        of_fov[:, :2, 2], of_fov[:, 2, 2] = 0.5 * sizes, 1.0
        return of_fov
    if fov is not None:
        raise Error("K and fov are both given; give one")
    given = _numbers(K, "K")
    if given.shape not in [(3, 3), (count, 3, 3)]:
        raise Error(f"K: the shape is {given.shape}; give (3, 3) or ({count}, 3, 3)")
    if not (np.isfinite(given).all() and (given[..., 0, 0] > 0).all() and (given[..., 1, 1] > 0).all()):
        raise Error("K: a focal length is not above 0, or a number is not finite; give pixels")
    if (given[..., 1, 0] != 0).any() or (given[..., 2, :] != [0, 0, 1]).any():
        raise Error("K: a row is not that of intrinsics; give [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]")
    if (given[..., 0, 1] != 0).any():
        raise Error("K: a lens is skewed, which cameras here are not; give K[0, 1] as 0")
    return np.array(np.broadcast_to(given, (count, 3, 3)))


@runtime_checkable
class _HasVertices(Protocol):
    """A mesh or point cloud as trimesh and open3d have them."""

    @property
    def vertices(self) -> Any: ...


@runtime_checkable
class _HasPoints(Protocol):
    """A mesh or point cloud as pyvista has them, or a point cloud of open3d."""

    @property
    def points(self) -> Any: ...


@runtime_checkable
class _HasGeometry(Protocol):
    """A scene of trimesh: meshes and their places."""

    @property
    def geometry(self) -> Any: ...


Scene = Union[PathLike, npt.ArrayLike, tuple[npt.ArrayLike, npt.ArrayLike], _HasVertices, _HasPoints, _HasGeometry]
"""A surface: a file or folder that the command reads, vertices, vertices and faces, or a mesh, scene or point cloud of trimesh, open3d or
pyvista."""


def _arrays(scene: Any) -> tuple[Any, Any]:
    """Vertices and faces, if any, of what arrays and libraries have for a surface."""
    # Two points have one dimension each.
    if isinstance(scene, tuple) and len(scene) == 2 and _numbers(scene[0], "vertices").ndim == 2:
        return scene
    refused = Error(f"the surface is a {type(scene).__name__}; give a file, vertices (V, 3), (vertices, faces), a mesh or a point cloud")
    if isinstance(scene, _HasGeometry) and hasattr(scene, "to_mesh"):
        # A scene of trimesh: its meshes where they stand.
        scene = scene.to_mesh()
    elif hasattr(scene, "to_legacy"):
        # Tensors of open3d.
        scene = scene.to_legacy()
    elif hasattr(scene, "combine") and hasattr(scene, "n_blocks"):
        # Several meshes of pyvista.
        scene = scene.combine()
    if any(hasattr(scene, name) for name in ("entities", "tetras")) or (hasattr(scene, "lines") and not hasattr(scene, "extract_surface")):
        # Paths of trimesh, lines and tetrahedra of open3d.
        raise refused
    if hasattr(scene, "extract_surface"):
        if not hasattr(scene, "faces"):
            # A grid of pyvista: its outside, as older versions take it and newer ones.
            try:
                scene = scene.extract_surface(algorithm=None)
            except TypeError:
                scene = scene.extract_surface()
        if np.size(scene.faces) == 0:
            return scene.points, None
        scene = scene.triangulate()
        # Each face is how many corners it has, and these.
        return scene.points, np.reshape(scene.faces, (-1, 4))[:, 1:]
    if isinstance(scene, _HasVertices):
        # trimesh has faces, and open3d triangles.
        return scene.vertices, scene.faces if hasattr(scene, "faces") else getattr(scene, "triangles", None)
    if isinstance(scene, _HasPoints):
        return scene.points, None
    if not (isinstance(scene, (list, tuple)) or hasattr(scene, "__array__")):
        raise refused
    return scene, None


def surface_file(scene: Any, faces: Any, folder: Path, name: str = "scene") -> PathLike:
    """A file that a command can read of a surface, in `folder` where it is none yet."""
    if isinstance(scene, (str, os.PathLike)):
        if faces is not None:
            raise Error("faces go with vertices, and a file is given; leave them out")
        return scene
    scene, own_faces = _arrays(scene)
    faces = own_faces if faces is None else faces
    vertices = _points(scene, "vertices")
    if len(vertices) == 0:
        raise Error("vertices: there are none; give (V, 3)")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(vertices)}\n"
    header += "".join(f"property double {axis}\n" for axis in "xyz")
    rows = b""
    if faces is not None and np.size(faces) > 0:
        triangles = np.asarray(faces)
        if triangles.ndim != 2 or triangles.shape[1] != 3 or not np.issubdtype(triangles.dtype, np.integer):
            raise Error(f"faces: the shape is {triangles.shape}, of {triangles.dtype}; give (F, 3) vertex indices")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise Error(f"faces: indices run from {triangles.min()} to {triangles.max()}, and there are {len(vertices)} vertices")
        header += f"element face {len(triangles)}\nproperty list uchar uint vertex_indices\n"
        table = np.zeros(len(triangles), dtype=[("count", "u1"), ("corners", "<u4", 3)])
        table["count"], table["corners"] = 3, triangles
        rows = table.tobytes()
    file = folder / f"{name}.ply"
    file.write_bytes((header + "end_header\n").encode() + vertices.tobytes() + rows)
    return file


def is_of_gltf(scene: Any) -> bool:
    """Whether a scene or mesh of trimesh was loaded from glTF, where up is +y."""
    file_type = getattr(getattr(scene, "source", None), "file_type", None)
    metadata = getattr(scene, "metadata", None)
    return file_type in ("glb", "gltf") or (isinstance(metadata, dict) and "from_gltf_primitive" in metadata)


def has_lens(cameras: Any) -> bool:
    """Whether these are cameras or a file of them, and not poses alone."""
    return isinstance(cameras, (Cameras, str, os.PathLike)) or hasattr(cameras, "cameras")


def cameras_file(cameras: Any, folder: Path, name: str) -> PathLike:
    """A file that a command can read of cameras, in `folder` where it is none yet."""
    if isinstance(cameras, (str, os.PathLike)):
        return cameras
    if not isinstance(cameras, Cameras):
        cameras = getattr(cameras, "cameras", cameras)
    if not isinstance(cameras, Cameras):
        raise Error(f"{name}: a {type(cameras).__name__} holds no cameras; give a path, Cameras or a Plan")
    file = folder / f"{name}.json"
    _camsplat.write_cameras(file, *cameras.arrays())
    return file
