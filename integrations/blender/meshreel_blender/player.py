"""Playback: decodes a frame when the timeline reaches it."""

import logging
from pathlib import Path
from typing import Any

import bpy
from bpy.app.handlers import persistent

from meshreel.errors import MeshReelError

from .mesh_building import write_positions
from .open_reels import OpenReel, UnplayableError, open_reel, release_all
from .timeline import reel_position, scene_frames_per_reel_frame, scene_rate

logger = logging.getLogger(__name__)

_problems: dict[str, str] = {}
"""Reasons why objects do not play, by full name."""


def problem(obj: Any) -> str:
    """Reason why an object does not play; empty if it does."""
    return _problems.get(obj.name_full, "")


def reel_path(obj: Any) -> Path:
    """Absolute path of the file of an object; // is the folder of the .blend file."""
    absolute = bpy.path.abspath(obj.meshreel.filepath, library=obj.library)
    return Path(bpy.path.native_pathsep(absolute))


def reel_of(obj: Any) -> OpenReel:
    """Return the open file of an object.

    Raises
    ------
    UnplayableError
        If it is missing, unreadable, or differs from the one that was imported.
    """
    opened = open_reel(reel_path(obj))
    if opened.fingerprint != obj.meshreel.fingerprint or obj.meshreel.part >= len(opened.parts):
        raise UnplayableError(
            f"{reel_path(obj)} has other faces than when {obj.name} was imported; import it again"
        )
    return opened


def show(obj: Any, scene: Any) -> None:
    """Update the shape of an object to the current frame.

    If that fails, the shape does not change, and `problem` returns the reason.
    """
    if not obj.meshreel.filepath or obj.type != "MESH" or obj.data.is_editmode:
        return
    try:
        _write_positions(obj, scene)
        found = ""
    except (UnplayableError, MeshReelError, OSError) as error:
        found = str(error)
    if found and found != problem(obj):
        logger.warning("%s does not play: %s", obj.name, found)
    _problems[obj.name_full] = found


def _write_positions(obj: Any, scene: Any) -> None:
    settings, mesh, opened = obj.meshreel, obj.data, reel_of(obj)
    verts = opened.parts[settings.part].verts
    n_verts = verts.stop - verts.start
    if len(mesh.vertices) != n_verts:
        raise UnplayableError(
            f"{obj.name} has {len(mesh.vertices)} vertices and its reel {n_verts}; undo what "
            "changed the mesh, or import the reel again"
        )
    if mesh.shape_keys:
        raise UnplayableError(f"{obj.name} has shape keys, which override its file; remove them")
    duration = scene_frames_per_reel_frame(
        scene_rate(scene.render.fps, scene.render.fps_base), opened.reel.fps
    )
    position = reel_position(
        scene.frame_current_final, settings.start_frame, duration, opened.reel.n_frames,
        settings.end,
    )  # fmt: skip
    positions = opened.positions(position if settings.interpolate else float(int(position)))
    write_positions(mesh, positions[verts])


def show_all(scene: Any) -> None:
    """Update all objects that play a file to the current frame."""
    for obj in bpy.data.objects:
        if obj.type == "MESH" and obj.meshreel.filepath:
            show(obj, scene)


@persistent
def _on_frame_change(scene: Any, depsgraph: Any = None) -> None:
    show_all(scene)


@persistent
def _on_load(*_: Any) -> None:
    _problems.clear()
    release_all()
    show_all(bpy.context.scene)


def register() -> None:
    """Register the handlers; they persist when another .blend file is opened."""
    bpy.app.handlers.frame_change_pre.append(_on_frame_change)
    bpy.app.handlers.load_post.append(_on_load)


def unregister() -> None:
    """Unregister the handlers and close all files."""
    bpy.app.handlers.frame_change_pre.remove(_on_frame_change)
    bpy.app.handlers.load_post.remove(_on_load)
    release_all()
