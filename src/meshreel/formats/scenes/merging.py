"""Merging of several animated meshes into one mesh of parts."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.scenes.merged_surfaces import merge_surfaces
from meshreel.formats.scenes.merged_tracks import merge_tracks
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import neighbours
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import Surface
from meshreel.model.tracks import TrackSource


def merge_meshes(meshes: Sequence[SceneMesh], name: str, notes: list[str]) -> SceneMesh:
    """Merge meshes into one whose parts have their names.

    Its frames are at all times of the moving meshes. A mesh without a frame at such a time is
    interpolated linearly between its neighboring frames, and held before its first and after its
    last one; so are its float tracks.

    Parameters
    ----------
    meshes : sequence of SceneMesh
    name : str
        Name of the merged mesh.
    notes : list of str
        Receives a sentence for each attribute that only some of the meshes have.
    """
    times = unite_times([mesh.times_s for mesh in meshes])

    def frame(index: int) -> PolygonMesh:
        return _concatenate([_at(mesh, times[index]) for mesh in meshes])

    def surface(index: int) -> Surface:
        numbers = [int(np.searchsorted(mesh.times_s, times[index], "right")) - 1 for mesh in meshes]
        numbers = [max(0, number) for number in numbers]
        frames = [mesh.frame(number) for mesh, number in zip(meshes, numbers, strict=True)]
        surfaces = [mesh.surface(number) for mesh, number in zip(meshes, numbers, strict=True)]
        return merge_surfaces([mesh.name for mesh in meshes], surfaces, frames, notes)

    def tracks(frames: range) -> Mapping[str, TrackSource]:
        places = [[neighbours(mesh.times_s, times[index]) for mesh in meshes] for index in frames]
        return merge_tracks(meshes, places, notes)

    rates = {mesh.fps for mesh in meshes if mesh.fps}
    fps = rates.pop() if len(rates) == 1 else None
    return SceneMesh(name, times, frame, surface, fps, tracks)


def unite_times(times: Sequence[npt.NDArray[np.float64]]) -> npt.NDArray[np.float64]:
    """Return the union of ascending times; those of static meshes are ignored if any moves.

    Times that differ by less than a thousandth of the shortest interval are merged.
    """
    moving = [one for one in times if len(one) > 1]
    if not moving:
        return np.asarray(times[0][:1], np.float64)
    all_times = np.sort(np.concatenate(moving))
    least = min(float(np.diff(one).min()) for one in moving) / 1000
    distinct: npt.NDArray[np.float64] = all_times[np.diff(all_times, prepend=-np.inf) > least]
    return distinct


def _at(mesh: SceneMesh, time_s: float) -> PolygonMesh:
    place = neighbours(mesh.times_s, time_s)
    first = mesh.frame(place.before)
    if place.after == place.before:
        return first
    second = mesh.frame(place.after)
    if second.difference(first):
        return first
    blend = (1 - place.share) * first.vertices.astype(np.float64) + place.share * second.vertices
    vertices: Any = blend.astype(first.vertices.dtype)
    return PolygonMesh(vertices, first.counts, first.corners)


def _concatenate(frames: Sequence[PolygonMesh]) -> PolygonMesh:
    starts = np.cumsum([0] + [len(frame.vertices) for frame in frames])
    corners = [frame.corners + start for frame, start in zip(frames, starts, strict=False)]
    return PolygonMesh(
        np.concatenate([frame.vertices for frame in frames]),
        np.concatenate([frame.counts for frame in frames]),
        np.concatenate(corners).astype(np.int32),
    )
