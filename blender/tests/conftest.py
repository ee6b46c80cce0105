"""Loads the extension as Blender does, beside the package `camsplat` that it uses, and makes scenes for it."""

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

bpy = pytest.importorskip("bpy", reason="skipped: Blender's module bpy is not installed (pip install bpy)")
pytest.importorskip("camsplat", reason="skipped: camsplat is not installed")

EXTENSION = Path(__file__).resolve().parent.parent / "extension"


@pytest.fixture(scope="session")
def extension() -> Iterator[ModuleType]:
    """The extension, enabled."""
    name = "camsplat_extension"
    spec = importlib.util.spec_from_file_location(name, EXTENSION / "__init__.py", submodule_search_locations=[str(EXTENSION)])
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    module.register()
    yield module
    module.unregister()


@pytest.fixture
def scene(extension: ModuleType) -> "bpy.types.Scene":
    """An empty scene that renders 64 x 48 pixels with Cycles, and plans few views."""
    return empty_scene()


@pytest.fixture(scope="session")
def planned_file(extension: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A .blend file with a sphere at (2, 0, 0), its mesh `sphere`, and six planned cameras above a floor."""
    file = tmp_path_factory.mktemp("planned") / "planned.blend"
    from scenes import add_sphere  # needs bpy

    settings = empty_scene().camsplat
    add_sphere("sphere", location=(2, 0, 0))
    settings.floor, settings.floor_height, settings.folder = "HEIGHT", -0.5, "//capture"
    bpy.ops.camsplat.plan()
    bpy.ops.wm.save_as_mainfile(filepath=str(file))
    return file


@pytest.fixture
def planned(planned_file: Path, tmp_path: Path) -> "bpy.types.Scene":
    """The scene of `planned_file`, saved in a folder of its own."""
    bpy.ops.wm.open_mainfile(filepath=str(planned_file))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "planned.blend"))
    return bpy.context.scene


def empty_scene() -> "bpy.types.Scene":
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.use_denoising = "CPU", 16, False
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.view_settings.view_transform = "Standard"
    scene.camsplat.views = 6
    return scene
