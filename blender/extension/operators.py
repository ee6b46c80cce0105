"""Operators: plan, render, score."""

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import bpy
import numpy as np

import camsplat

from .cameras import check_markers, make_cameras, planned_cameras, read_cameras
from .capture import image_name, new_folder, write_files
from .coverage import paint, read_coverage
from .lens import planning_lens
from .planning import Progress, Run, limits_of, read_request
from .surface import planned_objects, read_surface, read_surroundings, sample_points

Steps = Generator[Progress, None, str]
"""Work in steps, each of which says how far it is; returns what to report at the end."""

POINTS = 5000
"""Points of the surface that trainers start from."""

RENDER_OVERRIDES = {
    "use_border": False,
    "use_multiview": False,
    "use_sequencer": False,
    "use_stamp": False,
    "use_overwrite": True,
    "use_placeholder": False,
}
"""Render settings while views are rendered."""


class SteppedOperator:
    """An operator that works in steps: in a window a timer takes them and Esc stops, else one after another."""

    def steps(self, context: bpy.types.Context) -> Steps:
        """The work. Closed early, it takes back what it did."""
        raise NotImplementedError

    def execute(self, context: bpy.types.Context) -> set[str]:
        self._begin(context)
        try:
            while (ended := self._step(context)) is None:
                pass
            return ended
        except KeyboardInterrupt:
            return self._stopped()
        finally:
            self._end(context)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self._begin(context)
        self._timer = context.window_manager.event_timer_add(0.05, window=context.window)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        # Nothing else happens meanwhile: the scene stays as it was read.
        if event.type not in {"TIMER", "ESC"} or (event.type == "ESC" and event.value != "PRESS"):
            return {"RUNNING_MODAL"}
        ended = None
        try:
            ended = self._stopped() if event.type == "ESC" else self._step(context)
            return ended or {"RUNNING_MODAL"}
        except BaseException:
            ended = {"CANCELLED"}
            raise
        finally:
            if ended is not None:
                self.cancel(context)

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender where it ends the operator itself, such as on quitting."""
        context.window_manager.event_timer_remove(self._timer)
        context.workspace.status_text_set(None)
        self._end(context)

    def _begin(self, context: bpy.types.Context) -> None:
        self._steps = self.steps(context)
        context.window_manager.progress_begin(0, 100)

    def _step(self, context: bpy.types.Context) -> set[str] | None:
        """Takes a step; returns how the work ended, if it did."""
        try:
            doing, done, total = next(self._steps)
        except StopIteration as end:
            self.report({"INFO"}, end.value)
            return {"FINISHED"}
        except (camsplat.Error, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        context.window_manager.progress_update(100 * done / max(total, 1))
        if context.workspace is not None:
            context.workspace.status_text_set(f"camsplat: {doing}, {done} of {total}; Esc stops")
        return None

    def _stopped(self) -> set[str]:
        self._steps.close()
        self.report({"WARNING"}, "stopped; nothing is changed")
        return {"CANCELLED"}

    def _end(self, context: bpy.types.Context) -> None:
        self._steps.close()
        context.window_manager.progress_end()


class CAMSPLAT_OT_plan(SteppedOperator, bpy.types.Operator):
    """Place cameras for the chosen objects, in place of those planned before, and bind each to a frame"""

    bl_idname = "camsplat.plan"
    bl_label = "Plan cameras"
    bl_options: ClassVar[set[str]] = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        cls.poll_message_set("leave edit mode first")
        return context.mode == "OBJECT"

    def steps(self, context: bpy.types.Context) -> Steps:
        scene, settings = context.scene, context.scene.camsplat
        objects = planned_objects(context)
        request = read_request(context, objects)
        source, lens = planning_lens(scene)
        check_markers(scene, settings.views)
        run = Run(request, settings.views, lens)
        run.start()
        try:
            while run.is_alive():
                run.join(0.05)
                yield run.progress
        finally:
            run.stop()
        plan = run.outcome()
        coverage = read_coverage(plan.folder / "coverage.ply")
        make_cameras(scene, plan.cameras, source, request.reach(plan.cameras))
        settings.planned.clear()
        for object in objects:
            settings.planned.add().object = object
        expected = plan.record.get("expected")
        settings.expected = "" if expected is None else expected_line(**expected)
        for note in paint(context.evaluated_depsgraph_get(), objects, *coverage):
            self.report({"WARNING"}, note)
        return f"{len(plan.cameras)} cameras planned; expected {settings.expected or 'quality not computed'}"


class CAMSPLAT_OT_score(bpy.types.Operator):
    """Predict what the planned cameras are worth where they stand now"""

    bl_idname = "camsplat.score"
    bl_label = "Score cameras"

    def execute(self, context: bpy.types.Context) -> set[str]:
        settings = context.scene.camsplat
        try:
            cameras = read_cameras(context)
            score = read_request(context, objects_of_plan(context.scene)).score(cameras)
        except (camsplat.Error, OSError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        settings.expected = expected_line(score.db, score.sd, score.unseen, score.against)
        self.report({"INFO"}, f"expected {settings.expected}")
        return {"FINISHED"}


class CAMSPLAT_OT_render(SteppedOperator, bpy.types.Operator):
    """Render every planned camera at the current frame, and write transforms.json, a COLMAP model and points beside the images"""

    bl_idname = "camsplat.render"
    bl_label = "Render capture"

    def steps(self, context: bpy.types.Context) -> Steps:
        scene = context.scene
        objects, cameras = planned_cameras(scene), read_cameras(context)
        # Photos show what is around the objects too; that may be a ground of any size.
        depsgraph, subject = context.evaluated_depsgraph_get(), objects_of_plan(scene)
        surroundings = read_surroundings(depsgraph, subject, limits_of(scene.camsplat))
        parts = [part for part in (read_surface(depsgraph, subject), surroundings) if len(part.faces) > 0]
        points = np.concatenate([sample_points(part, POINTS // len(parts), scene.camsplat.seed) for part in parts])
        files = [f"images/{image_name(name)}" for name in cameras.names]
        folder = output_folder(scene.camsplat.folder)
        with new_folder(folder) as staged, render_settings_kept(scene):
            write_files(staged, cameras, points)
            for done, (camera, file) in enumerate(zip(objects, files)):
                yield "rendering", done, len(objects)
                render(scene, camera, staged / file)
        return f"{len(objects)} views written to {folder}"


def output_folder(setting: str) -> Path:
    """The folder that the setting names."""
    if not setting:
        raise camsplat.Error("no folder is chosen; choose one under Folder")
    if setting.startswith("//") and not bpy.data.filepath:
        raise camsplat.Error(f"folder {setting}: it is relative to the .blend file, which is not saved; save it, or choose another folder")
    return Path(bpy.path.abspath(setting))


def objects_of_plan(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The objects that cameras were planned for."""
    objects = [planned.object for planned in scene.camsplat.planned if planned.object is not None]
    if not objects:
        raise camsplat.Error("the objects that cameras were planned for are gone; press Plan cameras again")
    return objects


def render(scene: bpy.types.Scene, camera: bpy.types.Object, file: Path) -> None:
    """Renders a view into a file."""
    scene.camera, scene.render.filepath = camera, str(file)
    try:
        bpy.ops.render.render(write_still=True, scene=scene.name)
    except RuntimeError as error:
        raise camsplat.Error(f"camera {camera.name}: it was not rendered: {error}".strip()) from error
    if not file.is_file():
        raise camsplat.Error(f"camera {camera.name}: it was not rendered; look at the render settings")


@contextmanager
def render_settings_kept(scene: bpy.types.Scene) -> Iterator[None]:
    """Sets the scene up for stills that are a PNG each, and restores everything at the end."""
    render, image = scene.render, scene.render.image_settings
    format_names = ("file_format", "color_mode", "color_depth", "compression")
    kept: dict[str, Any] = {name: getattr(render, name) for name in (*RENDER_OVERRIDES, "filepath")}
    kept_format = {name: getattr(image, name) for name in format_names}
    camera = scene.camera
    # A marker's camera would be rendered in place of the scene's.
    bound = [(marker, marker.camera) for marker in scene.timeline_markers if marker.camera is not None]
    try:
        for name, value in RENDER_OVERRIDES.items():
            setattr(render, name, value)
        image.file_format, image.color_mode, image.color_depth = "PNG", "RGBA" if render.film_transparent else "RGB", "8"
        for marker, _ in bound:
            marker.camera = None
        yield
    finally:
        for name, value in kept.items():
            setattr(render, name, value)
        for name, value in kept_format.items():
            setattr(image, name, value)
        for marker, marker_camera in bound:
            marker.camera = marker_camera
        scene.camera = camera


def expected_line(db: float, sd: float, unseen: float, against: str, reason: str = "") -> str:
    """Expected quality as the command prints it."""
    # As +0.00, never -0.00.
    better = f"{round(db, 2) + 0.0:+.2f} dB (sd {sd:.2f}) against {against} with as many views"
    line = f"{better}; no camera sees {100 * unseen:.1f}% of what viewers look at"
    return f"{line}; {reason}" if reason else line


CLASSES = (CAMSPLAT_OT_plan, CAMSPLAT_OT_score, CAMSPLAT_OT_render)
