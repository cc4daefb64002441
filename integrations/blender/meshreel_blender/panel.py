"""The panel of an object that plays a reel."""

from typing import Any

import bpy

from . import player
from .open_reels import UnplayableError


class ReelPanel(bpy.types.Panel):
    """Object properties > Meshreel: the file that is played, its settings, and its problems."""

    bl_idname = "OBJECT_PT_meshreel"
    bl_label = "Meshreel"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether the object was made by importing a reel."""
        return bool(context.object and context.object.meshreel.fingerprint)

    def draw(self, context: Any) -> None:
        """Draw the settings, and a line on the file."""
        layout, obj = self.layout, context.object
        layout.use_property_split = True
        for name in ("filepath", "start_frame", "end", "interpolate"):
            layout.prop(obj.meshreel, name)
        if obj.meshreel.filepath:
            is_error, text = description(obj)
            layout.label(text=text, icon="ERROR" if is_error else "INFO")


def description(obj: Any) -> tuple[bool, str]:
    """Whether an object cannot play, and why, or else the contents of its reel."""
    if player.problem(obj):
        return True, player.problem(obj)
    try:
        reel = player.reel_of(obj).reel
    except UnplayableError as error:
        return True, str(error)
    rate = f"{reel.fps:g} fps" if reel.fps else "one per scene frame"
    cut = "" if reel.is_whole else "; the end of the file is missing"
    return False, f"{reel.n_frames} frames, {rate}, {reel.n_verts} vertices{cut}"


def register() -> None:
    """Add the panel."""
    bpy.utils.register_class(ReelPanel)


def unregister() -> None:
    """Take it away."""
    bpy.utils.unregister_class(ReelPanel)
