"""Meshes that a file hides: always, or in some frames, so that others are shown in turn."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from itertools import chain
from operator import add

import numpy as np

from meshreel.formats.scenes.merging import merge_meshes
from meshreel.formats.scenes.scene_mesh import SceneMesh, Visibility
from meshreel.formats.scenes.timing import unite_times
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.notes import NoteKind, Notes
from meshreel.model.surface import Surface
from meshreel.model.surface_selection import differing_names
from meshreel.model.tracks import TrackSource, error_bound_of
from meshreel.runtime.counting import counted


def without_hidden(meshes: Sequence[SceneMesh], notes: Notes) -> list[SceneMesh]:
    """Return the meshes that are shown at some time; all if none is. Notes name the others."""
    hidden = [mesh for mesh in meshes if not mesh.visibility.is_shown.any()]
    if not hidden:
        return [*meshes]
    if len(hidden) == len(meshes):
        notes.changed("all meshes are hidden; read as if they were visible")
        return hidden
    reasons = (mesh.visibility.reason for mesh in hidden)
    labels = (f" ({reason})" if reason else "" for reason in reasons)
    notes.left_out("hidden meshes", map(add, (mesh.name for mesh in hidden), labels))
    return [mesh for mesh in meshes if mesh.visibility.is_shown.any()]


def note_changes(meshes: Sequence[SceneMesh], notes: Notes) -> None:
    """Note the meshes that are hidden only at some times, and are read as if always visible."""
    names = (mesh.name for mesh in meshes if _changes(mesh.visibility))
    notes.left_out("changes of visibility", names)


def _changes(visibility: Visibility) -> bool:
    return bool(visibility.is_shown.any() and not visibility.is_shown.all())


def meshes_in_turn(
    meshes: Sequence[SceneMesh], name: str, notes: Notes, *, merges: bool
) -> SceneMesh | None:
    """Return a mesh of which each frame consists of the meshes that are visible then.

    Frames before the first and after the last mesh may be empty, and are left out.

    Parameters
    ----------
    name : str
        Name of the result, unless a single mesh is visible in its first frame.
    notes : Notes
        Gains a sentence if visibility changes in another way, or frames are left out.
    merges : bool
        Whether a mesh may be visible together with several groups of others.

    Returns
    -------
    SceneMesh, or None if the same meshes are visible in all frames, none are in one of them, or
    a mesh is in several groups and may not be.
    """
    visibilities = [mesh.visibility for mesh in meshes]
    if not any(map(_changes, visibilities)):
        return None
    mesh_times = [mesh.times_s for mesh in meshes]
    times_s = unite_times([*mesh_times, *(visibility.times_s for visibility in visibilities)])
    is_shown = np.stack([visibility.at(times_s) for visibility in visibilities], axis=1)
    frames = np.flatnonzero(is_shown.any(axis=1))
    rows = is_shown[frames[0] : frames[-1] + 1] if len(frames) else is_shown[:0]
    groups = [tuple(np.flatnonzero(row).tolist()) for row in rows]
    distinct = dict.fromkeys(groups)
    members = list(chain.from_iterable(distinct))
    is_shared = len(set(members)) < len(members)
    if len(distinct) < 2 or () in distinct or (is_shared and not merges):
        note_changes(meshes, notes)
        return None
    if n_empty := len(times_s) - len(groups):
        notes.left_out(f"{counted(n_empty, 'frame')} without a mesh")
    names = (meshes[number].name for number in dict.fromkeys(members))
    notes.list_names(NoteKind.CHANGED, "visible in turn, read as one sequence", names)
    frame_times_s = times_s[frames[0] : frames[-1] + 1]
    parts = {
        group: merge_meshes([meshes[number] for number in group], name, notes, frame_times_s)
        for group in distinct
    }
    if len(groups[0]) == 1:
        name = meshes[groups[0][0]].name
    rates = {mesh.fps for mesh in meshes if mesh.fps and len(mesh.times_s) > 1}

    @lru_cache(maxsize=2)
    def surface(index: int) -> Surface:
        return parts[groups[index]].surface(index)

    def tracks(run: range) -> Mapping[str, TrackSource]:
        return parts[groups[run.start]].tracks(run)

    def frame(index: int) -> PolygonMesh:
        return parts[groups[index]].frame(index)

    def keeps_surface(index: int) -> bool:
        if groups[index] == groups[index - 1]:
            return True
        if tracks(range(index - 1, index)) or tracks(range(index, index + 1)):
            return False
        before, after = surface(index - 1), surface(index)
        looks = [(each.parts, each.images) for each in (before, after)]
        return looks[0] == looks[1] and not differing_names(before, after)

    def note_unread() -> None:
        for note in dict.fromkeys(part.note_unread for part in parts.values()):
            note()

    return SceneMesh(
        name, frame_times_s, frame, surface, rates.pop() if len(rates) == 1 else None, tracks,
        keeps_surface=keeps_surface, note_unread=note_unread, error_bound=error_bound_of(*meshes),
    )  # fmt: skip
