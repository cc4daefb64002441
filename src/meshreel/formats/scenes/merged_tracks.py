"""Merging of the tracks of several meshes."""

from collections.abc import Mapping, Sequence

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.stored_tracks import StoredTrack
from meshreel.formats.notes import listed, note_left_out
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import Neighbours
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, TrackSource

BLENDED = (TrackKind.SCALAR, TrackKind.VECTOR, TrackKind.VELOCITY, TrackKind.OTHER)
"""Kinds whose float values are interpolated linearly between frames."""


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
