"""Merging of several animated meshes and their tracks into one mesh of parts."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.frames.stored_frames import StoredTrack
from meshreel.formats.notes import listed, note_left_out
from meshreel.formats.scenes.merged_surfaces import merge_surfaces
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import Neighbours, neighbours
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import Domain, Surface
from meshreel.model.tracks import TrackKind, TrackSource

BLENDED = (TrackKind.SCALAR, TrackKind.VECTOR, TrackKind.VELOCITY, TrackKind.OTHER)
"""Kinds whose float values are interpolated linearly between frames."""


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


def merge_tracks(
    meshes: Sequence[SceneMesh], places: Sequence[Sequence[Neighbours]], notes: list[str]
) -> dict[str, TrackSource]:
    """Return the tracks of several meshes that are merged into one.

    A track that only some meshes have is NaN in the others; integers become float64 then. Tracks
    whose domain, kind, unit or width differ are left out. Notes report both.

    Parameters
    ----------
    meshes : sequence of SceneMesh
    places : sequence of sequences of Neighbours
        For each merged frame and each mesh, the mesh's frames at or around that time.
    """
    first = [min(row[part].before for row in places) for part in range(len(meshes))]
    last = [max(row[part].after for row in places) for part in range(len(meshes))]
    mesh_tracks = [
        mesh.tracks(range(start, stop + 1))
        for mesh, start, stop in zip(meshes, first, last, strict=True)
    ]
    if not any(mesh_tracks):
        return {}
    shifted = [
        [one.shifted(-start) for one, start in zip(row, first, strict=True)] for row in places
    ]
    sizes = [_sizes(mesh, start) for mesh, start in zip(meshes, first, strict=True)]
    names = dict.fromkeys(name for tracks in mesh_tracks for name in tracks)
    found = {name: _merged(name, mesh_tracks, shifted, sizes, notes) for name in names}
    return {name: track for name, track in found.items() if track is not None}


def _sizes(mesh: SceneMesh, index: int) -> dict[Domain, int]:
    frame = mesh.frame(index)
    counts = len(frame.vertices), len(frame.counts), int(frame.counts.sum())
    return dict(zip(Domain, counts, strict=True))


def _merged(
    name: str,
    mesh_tracks: Sequence[Mapping[str, TrackSource]],
    places: Sequence[Sequence[Neighbours]],
    sizes: Sequence[Mapping[Domain, int]],
    notes: list[str],
) -> StoredTrack | None:
    found = [tracks.get(name) for tracks in mesh_tracks]
    known = [track for track in found if track is not None]
    if len({(one.domain, one.kind, one.unit, one.shape[2]) for one in known}) > 1:
        note_left_out(notes, f"tracks that differ between meshes: {listed([name])}")
        return None
    domain, kind = known[0].domain, known[0].kind
    dtype = np.result_type(*(track.dtype for track in known))
    if len(known) < len(found):
        dtype = dtype if dtype.kind == "f" else np.dtype(np.float64)
        notes.append(
            f"track {name!r} is in {len(known)} of {len(found)} meshes, and NaN in the others"
        )
    is_blended = kind in BLENDED and dtype.kind == "f"
    n_columns = known[0].shape[2]

    def read_part(part: int, place: Neighbours) -> Values:
        track = found[part]
        if track is None:
            return np.full((sizes[part][domain], n_columns), np.nan, dtype)
        before = track.read(place.before, place.before + 1)[0]
        if not is_blended or place.after == place.before:
            values: Values = before.astype(dtype)
            return values
        after = track.read(place.after, place.after + 1)[0]
        blend: Values = (1 - place.share) * before.astype(np.float64) + place.share * after
        return blend.astype(dtype)

    def read_range(start: int, stop: int) -> Values:
        values: Values = np.empty((stop - start, *shape[1:]), dtype)
        for index in range(start, stop):
            parts = [read_part(part, place) for part, place in enumerate(places[index])]
            values[index - start] = np.concatenate(parts)
        return values

    shape = len(places), sum(one[domain] for one in sizes), n_columns
    return StoredTrack(domain, kind, known[0].unit, dtype, shape, read_range)
