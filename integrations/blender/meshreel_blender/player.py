"""Playback: decodes a frame when the timeline reaches it."""

import logging
from pathlib import Path
from typing import Any

import bpy
from bpy.app.handlers import persistent

from meshreel.errors import MeshReelError
from meshreel.formats.scenes.parts import PartMesh

from .mesh_building import fill_mesh, write_positions
from .open_reels import OpenReel, SegmentMesh, UnplayableError, open_reel, release_all
from .timeline import reel_position, scene_frames_per_reel_frame, scene_rate, uneven_position

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
        If it is missing, unreadable, or the mesh is not that of its segment.
    """
    opened, settings = open_reel(reel_path(obj)), obj.meshreel
    is_there = settings.segment < opened.reel.n_segments
    if not is_there or opened.mesh(settings.segment).fingerprint != settings.fingerprint:
        raise UnplayableError(
            f"{reel_path(obj)} has other faces than when {obj.name} was imported; import it again"
        )
    return opened


def _part_of(obj: Any, mesh: SegmentMesh) -> PartMesh | None:
    """Return the part of an object in a segment; None if the segment does not have it."""
    number: int = obj.meshreel.part
    name: str = obj.meshreel.part_name
    if not name:  # imported before files had segments
        return [*mesh.parts.values()][number]
    return mesh.parts.get(name)


def show(obj: Any, scene: Any) -> None:
    """Update the shape of an object to the current frame.

    If that fails, the shape does not change, and `problem` returns the reason.
    """
    if not obj.meshreel.filepath or obj.type != "MESH" or obj.data.is_editmode:
        return
    try:
        _update_mesh(obj, scene)
        found = ""
    except (UnplayableError, MeshReelError, OSError) as error:
        found = str(error)
    if found and found != problem(obj):
        logger.warning("%s does not play: %s", obj.name, found)
    _problems[obj.name_full] = found


def _update_mesh(obj: Any, scene: Any) -> None:
    settings, mesh, opened = obj.meshreel, obj.data, reel_of(obj)
    part = _part_of(obj, opened.mesh(settings.segment))
    n_verts = part.verts.stop - part.verts.start if part else 0
    if len(mesh.vertices) != n_verts:
        raise UnplayableError(
            f"{obj.name} has {len(mesh.vertices)} vertices and its reel {n_verts}; undo what "
            "changed the mesh, or import the reel again"
        )
    if mesh.shape_keys:
        raise UnplayableError(f"{obj.name} has shape keys, which override its file; remove them")
    rate = scene_rate(scene.render.fps, scene.render.fps_base)
    scene_frame, start_frame, end = scene.frame_current_final, settings.start_frame, settings.end
    if opened.uneven_times is not None:
        position = uneven_position((scene_frame - start_frame) / rate, opened.uneven_times, end)
    else:
        duration = scene_frames_per_reel_frame(rate, opened.reel.fps)
        position = reel_position(scene_frame, start_frame, duration, opened.reel.n_frames, end)
    shown = opened.shown(position if settings.interpolate else float(int(position)))
    if shown.segment == settings.segment:
        if part:
            write_positions(mesh, shown.positions[part.verts])
        return
    segment_mesh = opened.mesh(shown.segment)
    notes: list[str] = []
    fill_mesh(mesh, _part_of(obj, segment_mesh), shown.positions, notes)
    settings.segment, settings.fingerprint = shown.segment, segment_mesh.fingerprint
    for note in notes:
        logger.info("segment %d: %s", shown.segment, note)


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
