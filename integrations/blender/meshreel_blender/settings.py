"""Settings of an object that plays a file."""

from typing import Any

import bpy

from . import player
from .timeline import End

END_ITEMS = (
    (End.HOLD.value, "Hold", "The first frame stays before, and the last after"),
    (End.LOOP.value, "Loop", "The reel is repeated, before and after"),
)


def _show(settings: "ReelSettings", context: Any) -> None:
    """Update the object after a setting was changed."""
    player.show(settings.id_data, context.scene)


class ReelSettings(bpy.types.PropertyGroup):
    """`Object.meshreel`: an object with a file path plays the file."""

    filepath: bpy.props.StringProperty(
        name="File",
        description="The .reel file that animates this mesh; empty to keep the current shape",
        subtype="FILE_PATH",
        update=_show,
    )
    part: bpy.props.IntProperty(name="Part", description="Part of the file", min=0)
    part_name: bpy.props.StringProperty(
        name="Part Name", description="Name of the part, which finds it in other segments"
    )
    segment: bpy.props.IntProperty(
        name="Segment", description="Segment of the file that the mesh contains", min=0
    )
    fingerprint: bpy.props.StringProperty(
        name="Fingerprint", description="Fingerprint of the faces of that segment"
    )
    start_frame: bpy.props.FloatProperty(
        name="Start Frame",
        description="Scene frame of the first frame of the file",
        default=1.0,
        precision=2,
        step=100,
        update=_show,
    )
    end: bpy.props.EnumProperty(
        name="Outside",
        description="Behavior before the first and after the last frame",
        items=END_ITEMS,
        default=End.HOLD.value,
        update=_show,
    )
    interpolate: bpy.props.BoolProperty(
        name="Interpolate",
        description="Interpolate when the scene is between two frames of the file: at other "
        "frame rates, and for motion blur",
        default=True,
        update=_show,
    )


def register() -> None:
    """Register the settings for all objects."""
    bpy.utils.register_class(ReelSettings)
    bpy.types.Object.meshreel = bpy.props.PointerProperty(type=ReelSettings)


def unregister() -> None:
    """Unregister them."""
    del bpy.types.Object.meshreel
    bpy.utils.unregister_class(ReelSettings)
