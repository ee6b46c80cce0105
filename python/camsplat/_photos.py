"""Photos that exist or are rendered: which to keep, what is trained on them, and how methods compare."""

from __future__ import annotations

import csv
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _camsplat
from ._cameras import Cameras, PathLike, read_cameras
from ._camsplat import Error
from ._command import Progress, run
from ._options import EvaluateOptions, SelectOptions, TrainOptions
from ._plan import Plan, _files, takes
from ._show import Report, Temporary

if TYPE_CHECKING:
    from typing_extensions import Unpack


class Selection(Report):
    """Photos that were selected, and the folder that holds them.

    Attributes:
        folder: a capture of the selected photos: images, transforms.json, sparse/0, chosen.csv, report.html, ...
        record: the contents of select.json.
        names: the selected photos, those that the choice would miss most first.
    """

    def __init__(self, folder: PathLike, *, _temporary: Optional[Temporary] = None) -> None:
        super().__init__(folder, _temporary)
        self.record: dict[str, Any] = self._json("select.json")
        by_worth = sorted(self.record["chosen"], key=lambda photo: -float(photo["contribution_db"]))
        self.names: list[str] = [photo["name"] for photo in by_worth]

    def __repr__(self) -> str:
        return f"<camsplat.Selection: {len(self.names)} photos>"

    @property
    def cameras(self) -> Cameras:
        """The cameras of the selected photos."""
        return read_cameras(self.folder)


class Training(Report):
    """Trained splats, and the folder that holds them.

    Attributes:
        folder: what `camsplat train` writes: point_cloud.ply, train.json, report.html, test pictures, the checkpoint. Where no `out` was
            given it is a temporary folder, which goes with the training; see `save`.
        record: the contents of train.json.
        model: the file of the trained splats, in the usual 3DGS layout.
    """

    def __init__(self, folder: PathLike, *, _temporary: Optional[Temporary] = None) -> None:
        super().__init__(folder, _temporary)
        self.record: dict[str, Any] = self._json("train.json")
        self.model: Path = self.folder / "point_cloud.ply"

    def __repr__(self) -> str:
        return f"<camsplat.Training: {self.record['splats']} splats, {self.record['iterations']} iterations>"

    @property
    def psnr(self) -> Optional[float]:
        """PSNR in decibels on the test photos; `None` without any."""
        return self._measured("psnr")

    @property
    def ssim(self) -> Optional[float]:
        """SSIM on the test photos; `None` without any."""
        return self._measured("ssim")

    @property
    def cameras(self) -> Optional[Cameras]:
        """Cameras of the photos that were trained on, with their poses corrected, where `refine_poses` was asked for; else `None`."""
        refined = self.folder / "refined" / "transforms.json"
        return read_cameras(refined) if refined.is_file() else None

    def _measured(self, metric: str) -> Optional[float]:
        evaluations = self.record["evaluations"]
        return float(evaluations[-1]["quality"][metric]) if evaluations else None


class Evaluation(Report):
    """Methods compared by what was trained on their photos, and the folder that holds it all.

    Attributes:
        folder: tables, report and every plan, photo and model.
        rows: the rows of table.csv: scene, method, views, seeds, set, metric, mean, half_interval_95.
    """

    def __init__(self, folder: PathLike) -> None:
        super().__init__(folder, None)
        table = self.folder / "table.csv"
        if not table.is_file():
            raise Error(f"{table}: there is no such file; name the folder of an evaluation")
        with open(table, newline="", encoding="utf-8") as file:
            self.rows: list[dict[str, Union[str, int, float, None]]] = [_row(row) for row in csv.DictReader(file)]

    def __repr__(self) -> str:
        return f"<camsplat.Evaluation: {len(self.rows)} rows>"


class Rendering(NamedTuple):
    """A picture of trained splats.

    Attributes:
        image: (H, W, 3) float32, sRGB from 0 to 1; with alpha (H, W, 4).
        depth: (H, W) float32, in the model's units, or `None`.
    """

    image: npt.NDArray[np.float32]
    depth: Optional[npt.NDArray[np.float32]]


@takes(SelectOptions)
def select(
    capture: PathLike,
    count: int,
    *,
    out: Optional[PathLike] = None,
    progress: Progress = False,
    **options: Unpack[SelectOptions],
) -> Selection:
    """Selects the best `count` photos of a capture.

    Args:
        capture: a COLMAP folder, a transforms.json, an NSVF or LLFF folder, or a .log of poses.
        count: photos to select.
        out: folder to write, with links to the images; `None` for a temporary one that goes with the selection.
        progress: as `plan` takes it.
        options: those of `camsplat select`.

    Raises:
        Error: with the line that the command prints.
        KeyboardInterrupt: after Ctrl-C, once the choice has ended; nothing is written.
    """
    temporary = Temporary()
    folder = temporary.folder / "selection" if out is None else Path(out)
    given = _files("select", options, SelectOptions, temporary.folder)
    run("select", [capture], {"count": count, "out": folder, **given}, progress, temporary.folder)
    return Selection(folder, _temporary=temporary if out is None else None)


@takes(TrainOptions)
def train(
    capture: PathLike,
    out: Optional[PathLike] = None,
    *,
    progress: Progress = False,
    **options: Unpack[TrainOptions],
) -> Training:
    """Trains Gaussian splats on a capture and tests them.

    Args:
        capture: posed photos: COLMAP, transforms.json or NSVF.
        out: folder for the model, test pictures, metrics, checkpoint and report; `None` for a temporary one that goes with the training.
        progress: as `plan` takes it.
        options: those of `camsplat train`.

    Raises:
        Error: with the line that the command prints.
        KeyboardInterrupt: after Ctrl-C; the same call with `resume=True` continues, where it has an `out`.
    """
    temporary = Temporary()
    folder = temporary.folder / "training" if out is None else Path(out)
    given = _files("train", options, TrainOptions, temporary.folder)
    run("train", [capture], {"out": folder, **given}, progress, temporary.folder)
    return Training(folder, _temporary=temporary if out is None else None)


@takes(EvaluateOptions)
def evaluate(
    scenes: Union[PathLike, Sequence[PathLike]],
    out: PathLike,
    *,
    progress: Progress = False,
    **options: Unpack[EvaluateOptions],
) -> Evaluation:
    """Compares methods of view selection by the splats trained on their photos.

    Args:
        scenes: objects or rooms with materials and lights, .glb or .gltf; none with `pool` or the situation of a
            built-in room.
        out: folder for tables and all results. An evaluation that was stopped continues there.
        progress: as `plan` takes it.
        options: those of `camsplat evaluate`.

    Raises:
        Error: with the line that the command prints.
        KeyboardInterrupt: after Ctrl-C; the same call continues.
    """
    if "shard" in options:
        raise Error('a shard leaves no tables; run command("evaluate", ..., shard="I/N"), then evaluate() once all are complete')
    paths = [scenes] if isinstance(scenes, (str, os.PathLike)) else list(scenes)
    with tempfile.TemporaryDirectory(prefix="camsplat-") as temporary:
        folder = Path(temporary)
        run("evaluate", paths, {"out": out, **_files("evaluate", options, EvaluateOptions, folder)}, progress, folder)
    return Evaluation(out)


def render(
    model: Union[Training, PathLike],
    cameras: Union[Cameras, Plan, PathLike],
    *,
    background: Union[str, tuple[float, float, float]] = "black",
    alpha: bool = False,
    depth: bool = False,
    antialiased: bool = False,
    near: Optional[float] = None,
    device: Union[str, int, None] = None,
) -> list[Rendering]:
    """Renders trained splats from cameras in the model's frame, without files; `command("render", ...)` writes files.

    Args:
        model: what `train` returns, or a file of trained splats from any program: .ply, .spz, .sog, .splat, .glb.
        cameras: `Cameras`, a `Plan`, or a file or folder of cameras.
        background: colour behind everything: "black", "white", or sRGB values from 0 to 1.
        alpha: images have alpha, and no background; colours are not multiplied by it.
        depth: depths too: the expected depth along the optical axis, 0 where nothing is seen.
        antialiased: the model was trained with antialiasing, and its file does not say so.
        near: nearest depth that is drawn, in the model's units; `None` for 0.01 of the cameras' extent.
        device: device by index or part of its name; `None` for the best.

    Raises:
        Error: where a file cannot be read or the device fails.
        KeyboardInterrupt: after Ctrl-C.
    """
    colours = {"black": (0.0, 0.0, 0.0), "white": (1.0, 1.0, 1.0)}
    try:
        colour = colours.get(background) if isinstance(background, str) else tuple(float(value) for value in background)
    except (TypeError, ValueError):
        colour = None
    if colour is None or len(colour) != 3 or not all(0 <= value <= 1 for value in colour):
        raise Error(f"background is {background!r}; give 'black', 'white', or red, green and blue from 0 to 1")
    if alpha and colour != colours["black"]:
        raise Error("an image with alpha has no background; leave one out")
    if isinstance(cameras, Plan):
        cameras = cameras.cameras
    elif not isinstance(cameras, Cameras):
        cameras = read_cameras(cameras)
    file = model.model if isinstance(model, Training) else model
    names, poses, lenses, sizes = cameras.arrays()
    pictures = _camsplat.render(
        file, names, poses, lenses, sizes, colour, alpha, depth, antialiased, near, None if device is None else str(device)
    )
    return [Rendering(*picture) for picture in pictures]


def _row(row: dict[str, str]) -> dict[str, Union[str, int, float, None]]:
    """A row of table.csv with numbers in place of their text."""
    integers, floats = ("views", "seeds"), ("mean", "half_interval_95")
    return {key: int(text) if key in integers else (float(text) if text else None) if key in floats else text for key, text in row.items()}
