"""A capture for programs that take the photos themselves: where the next ones are to be, time after time."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Optional, Union

import numpy as np
import numpy.typing as npt

from ._cameras import Cameras, Floats, PathLike, Scene, cameras_file, has_lens, read_cameras, surface_file
from ._camsplat import Error
from ._command import run
from ._options import NextOptions
from ._plan import _files, _up, takes

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Session:
    """A surface, and photos of it that become more: `next` says where the next ones help most.

    >>> session = camsplat.Session("room.glb", preset="room", size=(640, 480), fov=70)  # doctest: +SKIP
    >>> session.add_photos(robot.poses())  # doctest: +SKIP
    >>> while session.expected > 0.5:  # doctest: +SKIP
    ...     session.add_photos(robot.photograph(session.next(3)))

    Nothing of one step is kept for the next: each is `camsplat next` for the photos that there are.
    """

    @takes(NextOptions)
    def __init__(
        self,
        scene: Scene,
        faces: Optional[npt.ArrayLike] = None,
        *,
        size: npt.ArrayLike = (800, 800),
        fov: Optional[float] = None,
        K: Optional[npt.ArrayLike] = None,
        **options: Unpack[NextOptions],
    ) -> None:
        """A session without photos.

        Args:
            scene: as `plan` takes it. A capture's photos do not count until they are added.
            faces: as `plan` takes them.
            size, fov, K: the lens of poses that are added, as `Cameras` takes it.
            options: those of `camsplat next`.
        """
        for option in options:
            if option not in NextOptions.__annotations__:
                raise TypeError(f"Session() got an unexpected keyword argument {option!r}")
        self._scene, self._faces, self._options = scene, faces, dict(options)
        self._lens: dict[str, Any] = {"size": size, "fov": fov, "K": K}
        self._cameras: Optional[Cameras] = None
        self._answer: Optional[dict[str, Any]] = None
        self._views = 5

    def __repr__(self) -> str:
        return f"<camsplat.Session: {len(self.cameras)} photos>"

    @property
    def cameras(self) -> Cameras:
        """Cameras of the photos so far, in the order in which they were added."""
        return Cameras(np.zeros((0, 4, 4)), size=(1, 1), fov=50) if self._cameras is None else self._cameras

    def add_photos(self, cameras: Union[Cameras, PathLike, npt.ArrayLike]) -> None:
        """Adds photos that have been taken, the last one last.

        Args:
            cameras: `Cameras`, a file or folder of cameras, or poses (N, 4, 4), world from camera in OpenCV axes.

        Raises:
            Error: as `Cameras` and `read_cameras`.
        """
        new = cameras
        if not isinstance(new, Cameras):
            new = read_cameras(new) if has_lens(new) else Cameras(new, **self._lens)  # type: ignore[arg-type]
        before = self._cameras
        parts = [new] if before is None else [before, new]
        poses, K, sizes = (np.concatenate([getattr(part, name) for part in parts]) for name in ("poses", "K", "sizes"))
        if len(poses):
            self._cameras = Cameras(poses, size=sizes, K=K, names=[f"{i:05}" for i in range(len(poses))])
        self._answer = None

    def next(self, views: int = 5) -> Cameras:
        """Where the next photos help most, all of them together; the nearest to the last photo first.

        Args:
            views: how many.

        Raises:
            Error: where there are no photos yet, and as `plan`.
        """
        answer = self._asked(views)
        poses = np.tile(np.eye(4), (len(answer["next"]), 1, 1))
        for pose, place in zip(poses, answer["next"]):
            pose[:3, :3], pose[:3, 3] = _matrix(place["pose"]["rotation"]), place["pose"]["position"]
        lens = answer["intrinsics"]
        (fx, fy), (cx, cy) = lens["focal"], lens["principal"]
        K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
        names = [place["name"] for place in answer["next"]]
        return Cameras(poses, size=(lens["width"], lens["height"]), K=K, names=names)

    @property
    def expected(self) -> float:
        """PSNR in decibels that the next photos, as many as were last asked for, are expected to gain."""
        return float(self._asked(self._views)["gain_db"])

    @property
    def sd(self) -> float:
        """Standard deviation of `expected`."""
        return float(self._asked(self._views)["gain_sd_db"])

    @property
    def uncovered(self) -> Floats:
        """(P, 3): points of the surface that no photo shows, of a thousand on it."""
        return np.array(self._asked(self._views)["uncovered"], dtype=float).reshape(-1, 3)

    def _asked(self, views: int) -> dict[str, Any]:
        """What the command answers; the same while nothing has changed."""
        if self._answer is not None and views == self._views:
            return self._answer
        cameras = self._cameras
        if cameras is None:
            raise Error("there are no photos yet; add_photos first")
        with tempfile.TemporaryDirectory(prefix="camsplat-") as temporary:
            folder = Path(temporary)
            source = surface_file(self._scene, self._faces, folder)
            given = _files("Session", self._options, NextOptions, folder)
            options = {"views": views, "json": folder / "next.json", **_up(self._scene, given), **given}
            run("next", [source, cameras_file(cameras, folder, "cameras")], options, False, folder)
            self._answer = json.loads((folder / "next.json").read_text())
        self._views = views
        return self._answer


def _matrix(rotation: list[float]) -> Floats:
    """(3, 3) of a unit quaternion x, y, z, w."""
    x, y, z, w = rotation
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
