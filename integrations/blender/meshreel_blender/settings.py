"""Settings of an object that plays a reel."""

from typing import Any

import bpy

from . import player
from .timeline import End

END_ITEMS = (
    (End.HOLD.value, "Hold", "The first frame stays before, and the last after"),
    (End.LOOP.value, "Loop", "The reel is repeated, before and after"),
)


def _show(settings: "ReelSettings", context: Any) -> None:
    """Show the frame of now, after a setting was changed."""
    player.show(settings.id_data, context.scene)


class ReelSettings(bpy.types.PropertyGroup):
    """`Object.meshreel`: an object that has a file plays it."""

    filepath: bpy.props.StringProperty(
        name="File",
        description="The .reel file that gives this mesh its shape; none to keep the shape",
        subtype="FILE_PATH",
        update=_show,
    )
    part: bpy.props.IntProperty(name="Part", description="Its part of the reel", min=0)
    fingerprint: bpy.props.StringProperty(
        name="Fingerprint", description="Of the faces that the reel had when it was imported"
    )
    start_frame: bpy.props.FloatProperty(
        name="Start Frame",
        description="Scene frame that shows the first frame of the reel",
        default=1.0,
        precision=2,
        step=100,
        update=_show,
    )
    end: bpy.props.EnumProperty(
        name="Outside",
        description="What is shown before the first and after the last frame",
        items=END_ITEMS,
        default=End.HOLD.value,
        update=_show,
    )
    interpolate: bpy.props.BoolProperty(
        name="Interpolate",
        description="Blend two frames of the reel where the scene is between them: at other "
        "frame rates, and for motion blur",
        default=True,
        update=_show,
    )


def register() -> None:
    """Give every object these settings."""
    bpy.utils.register_class(ReelSettings)
    bpy.types.Object.meshreel = bpy.props.PointerProperty(type=ReelSettings)


def unregister() -> None:
    """Take them away."""
    del bpy.types.Object.meshreel
    bpy.utils.unregister_class(ReelSettings)
