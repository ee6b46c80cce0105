"""The panel in the sidebar of the 3D viewport."""

import bpy


class CAMSPLAT_PT_panel(bpy.types.Panel):
    """Settings, operators and the expected quality"""

    bl_idname = "CAMSPLAT_PT_panel"
    bl_label = "camsplat"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "camsplat"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.camsplat
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "source")
        if settings.source == "COLLECTION":
            layout.prop(settings, "collection")
        for name in ("preset", "views", "lens", "seed"):
            layout.prop(settings, name)
        layout.operator("camsplat.plan", icon="OUTLINER_OB_CAMERA")
        layout.prop(settings, "cameras")
        layout.operator("camsplat.score")
        if settings.expected:
            column = layout.column(align=True)
            for part in settings.expected.split("; "):
                column.label(text=part)
        layout.prop(settings, "folder")
        layout.operator("camsplat.render", icon="RENDER_STILL")


class CAMSPLAT_PT_limits(bpy.types.Panel):
    """Where cameras may stand"""

    bl_idname = "CAMSPLAT_PT_limits"
    bl_label = "Where cameras may stand"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "camsplat"
    bl_parent_id = "CAMSPLAT_PT_panel"

    def draw(self, context: bpy.types.Context) -> None:
        settings = context.scene.camsplat
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "floor")
        if settings.floor == "HEIGHT":
            layout.prop(settings, "floor_height")
        for use, name in (("use_heights", "heights"), ("use_clearance", "clearance")):
            layout.prop(settings, use)
            if getattr(settings, use):
                layout.prop(settings, name, text="")
        for name in ("walls", "keep_out", "box"):
            layout.prop(settings, name)


CLASSES = (CAMSPLAT_PT_panel, CAMSPLAT_PT_limits)
