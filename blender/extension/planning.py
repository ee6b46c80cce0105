"""What the settings ask for, and the planner's run in a thread of its own."""

import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import bpy
import numpy as np

import camsplat

from .lens import Lens
from .surface import Surface, join, read_box, read_surface, read_surroundings, read_volumes, read_walls, write_obj

Progress = tuple[str, int, int]
"""What is being done, the units that are done, and all of them."""


class Request(NamedTuple):
    """What is to be seen, what else is there, and where cameras may stand, apart from the scene: it may be carried out in any thread."""

    surface: Surface
    surroundings: Surface
    """It hides what is behind it, and no camera stands in it."""
    options: dict[str, Any]
    volumes: dict[str, Surface]

    @property
    def everything(self) -> Surface:
        """What is to be seen and all else, joined."""
        return join(self.surface, self.surroundings)

    def plan(self, views: int, lens: Lens, progress: Callable[[str, int, int], object]) -> camsplat.Plan:
        """Places cameras."""
        with tempfile.TemporaryDirectory(prefix="camsplat-") as folder:
            options = self._options_with_files(Path(folder))
            return camsplat.plan(*self.everything, views=views, fov=lens.fov, size=lens.square_size, progress=progress, **options)

    def score(self, cameras: camsplat.Cameras) -> camsplat.Score:
        """Predicts what cameras are worth."""
        with tempfile.TemporaryDirectory(prefix="camsplat-") as folder:
            vertices, faces = self.everything
            return camsplat.score(vertices, cameras, faces, **self._options_with_files(Path(folder)))

    def reach(self, cameras: camsplat.Cameras) -> float:
        """The distance from a camera to the farthest corner of the bounding box of everything, at most."""
        vertices = self.everything.vertices
        corners = np.stack([vertices.min(axis=0), vertices.max(axis=0)])
        farthest = np.abs(cameras.positions[:, None] - corners).max(axis=1)
        return float(np.linalg.norm(farthest, axis=1).max())

    def _options_with_files(self, folder: Path) -> dict[str, Any]:
        files = []
        for i, (name, volume) in enumerate(self.volumes.items()):
            safe = "".join(letter if letter.isalnum() else "_" for letter in name)
            files.append(folder / f"{i}-{safe}.obj")
            write_obj(files[-1], volume)
        options = {**self.options, "keep_out": files or None}
        if len(self.surroundings.faces) > 0:
            options["subject"] = folder / "subject.obj"
            write_obj(options["subject"], self.surface)
            # What stands below the subject is there, and blocks views by itself.
            options["floor"] = "none" if options["floor"] == "auto" else options["floor"]
        return options


def read_request(context: bpy.types.Context, objects: list[bpy.types.Object]) -> Request:
    """Reads from the scene what the settings choose, for these objects."""
    settings = context.scene.camsplat
    depsgraph = context.evaluated_depsgraph_get()
    options = {
        "preset": settings.preset,
        "seed": settings.seed,
        "floor": settings.floor_height if settings.floor == "HEIGHT" else settings.floor,
        "heights": tuple(settings.heights) if settings.use_heights else None,
        "clearance": settings.clearance if settings.use_clearance else None,
        "wall": read_walls(settings.walls) if settings.walls is not None else None,
        "box": read_box(settings.box) if settings.box is not None else None,
    }
    volumes = read_volumes(depsgraph, settings.keep_out) if settings.keep_out is not None else {}
    surface = read_surface(depsgraph, objects)
    return Request(surface, read_surroundings(depsgraph, objects, limits_of(settings)), options, volumes)


def limits_of(settings: bpy.types.PropertyGroup) -> list[bpy.types.Object]:
    """Objects that say where cameras may stand: they are no part of the scene that is photographed."""
    collections = [collection for collection in (settings.walls, settings.keep_out) if collection is not None]
    boxes = [settings.box] if settings.box is not None else []
    return [*boxes, *(object for collection in collections for object in collection.all_objects)]


class Stopped(Exception):
    """Raised in the thread to stop it."""


class Run(threading.Thread):
    """A plan that is being made. `progress` may be read meanwhile; `outcome` is for when the thread has ended."""

    def __init__(self, request: Request, views: int, lens: Lens) -> None:
        super().__init__(name="camsplat", daemon=True)
        self.progress: Progress = ("starting", 0, 1)
        self._request, self._views, self._lens = request, views, lens
        self._stops = threading.Event()
        self._plan: camsplat.Plan | None = None
        self._error: BaseException | None = None

    def run(self) -> None:
        """What the thread does."""
        try:
            self._plan = self._request.plan(self._views, self._lens, self._tell)
        except BaseException as error:
            self._error = error

    def stop(self) -> None:
        """Stops planning after the iteration that is running, and waits for that."""
        self._stops.set()
        self.join()

    def outcome(self) -> camsplat.Plan:
        """The plan; raises what the thread raised."""
        if self._plan is None:
            raise self._error or Stopped
        return self._plan

    def _tell(self, doing: str, done: int, total: int) -> None:
        if self._stops.is_set():
            raise Stopped
        self.progress = (doing, done, total)
