"""The files of a capture: transforms.json, a COLMAP model and points, for images that are in `images/`."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import numpy.typing as npt

import camsplat


@contextmanager
def new_folder(folder: Path) -> Iterator[Path]:
    """A folder to write into, which becomes `folder` at the end; where something fails before, nothing is left."""
    folder = folder.resolve()
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise camsplat.Error(f"{folder}: there is something here already; name another folder")
    if not folder.parent.is_dir():
        raise camsplat.Error(f"{folder.parent}: there is no such folder; make it, or name another")
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as hidden:
        staged = Path(hidden) / folder.name
        staged.mkdir()
        yield staged
        folder.mkdir(exist_ok=True)
        for entry in staged.iterdir():
            entry.rename(folder / entry.name)


def image_name(camera: str) -> str:
    """The name of a camera's image, inside of `images/`."""
    if "/" in camera or "\\" in camera:
        raise camsplat.Error(f"camera {camera}: a name with a slash is no name of an image; rename the camera")
    return f"{camera}.png"


def write_files(folder: Path, cameras: camsplat.Cameras, points: npt.NDArray[np.float64]) -> None:
    """Writes everything that a trainer needs besides the images into an empty folder."""
    images = [image_name(name) for name in cameras.names]
    camsplat.Cameras(cameras.poses, size=cameras.sizes, K=cameras.K, names=images).save(folder, points)
