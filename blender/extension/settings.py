"""What the panel shows and operators read, stored with the scene."""

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)


class CamsplatPlanned(bpy.types.PropertyGroup):
    """An object that cameras were planned for."""

    object: PointerProperty(type=bpy.types.Object)


class CamsplatSettings(bpy.types.PropertyGroup):
    """Settings of camsplat in a scene, and what came of them."""

    source: EnumProperty(
        name="Plan for",
        description="What the cameras are to photograph",
        items=[
            ("SELECTED", "Selected", "The selected objects, with what they instance"),
            ("COLLECTION", "Collection", "All objects of a collection, with what they instance"),
        ],
    )
    collection: PointerProperty(name="Collection", description="Objects to plan for", type=bpy.types.Collection)
    preset: EnumProperty(
        name="Preset",
        description="Where the cameras stand",
        items=[("object", "Object", "Around an object, looking at it"), ("room", "Room", "Inside of a room")],
    )
    views: IntProperty(name="Views", description="Number of cameras to place", default=50, min=1)
    seed: IntProperty(name="Seed", description="Seed of every random number", min=0)
    lens: PointerProperty(
        name="Lens",
        description="Camera data whose lens the planned cameras get; where there is none here, that of the scene's camera. "
        "The resolution is the scene's",
        type=bpy.types.Camera,
    )
    floor: EnumProperty(
        name="Floor",
        description="Lowest height of cameras and viewers",
        items=[
            ("auto", "Automatic", "As camsplat finds it; meshes have none"),
            ("none", "None", "Cameras may be at any height"),
            ("HEIGHT", "Height", "Cameras stay at or above a height"),
        ],
    )
    floor_height: FloatProperty(name="Floor height", description="World Z of the floor", unit="LENGTH")
    use_heights: BoolProperty(name="Heights", description="Restrict cameras to heights that a tripod or drone reaches")
    heights: FloatVectorProperty(
        name="Heights", description="Lowest and highest world Z of a camera", size=2, default=(0.4, 2.0), unit="LENGTH"
    )
    use_clearance: BoolProperty(name="Clearance", description="Set how near to the surface a camera may be")
    clearance: FloatProperty(
        name="Clearance", description="Minimum distance between cameras and the surface", default=0.1, min=0.0, unit="LENGTH"
    )
    walls: PointerProperty(
        name="Walls",
        description="Collection of planes or empties whose local +Z points to the side where cameras may stand",
        type=bpy.types.Collection,
    )
    keep_out: PointerProperty(
        name="Keep out", description="Collection of closed meshes that no camera enters; they block no view", type=bpy.types.Collection
    )
    box: PointerProperty(
        name="Box", description="Object in whose bounding box, along the world's axes, cameras stay", type=bpy.types.Object
    )
    folder: StringProperty(
        name="Folder",
        description="Folder of the rendered capture; it must be empty or not exist yet",
        default="//capture",
        subtype="DIR_PATH",
    )
    cameras: PointerProperty(
        name="Cameras",
        description="Collection of cameras to score and render; planning again replaces those that were planned",
        type=bpy.types.Collection,
    )
    planned: CollectionProperty(type=CamsplatPlanned)
    expected: StringProperty(name="Expected quality", description="Predicted PSNR of splats trained on the views")


CLASSES = (CamsplatPlanned, CamsplatSettings)
