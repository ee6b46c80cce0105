"""Intrinsics of Blender's cameras in pixels."""

import math
from typing import NamedTuple

import bpy
import numpy as np
import numpy.typing as npt

import camsplat


class Lens(NamedTuple):
    """Focal lengths and principal point in pixels from the top left corner, and the size of the image."""

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    @property
    def K(self) -> npt.NDArray[np.float64]:
        """(3, 3) intrinsics."""
        return np.array([[self.fx, 0, self.cx], [0, self.fy, self.cy], [0, 0, 1]])

    @property
    def is_centred(self) -> bool:
        """Whether the principal point is the middle of the image."""
        return math.isclose(self.cx, self.width / 2, abs_tol=1e-6) and math.isclose(self.cy, self.height / 2, abs_tol=1e-6)

    @property
    def fov(self) -> float:
        """Horizontal field of view in degrees, of a centred lens."""
        return math.degrees(2 * math.atan2(self.width / 2, self.fx))

    @property
    def square_size(self) -> tuple[int, int]:
        """Size of an image with this field of view, both ways, whose pixels are square."""
        return self.width, max(1, round(self.height * self.fx / self.fy))


def read_lens(camera: bpy.types.Camera, render: bpy.types.RenderSettings) -> Lens:
    """The lens of a camera in the resolution that the scene is rendered in."""
    if camera.type != "PERSP":
        raise camsplat.Error(f"camera {camera.name}: its type is {camera.type.lower()}; choose a perspective camera")
    width = render.resolution_x * render.resolution_percentage // 100
    height = render.resolution_y * render.resolution_percentage // 100
    if width < 1 or height < 1:
        raise camsplat.Error(f"the render resolution is {width} x {height} pixels; raise it or its percentage")
    aspect = render.pixel_aspect_y / render.pixel_aspect_x
    fit = camera.sensor_fit
    if fit == "AUTO":
        fit = "HORIZONTAL" if width * render.pixel_aspect_x >= height * render.pixel_aspect_y else "VERTICAL"
    # As Blender has it, a sensor that fits automatically has its width along the longer side.
    sensor = camera.sensor_height if camera.sensor_fit == "VERTICAL" else camera.sensor_width
    fitted = width if fit == "HORIZONTAL" else height * aspect  # pixels, as wide as pixels are
    focal = camera.lens / sensor * fitted
    cx, cy = width / 2 - camera.shift_x * fitted, height / 2 + camera.shift_y * fitted / aspect
    return Lens(focal, focal / aspect, cx, cy, width, height)


def planning_lens(scene: bpy.types.Scene) -> tuple[bpy.types.Camera | None, Lens]:
    """The camera whose lens to plan for (the chosen one, else the scene's, else none, which stands for a new one), and its lens."""
    camera = scene.camsplat.lens
    if camera is None and scene.camera is not None:
        if scene.camera.type != "CAMERA":
            raise camsplat.Error(f"{scene.camera.name}: it is no camera and has no lens; choose a camera under Lens")
        camera = scene.camera.data
    if camera is None:
        default = bpy.data.cameras.new("camsplat")
        try:
            return None, read_lens(default, scene.render)
        finally:
            bpy.data.cameras.remove(default)
    lens = read_lens(camera, scene.render)
    if not lens.is_centred:
        raise camsplat.Error(f"camera {camera.name}: its lens is shifted, and planned cameras are not; set Shift X and Y to 0")
    return camera, lens
