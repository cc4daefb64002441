"""Import a `.reel` file: create objects that play it."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import bpy

from .axes import rotation_from_file
from .mesh_building import new_mesh, object_name
from .open_reels import OpenReel, open_reel
from .timeline import last_scene_frame, rate_numbers, scene_frames_per_reel_frame, scene_rate


@dataclass(frozen=True)
class Imported:
    """Result of an import.

    Attributes
    ----------
    objects : list of bpy.types.Object
        One per part of the file; a part that only some segments have is empty in the others.
    notes : list of str
        A sentence for each part that Blender cannot represent.
    """

    objects: list[Any] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def import_reel(
    path: Path,
    scene: Any,
    collection: Any,
    *,
    stored_path: str,
    up: str,
    scale: float,
    set_rate: bool,
    set_range: bool,
) -> Imported:
    """Create objects that play a file, and link them to a collection.

    Parameters
    ----------
    path : Path
    scene : bpy.types.Scene
    collection : bpy.types.Collection
    stored_path : str
        The path as objects keep it: absolute, or with // from the .blend file.
    up : {"Y", "Z"}
        Up axis of the file.
    scale : float
        Scale of the objects.
    set_rate, set_range : bool
        Whether to set the frame rate and the frame range of the scene to those of the file.

    Raises
    ------
    UnplayableError
        If the file cannot be read.
    MeshReelError
        If its first frame, or the mesh of a segment, is damaged.
    """
    opened = open_reel(path)
    part_names, first = opened.part_names(), opened.shown(0.0)
    if set_rate and opened.reel.fps:
        scene.render.fps, scene.render.fps_base = rate_numbers(opened.reel.fps)
    start_frame = _start_frame(scene, opened)
    if set_range:
        _set_range(scene, opened, start_frame)
    imported = Imported()
    for number, name in enumerate(part_names):
        mesh = new_mesh(name, opened.mesh(0).parts.get(name), first.positions, imported.notes)
        obj = bpy.data.objects.new(object_name(name), mesh)
        obj.rotation_euler = rotation_from_file(up)
        obj.scale = (scale, scale, scale)
        collection.objects.link(obj)
        _attach(obj, opened, number, name, start_frame, stored_path)
        imported.objects.append(obj)
    return imported


def _start_frame(scene: Any, opened: OpenReel) -> float:
    """Scene frame of the first frame of the file, where second 0 is frame 0."""
    rate = scene_rate(scene.render.fps, scene.render.fps_base)
    return round(opened.reel.start_s * rate, 4)


def _set_range(scene: Any, opened: OpenReel, start_frame: float) -> None:
    rate = scene_rate(scene.render.fps, scene.render.fps_base)
    duration = scene_frames_per_reel_frame(rate, opened.reel.fps)
    scene.frame_start = round(start_frame)
    scene.frame_end = last_scene_frame(start_frame, duration, opened.reel.n_frames)


def _attach(
    obj: Any, opened: OpenReel, part: int, part_name: str, start_frame: float, stored_path: str
) -> None:
    settings = obj.meshreel
    settings.part, settings.part_name = part, part_name
    settings.segment, settings.fingerprint = 0, opened.mesh(0).fingerprint
    settings.start_frame = start_frame
    settings.filepath = stored_path  # last: this starts playback
