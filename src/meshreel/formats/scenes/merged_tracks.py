"""The tracks of several meshes as those of one."""

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
"""Kinds whose values between two frames are on a straight line, if they are floats."""


def merged_tracks(
    meshes: Sequence[SceneMesh], places: Sequence[Sequence[Neighbours]], notes: list[str]
) -> dict[str, TrackSource]:
    """The tracks of meshes that are one, each of whose frames is at a place among their own.

    A track that only some of the meshes have is NaN in the others, and of float64 if its numbers
    are whole; one that they do not have alike is left out. The notes say so.

    Parameters
    ----------
    meshes : sequence of SceneMesh
    places : sequence of sequences of Neighbours
        Of each frame of the whole, the frames of each mesh that it is at or between.
    """
    first = [min(row[part].before for row in places) for part in range(len(meshes))]
    last = [max(row[part].after for row in places) for part in range(len(meshes))]
    own = [
        mesh.tracks(range(start, stop + 1))
        for mesh, start, stop in zip(meshes, first, last, strict=True)
    ]
    if not any(own):
        return {}
    shifted = [
        [one.shifted(-start) for one, start in zip(row, first, strict=True)] for row in places
    ]
    sizes = [_sizes(mesh, start) for mesh, start in zip(meshes, first, strict=True)]
    names = dict.fromkeys(name for tracks in own for name in tracks)
    found = {name: _merged(name, own, shifted, sizes, notes) for name in names}
    return {name: track for name, track in found.items() if track is not None}


def _sizes(mesh: SceneMesh, index: int) -> dict[Domain, int]:
    frame = mesh.frame(index)
    counts = len(frame.vertices), len(frame.counts), int(frame.counts.sum())
    return dict(zip(Domain, counts, strict=True))


def _merged(
    name: str,
    own: Sequence[Mapping[str, TrackSource]],
    places: Sequence[Sequence[Neighbours]],
    sizes: Sequence[Mapping[Domain, int]],
    notes: list[str],
) -> StoredTrack | None:
    found = [tracks.get(name) for tracks in own]
    known = [track for track in found if track is not None]
    if len({(one.domain, one.kind, one.unit, one.shape[2]) for one in known}) > 1:
        note_left_out(notes, f"tracks that not all meshes have alike: {listed([name])}")
        return None
    domain, kind = known[0].domain, known[0].kind
    dtype = np.result_type(*(track.dtype for track in known))
    if len(known) < len(found):
        dtype = dtype if dtype.kind == "f" else np.dtype(np.float64)
        notes.append(
            f"track {name!r} is of {len(known)} of {len(found)} meshes, and NaN in the others"
        )
    is_blended = kind in BLENDED and dtype.kind == "f"
    n_columns = known[0].shape[2]

    def part_of(part: int, place: Neighbours) -> Values:
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
            parts = [part_of(part, place) for part, place in enumerate(places[index])]
            values[index - start] = np.concatenate(parts)
        return values

    shape = len(places), sum(one[domain] for one in sizes), n_columns
    return StoredTrack(domain, kind, known[0].unit, dtype, shape, read_range)
