"""Results to look at: their reports, and other viewers."""

from __future__ import annotations

import base64
import html
import json
import mimetypes
import re
import shutil
import tempfile
import urllib.parse
import weakref
import webbrowser
from pathlib import Path
from typing import Any, Optional, SupportsIndex

import numpy as np

from ._cameras import Cameras, Floats, PathLike
from ._camsplat import Error


class _Page:
    """HTML that a notebook shows."""

    def __init__(self, html: str) -> None:
        self._html = html

    def _repr_html_(self) -> str:
        return self._html


class Temporary:
    """A folder that goes with this object.

    Attributes:
        folder: where it is.
    """

    def __init__(self) -> None:
        self.folder: Path = Path(tempfile.mkdtemp(prefix="camsplat-"))
        weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)


class Report:
    """A folder with a report."""

    def __init__(self, folder: PathLike, temporary: Optional[Temporary]) -> None:
        self.folder: Path = Path(folder)
        # The folder goes when this object does.
        self._temporary = temporary

    def show(self, height: int = 720) -> None:
        """Shows the report: in a notebook below the cell, `height` pixels high, else in the browser."""
        try:
            from IPython import get_ipython  # optional
            from IPython.display import display
        except ImportError:
            get_ipython = None
        page = (self.folder / "report.html").resolve()
        if not page.is_file():
            raise Error(f"{page}: there is no report; name the folder of a run")
        if get_ipython is None or get_ipython() is None:
            if not webbrowser.open(page.as_uri()):
                raise Error(f"no browser can be opened here; open {page} in one")
        else:
            display(_Page(self._frame(height)))

    def __reduce_ex__(self, protocol: SupportsIndex) -> Any:
        if self._temporary is not None:
            raise Error(f"{self.folder}: this folder goes with its object, which cannot be copied; call save() and open that folder")
        return super().__reduce_ex__(protocol)

    def save(self, folder: PathLike, *, force: bool = False) -> Path:
        """Copies everything into a folder that does not exist yet or is empty, and returns its path.

        With `force`, into one that is not empty: files of the same names are replaced, all others stay.
        """
        return self._copy(".", Path(folder), force)

    def _frame(self, height: int) -> str:
        # A frame of its own: the report's styles and scripts are not the notebook's. It has no address, so that pictures beside the
        # report have to be in it.
        page = (self.folder / "report.html").read_text(encoding="utf-8")
        page = re.sub(r'<img src="([^":]+)"', self._with_picture, page)
        return f'<iframe srcdoc="{html.escape(page)}" width="100%" height="{height}" style="border: 0"></iframe>'

    def _with_picture(self, match: re.Match[str]) -> str:
        file = self.folder / urllib.parse.unquote(html.unescape(match[1]))
        if not file.is_file():
            return match[0]
        kind = mimetypes.guess_type(file.name)[0] or "image/png"
        return f'<img src="data:{kind};base64,{base64.b64encode(file.read_bytes()).decode()}"'

    def _json(self, name: str) -> dict[str, Any]:
        file = self.folder / name
        try:
            contents: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise Error(f"{file}: cannot be read: {error}") from None
        return contents

    def _copy(self, part: str, to: Path, force: bool = False) -> Path:
        if to.exists() and (not to.is_dir() or (any(to.iterdir()) and not force)):
            raise Error(f"{to}: there is something here already; name another folder, or give force=True to write over it")
        if to.exists() and to.samefile(self.folder / part):
            raise Error(f"{to}: this is the folder that is copied; name another")
        try:
            shutil.copytree(self.folder / part, to, symlinks=True, dirs_exist_ok=True)
        except OSError as error:
            raise Error(f"{to}: it cannot be written: {error}") from None
        return to


def log_to_rerun(cameras: Cameras, points: Floats, entity: str, recording: Any) -> None:
    """See `Plan.log_to_rerun`."""
    try:
        import rerun  # optional
    except ImportError:
        raise Error('rerun is not installed; pip install "camsplat[viewers]"') from None

    rerun.log(f"{entity}/points", rerun.Points3D(points), recording=recording, static=True)
    for name, pose, K, size in zip(cameras.names, cameras.poses, cameras.K, cameras.sizes):
        path = f"{entity}/cameras/{rerun.escape_entity_path_part(name)}"
        placed = rerun.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3])
        lens = rerun.Pinhole(image_from_camera=K, resolution=size, camera_xyz=rerun.ViewCoordinates.RDF)
        rerun.log(path, placed, lens, recording=recording, static=True)


def to_viser(cameras: Cameras, points: Floats, server: Any, name: str) -> None:
    """See `Plan.to_viser`."""
    try:
        from viser.transforms import SO3  # optional
    except ImportError:
        raise Error('viser is not installed; pip install "camsplat[viewers]"') from None

    extent = float(np.linalg.norm(np.ptp(np.concatenate([points, cameras.positions]), axis=0)))
    grey = np.full((len(points), 3), 160, dtype=np.uint8)
    server.scene.add_point_cloud(f"{name}/points", points=points, colors=grey, point_size=extent / 500)
    for i, (label, pose, K, size) in enumerate(zip(cameras.names, cameras.poses, cameras.K, cameras.sizes)):
        server.scene.add_camera_frustum(
            f"{name}/cameras/{i:04}_{label.replace('/', '_')}",
            fov=2 * float(np.arctan2(size[1] / 2, K[1, 1])),
            aspect=float(size[0] / size[1]),
            scale=extent / 40,
            wxyz=SO3.from_matrix(pose[:3, :3]).wxyz,
            position=pose[:3, 3],
        )
