"""Plans: where cameras should stand, and what they are worth before a photo is taken."""

from __future__ import annotations

import functools
import json
import logging
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _show
from ._cameras import Cameras, Floats, PathLike, Scene, cameras_file, has_lens, is_of_gltf, read_cameras, read_surface, surface_file
from ._camsplat import Error
from ._command import Progress, run
from ._keywords import keywords
from ._options import PlanOptions, ScoreOptions
from ._show import Report

if TYPE_CHECKING:
    from typing_extensions import Unpack

_logger = logging.getLogger("camsplat")


class Plan(Report):
    """A plan and the folder that holds it; what `plan` returns, and `Plan(folder)` of one that the command has made.

    Attributes:
        folder: everything that the command writes: report.html, transforms.json, sparse/0, cameras.csv, ... Where no `out` was given it
            is a temporary folder, which goes with the plan; see `save`.
        record: the contents of plan.json.
        cameras: the planned cameras.
        kept: those that were given with `keep`.
    """

    def __init__(self, folder: PathLike, *, _temporary: Optional[_show.Temporary] = None) -> None:
        super().__init__(folder, _temporary)
        self.record: dict[str, Any] = self._json("plan.json")
        everything = read_cameras(self.folder / "plan.json")
        planned = len(everything) - int(self.record["kept"])
        self.cameras: Cameras = everything[:planned]
        self.kept: Cameras = everything[planned:]

    def __repr__(self) -> str:
        expected = "" if self.expected is None else f", {round(self.expected, 2) + 0.0:+.2f} dB expected"
        because = "" if self.reason is None else f": {self.reason}"
        return f"<camsplat.Plan: {len(self.cameras)} cameras{expected}{because}>"

    @property
    def poses(self) -> Floats:
        """(N, 4, 4), world from camera, of the planned cameras in OpenCV axes: x right, y down, z forward."""
        return self.cameras.poses

    @property
    def K(self) -> Floats:
        """(3, 3): the intrinsics in pixels that all planned cameras share."""
        K: Floats = self.cameras.K[0]
        return K

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the images in pixels."""
        width, height = self.cameras.sizes[0]
        return int(width), int(height)

    @property
    def expected(self) -> Optional[float]:
        """PSNR in decibels that trained splats are expected to gain over the best simple layout; `None` where it was not computed."""
        expected = self.record.get("expected")
        return None if expected is None else float(expected["db"])

    @property
    def reason(self) -> Optional[str]:
        """Why `expected` is 0.00: the plan is the best simple layout itself. `None` where it is another."""
        expected = self.record.get("expected") or {}
        reason: Optional[str] = expected.get("reason")
        return reason

    @property
    def points(self) -> Floats:
        """(P, 3): the points of the surface that the plan was scored at."""
        return read_surface(self.folder / "points.ply")[0]

    def to_nerfstudio(self) -> dict[str, Any]:
        """The contents of transforms.json, as nerfstudio and instant-ngp read it."""
        return self._json("transforms.json")

    def to_colmap(self, folder: PathLike) -> Path:
        """Writes the COLMAP model of the plan as `folder`/sparse/0, and returns that path."""
        return self._copy("sparse/0", Path(folder) / "sparse" / "0")

    def log_to_rerun(self, entity: str = "plan", recording: Any = None) -> None:
        """Logs cameras and points to a recording of rerun, else to the current one. Needs `pip install rerun-sdk`."""
        _show.log_to_rerun(self.cameras, self.points, entity, recording)

    def to_viser(self, server: Any, name: str = "/plan") -> None:
        """Adds cameras and points to the scene of a viser server. Needs `pip install viser`."""
        _show.to_viser(self.cameras, self.points, server, name)


takes = functools.partial(keywords, {"Cameras": Cameras, "Scene": Scene, "Plan": Plan})
"""For a function that takes the options of a command."""


@dataclass(frozen=True)
class Score:
    """What cameras are worth.

    Attributes:
        db: PSNR in decibels that trained splats are expected to gain over the best simple layout.
        sd: standard deviation of `db`.
        unseen: share of what viewers look at that no camera sees.
        against: the layout that it is measured against.
        metrics: geometric metrics, by name.
    """

    db: float
    sd: float
    unseen: float
    against: str
    metrics: Mapping[str, Any]


@dataclass(frozen=True)
class QualityCurve:
    """How many views are worth taking.

    Attributes:
        views: (B,) numbers of views.
        db: (B,) expected PSNR in decibels, against that of the most views; trained with 30,000 iterations,
            100 views gained it over 50 around objects and 300 over 100 in rooms; with 10,000 and fewer splats half and three quarters.
        unseen: (B,) share of what viewers look at that no camera sees.
        svg: the curve as a picture, which notebooks show.
    """

    views: npt.NDArray[np.int64]
    db: Floats
    unseen: Floats
    svg: str

    def _repr_svg_(self) -> str:
        return self.svg


@takes(PlanOptions)
def plan(
    scene: Scene,
    faces: Optional[npt.ArrayLike] = None,
    views: int = 50,
    *,
    out: Optional[PathLike] = None,
    progress: Progress = False,
    **options: Unpack[PlanOptions],
) -> Plan:
    """Places `views` cameras for a surface.

    Args:
        scene: a file or folder that `camsplat plan` reads (mesh, points, splats, capture); vertices, (V, 3); (vertices, faces); or a mesh,
            scene or point cloud of trimesh, open3d or pyvista. All but files have +z up, what trimesh loaded from glTF +y as the file
            has, unless `up` says otherwise; the log says which.
        faces: (F, 3) vertex indices, counter-clockwise from outside. Vertices without faces are points.
        views: cameras to place.
        out: folder to write; `None` for a temporary one that goes with the plan.
        progress: `True` for a bar (needs tqdm), or a function of what is being done, the units that are done, and all of them.
        options: those of `camsplat plan`. `keep` and `viewers` also take `Cameras`, a `Plan` or poses (N, 4, 4) with the lens of
            `fov` and `size`; `surface` also arrays.

    Returns:
        The plan. Lengths and positions are in the units and the frame of the surface.

    Raises:
        Error: where the request makes no sense, files cannot be read, or the device fails; with the line that the command prints.
        KeyboardInterrupt: after Ctrl-C. The plan so far is scored and in `out`, where one was given.
    """
    temporary = _show.Temporary()
    folder = temporary.folder / "plan" if out is None else Path(out)
    source = surface_file(scene, faces, temporary.folder)
    given = _files("plan", options, PlanOptions, temporary.folder)
    run("plan", [source], {"views": views, "out": folder, **_up(scene, given), **given}, progress, temporary.folder, out is None)
    return Plan(folder, _temporary=temporary if out is None else None)


@takes(ScoreOptions)
def score(
    scene: Scene,
    cameras: Union[Cameras, Plan, PathLike, npt.ArrayLike],
    faces: Optional[npt.ArrayLike] = None,
    *,
    size: Optional[npt.ArrayLike] = None,
    fov: Optional[float] = None,
    K: Optional[npt.ArrayLike] = None,
    **options: Unpack[ScoreOptions],
) -> Score:
    """Predicts what cameras are worth, before a photo is taken.

    Args:
        scene: as `plan` takes it.
        cameras: `Cameras`, a `Plan`, a file or folder of cameras, or poses (N, 4, 4). With a plan, region and limits are the plan's.
        faces: as `plan` takes them.
        size, fov, K: the lens of poses, as `Cameras` takes it.
        options: those of `camsplat score`.

    Raises:
        Error: as `plan`.
    """
    with tempfile.TemporaryDirectory(prefix="camsplat-") as temporary:
        folder = Path(temporary)
        source = surface_file(scene, faces, folder)
        if has_lens(cameras) and not (size is None and fov is None and K is None):
            raise Error("size, fov and K are the lens of poses, and the cameras that are given have their own; leave them out")
        cameras = _with_lens(cameras, (800, 800) if size is None else size, fov, K)
        of = cameras.folder if isinstance(cameras, Plan) else cameras_file(cameras, folder, "cameras")
        file = folder / "score.json"
        given = _files("score", options, ScoreOptions, folder)
        up = {} if _is_plan(cameras) else _up(scene, given)
        run("score", [source, of], {"json": file, **up, **given}, False, folder)
        metrics = json.loads(file.read_text())
    return Score(**metrics.pop("expected"), metrics=metrics)


@takes(PlanOptions)
def quality_curve(
    scene: Scene,
    faces: Optional[npt.ArrayLike] = None,
    *,
    progress: Progress = False,
    **options: Unpack[PlanOptions],
) -> QualityCurve:
    """Plans with 5 to 300 views and predicts the quality of each: how many views are worth taking.

    Args and raises as `plan`; nothing is left where it is stopped.
    """
    with tempfile.TemporaryDirectory(prefix="camsplat-") as temporary:
        folder = Path(temporary) / "curve"
        source = surface_file(scene, faces, Path(temporary))
        given = _files("quality_curve", options, PlanOptions, Path(temporary))
        run("plan", [source], {"curve": True, "out": folder, **_up(scene, given), **given}, progress, Path(temporary))
        points = json.loads((folder / "curve.json").read_text())
        svg = (folder / "curve.svg").read_text()
    views, db, unseen = (np.array([point[key] for point in points]) for key in ("views", "db", "unseen"))
    return QualityCurve(views, db, unseen, svg)


def _is_plan(cameras: Any) -> bool:
    """Whether these are a plan, which knows its region and up."""
    if isinstance(cameras, (str, os.PathLike)):
        path = Path(cameras)
        return path.name == "plan.json" or (path / "plan.json").is_file()
    return isinstance(cameras, Plan)


def _up(scene: Any, given: Mapping[str, Any]) -> dict[str, str]:
    """Up of a scene in memory as of the file that it is from, where that is known; what is assumed is said."""
    if isinstance(scene, (str, os.PathLike)) or given.get("up") is not None:
        return {}
    if is_of_gltf(scene):
        _logger.info("up       +y, as in the glTF file that this was loaded from (up says another)")
        return {"up": "y"}
    _logger.info("up       +z, as no file says otherwise (up says another)")
    return {}


def _with_lens(cameras: Any, size: npt.ArrayLike, fov: Optional[float], K: Optional[npt.ArrayLike] = None) -> Any:
    """Poses as cameras of this lens; all else as it is."""
    return cameras if has_lens(cameras) else Cameras(cameras, size=size, fov=fov, K=K)


def _files(name: str, options: Mapping[str, Any], known: type, folder: Path) -> dict[str, Any]:
    """Options with files in place of arrays; refuses those that the function does not have, as Python does."""
    for option in options:
        if option not in known.__annotations__:
            raise TypeError(f"{name}() got an unexpected keyword argument {option!r}")
    files = dict(options)
    if files.get("surface") is not None:
        files["surface"] = surface_file(files["surface"], None, folder, "surface")
    for key in ("keep", "viewers"):
        if files.get(key) is None:
            continue
        size = options.get("size")
        if isinstance(size, str):
            size = size.split("x")
        try:
            cameras = _with_lens(files[key], np.resize(np.asarray(800 if size is None else size, dtype=float), 2), options.get("fov"))
        except Error as error:
            raise Error(f"{key}: {error}") from None
        if isinstance(cameras, Cameras) and len(cameras) == 0:
            del files[key]
        else:
            files[key] = cameras_file(cameras, folder, key)
    return files
