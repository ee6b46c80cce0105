"""Plans camera poses for radiance-field captures, and renders them."""

import bpy

from . import operators, panel, settings

CLASSES = (*settings.CLASSES, *operators.CLASSES, *panel.CLASSES)


def register() -> None:
    """Called by Blender when the extension is enabled."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.camsplat = bpy.props.PointerProperty(type=settings.CamsplatSettings)


def unregister() -> None:
    """Called by Blender when the extension is disabled."""
    del bpy.types.Scene.camsplat
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
