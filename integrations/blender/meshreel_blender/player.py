"""Objects that follow a reel: each frame is decoded when the scene comes to it."""

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
"""Why an object does not play, by its full name."""


def problem(obj: Any) -> str:
    """Why an object does not play its reel; empty if it does."""
    return _problems.get(obj.name_full, "")


def reel_path(obj: Any) -> Path:
    """The file that an object plays, where a path with // begins at the .blend file."""
    absolute = bpy.path.abspath(obj.meshreel.filepath, library=obj.library)
    return Path(bpy.path.native_pathsep(absolute))


def reel_of(obj: Any) -> OpenReel:
    """The reel that an object plays.

    Raises
    ------
    UnplayableError
        If it is missing, unreadable, or another than the object's mesh was made from.
    """
    opened = open_reel(reel_path(obj))
    if opened.fingerprint != obj.meshreel.fingerprint or obj.meshreel.part >= len(opened.parts):
        raise UnplayableError(
            f"{reel_path(obj)} has other faces than when {obj.name} was imported; import it again"
        )
    return opened


def show(obj: Any, scene: Any) -> None:
    """Give an object the shape that its reel has at the scene's frame.

    Where that cannot be, its shape stays, and `problem` says why.
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
        raise UnplayableError(f"{obj.name} has shape keys, which hide its reel; remove them")
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
    """Give every object that plays a reel its shape at the scene's frame."""
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
    """Follow the timeline from now on, whatever file is opened."""
    bpy.app.handlers.frame_change_pre.append(_on_frame_change)
    bpy.app.handlers.load_post.append(_on_load)


def unregister() -> None:
    """Follow no more, and close all files."""
    bpy.app.handlers.frame_change_pre.remove(_on_frame_change)
    bpy.app.handlers.load_post.remove(_on_load)
    release_all()
