"""Panel of an object that plays a file."""

from typing import Any

import bpy

from . import player
from .open_reels import UnplayableError


class ReelPanel(bpy.types.Panel):
    """Object properties > Meshreel: the file, playback settings, and errors."""

    bl_idname = "OBJECT_PT_meshreel"
    bl_label = "Meshreel"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether the object was created by an import."""
        return bool(context.object and context.object.meshreel.fingerprint)

    def draw(self, context: Any) -> None:
        """Draw the settings and the status of the file."""
        layout, obj = self.layout, context.object
        layout.use_property_split = True
        for name in ("filepath", "start_frame", "end", "interpolate"):
            layout.prop(obj.meshreel, name)
        if obj.meshreel.filepath:
            is_error, text = description(obj)
            layout.label(text=text, icon="ERROR" if is_error else "INFO")


def description(obj: Any) -> tuple[bool, str]:
    """Status of an object: why it cannot play, or the contents of its file."""
    if player.problem(obj):
        return True, player.problem(obj)
    try:
        reel = player.reel_of(obj).reel
    except UnplayableError as error:
        return True, str(error)
    rate = f"{reel.fps:g} fps" if reel.fps else "one per scene frame"
    if reel.timing.uneven_times is not None:
        rate = f"uneven, {rate} on average"
    cut = "" if reel.is_whole else "; the end of the file is missing"
    segments = f" in {reel.n_segments} segments" if reel.n_segments > 1 else ""
    n_verts = reel.segments[obj.meshreel.segment].n_verts
    return False, f"{reel.n_frames} frames{segments}, {rate}, {n_verts} vertices{cut}"


def register() -> None:
    """Register the panel."""
    bpy.utils.register_class(ReelPanel)


def unregister() -> None:
    """Unregister it."""
    bpy.utils.unregister_class(ReelPanel)
