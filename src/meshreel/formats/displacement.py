"""Displacement of positions by a vector result, for files with undeformed geometry."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from meshreel.errors import InvalidInputError, Keyword, Message
from meshreel.formats.frames.stored_frames import Description
from meshreel.model.notes import Notes
from meshreel.model.sequence import FrameSource, MeshSequence, Vertices
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackSource, error_bound_of, track_by_name

NAMES = {"displacement", "displacements", "displ", "displ_", "disp", "disp_", "u"}
"""Usual names of displacements, in lower case; with _ those that VTK joins from Exodus II."""


def displace(sequence: MeshSequence, choice: str, max_loaded_bytes: int | None) -> MeshSequence:
    """Return a sequence whose vertices are moved by a track, which it keeps.

    Parameters
    ----------
    choice : str
        Name of a track of three numbers per vertex, in the unit of the positions; ``name:factor``
        multiplies it.
    max_loaded_bytes : int, optional
        Larger positions are computed when they are read. Default: never.

    Raises
    ------
    InvalidInputError
        If there is no such track, the factor is not a number other than 0, or a displacement is
        not finite.
    """
    segments = [_displace(segment, choice, max_loaded_bytes) for segment in sequence.segments]
    return MeshSequence.of_segments(segments, sequence.name, sequence.timing)


def note_displacement(sequence: MeshSequence, notes: Notes) -> None:
    """Suggest the only track with a usual name as displacement of a mesh without motion."""
    segment = sequence.segments[0]
    if sequence.n_segments > 1 or segment.n_frames < 2:
        return
    tracks = segment.tracks.items()
    names = [name for name, track in tracks if name.lower() in NAMES and _moves_vertices(track)]
    if len(names) != 1:
        return
    first, last = (segment.read(frame, frame + 1) for frame in (0, segment.n_frames - 1))
    if not np.array_equal(first, last):
        return
    extent, box = segment.extent, (first[0].min(axis=0), first[0].max(axis=0))
    if np.array_equal(box, (extent.low, extent.high)):
        text = Message(
            f"the mesh does not move, and its track {names[0]} may be its displacement; move it "
            "with ",
            Keyword("displace", names[0]),
        )
        notes.unknown("displacement", text)


def _moves_vertices(track: TrackSource) -> bool:
    return track.domain is Domain.VERTEX and track.shape[2] == 3 and track.dtype.kind == "f"


def _displace(segment: FrameSource, choice: str, max_loaded_bytes: int | None) -> FrameSource:
    name, factor = _parse_choice(choice, segment)
    track = track_by_name(segment.tracks, name)
    if not _moves_vertices(track):
        raise InvalidInputError(
            Keyword("displace"),
            f" takes a track of three numbers per vertex; {name} has {track.shape[2]} per "
            f"{track.domain}, {track.dtype}",
        )
    surface = replace(segment.surface, displaced_by=(name, factor))
    bound, of_track = error_bound_of(segment), error_bound_of(track)
    if bound is not None:
        bound = None if of_track is None else bound + abs(factor) * of_track
    description = Description(segment.faces, segment.name, segment.timing, surface, bound)
    shape, files = (segment.n_frames, segment.n_verts), getattr(segment, "files", ())
    read = _reader(segment, track, factor)
    return description.open(shape, segment.dtype, read, files, segment.tracks, max_loaded_bytes)


def _reader(
    segment: FrameSource, track: TrackSource, factor: float
) -> Callable[[int, int], Vertices]:
    def read(start: int, stop: int) -> Vertices:
        values = track.read(start, stop)
        if not (is_finite := np.isfinite(values).all(axis=(1, 2))).all():
            frame = start + int(np.argmin(is_finite))
            raise InvalidInputError(f"a displacement of frame {frame} is not finite")
        displaced_positions = segment.read(start, stop).astype(np.float64) + factor * values
        return displaced_positions.astype(segment.dtype)

    return read


def _parse_choice(choice: str, segment: FrameSource) -> tuple[str, float]:
    """Return name and factor; names may contain colons."""
    name, colon, text = choice.rpartition(":")
    if choice in segment.tracks or not colon:
        return choice, 1.0
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not math.isfinite(factor) or factor == 0:
        raise InvalidInputError(
            Keyword("displace"),
            f" takes a track and a factor other than 0, NAME:FACTOR; got {choice}",
        )
    return name, factor
