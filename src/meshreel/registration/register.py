"""Registration of a sequence whose faces change in almost every frame."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from meshreel.arrays import Integers, rows_as_bytes
from meshreel.codec.error_bounds import ErrorBound
from meshreel.errors import InvalidInputError
from meshreel.model.geometry.polygons import fan_corners
from meshreel.model.segments import (
    AnySequence,
    MeshFrame,
    SegmentedSequence,
    frames_of,
    segment_containing,
    segments_of,
)
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Surface
from meshreel.registration.cleaning import MIN_COMPONENT_AREA, CleanMesh, clean
from meshreel.registration.growing import Frames, Segment, Topology, grow_segments
from meshreel.registration.verification import FrameErrors, Tolerance
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import REGISTER, REGISTER_SCIPY
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.threads import one_blas_thread

DEFAULT_TOLERANCE = ErrorBound(0.2)
"""In percent of the diagonal of the box of all frames."""

CACHED_FRAMES = 4
"""Cleaned frames in memory."""


@dataclass(frozen=True, eq=False)
class Registration:
    """A registered sequence, and how far it is from the raw frames.

    Attributes
    ----------
    sequence : SegmentedSequence
        Segments of constant connectivity. Frames that could not be followed are segments of their
        own, with the raw mesh.
    segments : tuple of Segment
        The registered segments; positions are in longest sides of the box.
    scale : float
        Longest side of the box of all frames, in the unit of the sequence.
    tolerance : Tolerance
        In longest sides of the box.
    notes : tuple of str
        What was changed or left out.
    """

    sequence: SegmentedSequence
    segments: tuple[Segment, ...]
    scale: float
    tolerance: Tolerance
    notes: tuple[str, ...]

    @property
    def errors(self) -> tuple[FrameErrors, ...]:
        """Distances of each frame from its raw frame, in longest sides of the box."""
        return tuple(one for segment in self.segments for one in segment.errors)

    @property
    def psnr_db(self) -> float:
        """Surface PSNR: 10 log10(3 / mean squared distance), over all frames."""
        mean = float(np.mean([one.mean_square for one in self.errors]))
        return float(10 * np.log10(3 / mean)) if mean else float("inf")

    def cuts(self) -> Iterator[str]:
        """Yield a line about each frame at which a segment ended."""
        for segment in self.segments:
            for number, reason in segment.reasons:
                yield f"frame {number} does not continue the mesh of frame {segment.key}: {reason}"


def register(
    sequence: AnySequence,
    tolerance: ErrorBound = DEFAULT_TOLERANCE,
    progress: Progress = silent,
) -> Registration:
    """Replace the meshes of raw frames by meshes that follow the surface over many frames.

    Parameters
    ----------
    sequence : MeshSequence, SegmentedSequence or other FrameSource
        Raw frames, at least one. Frames may stay in their files; each is read three times.
    tolerance : ErrorBound
        99 % of both surfaces, of each frame, are within it, and no connected patch beyond it is
        larger than a square whose side is ten times the tolerance. Percent refer to the diagonal
        of the box of all frames.
    progress : callable, optional
        Called with the stage and the number of frames.

    Raises
    ------
    InvalidInputError
        If no frame has a face with an area, or the extra [register] is not installed.
    """
    for library in (REGISTER, REGISTER_SCIPY):
        library.load()
    extent = sequence.extent
    scale = float((extent.high - extent.low).max()) or 1.0
    diagonal = float(np.linalg.norm(extent.high - extent.low)) or 1.0
    limit = Tolerance(tolerance.share(diagonal) * diagonal / scale)
    raw = _RawFrames(sequence)
    topologies, n_removed = [], Counter[str]()
    for number in range(raw.n_frames):
        mesh = raw.cleaned(number)
        topologies.append(None if mesh.is_empty else Topology.of_mesh(mesh))
        n_removed.update({"face": mesh.n_degenerate, "component": mesh.n_crumbs})
        progress("cleaning", Count(number + 1, raw.n_frames, "frames"))
    if not any(topologies):
        raise InvalidInputError("no frame has a face with an area; there is nothing to register")
    frames = Frames(raw.n_frames, raw.cleaned, np.asarray(extent.low, np.float64), scale)
    with one_blas_thread():
        segments = grow_segments(
            frames,
            topologies,
            limit,
            lambda n_done: progress("registering", Count(n_done, raw.n_frames, "frames")),
        )
    notes = tuple(_notes(n_removed, topologies, sequence))
    registered = SegmentedSequence(_sequences(raw, segments, frames), sequence.name)
    return Registration(registered, tuple(segments), scale, limit, notes)


class _RawFrames:
    """The frames of a sequence, one at a time."""

    def __init__(self, sequence: AnySequence) -> None:
        self._segments = segments_of(sequence)
        counts = [one.n_frames for one in self._segments]
        self.starts = (0, *np.cumsum(counts).tolist())
        self.n_frames = self.starts[-1]
        self.cleaned = lru_cache(CACHED_FRAMES)(self._cleaned)

    def whole(self, number: int) -> MeshSequence:
        """Return a frame with its surface."""
        segment = segment_containing(self.starts, number)
        local = number - self.starts[segment]
        return frames_of(self._segments[segment], range(local, local + 1))

    def _cleaned(self, number: int) -> CleanMesh:
        frame = self.whole(number)
        return clean(MeshFrame(frame.vertices[0], frame.faces))


def _sequences(
    raw: _RawFrames, segments: Sequence[Segment], frames: Frames
) -> Iterator[MeshSequence]:
    """Yield the segments in the unit of the sequence, and single frames as they are."""
    first = 0
    for segment in segments:
        for number in range(first, segment.first):  # frames without a surface
            yield raw.whole(number)
        first = segment.first + segment.n_frames
        key = raw.whole(segment.key)
        if segment.n_frames == 1:
            yield key
            continue
        positions = segment.positions * frames.scale + frames.low
        surface = _kept_surface(key, raw.cleaned(segment.key))
        yield replace(
            key,
            vertices=positions.astype(key.dtype),
            faces=segment.faces,
            surface=surface,
            tracks={},
        )
    for number in range(first, raw.n_frames):
        yield raw.whole(number)


def _kept_surface(key: MeshSequence, cleaned: CleanMesh) -> Surface:
    """Return attributes and groups of the cleaned mesh of a key, attributes at its corners."""
    surface, kept = key.surface, cleaned.kept_faces
    sizes = surface.sizes(len(key.faces))
    polygons = np.repeat(np.arange(len(sizes)), sizes - 2)[kept]
    items: dict[Domain, Integers] = {
        Domain.VERTEX: key.faces[kept].ravel().astype(np.int64),
        Domain.CORNER: fan_corners(sizes)[kept].ravel().astype(np.int64),
        Domain.FACE: polygons,
    }
    return Surface(
        attributes=tuple(_kept_attribute(one, items[one.domain]) for one in surface.attributes),
        groups=tuple(replace(one, numbers=one.numbers[polygons]) for one in surface.groups),
        materials=surface.materials,
        images=surface.images,
        is_ordered=False,
    )


def _kept_attribute(attribute: Attribute, items: Integers) -> Attribute:
    """Return the values of an attribute at these items: those of vertices become of corners."""
    domain = Domain.FACE if attribute.domain is Domain.FACE else Domain.CORNER
    values = attribute.per_item()[items]
    _, first, indices = np.unique(rows_as_bytes(values), return_index=True, return_inverse=True)
    return replace(attribute, domain=domain, values=values[first], indices=indices.astype(np.int32))


def _notes(
    n_removed: Mapping[str, int], topologies: Sequence[Topology | None], sequence: AnySequence
) -> Iterator[str]:
    if n_removed["face"]:
        yield f"removed {counted(n_removed['face'], 'face')} without area"
    if n_removed["component"]:
        yield (
            f"removed {counted(n_removed['component'], 'component')} smaller than "
            f"{100 * MIN_COMPONENT_AREA:g} % of the surface of the frame"
        )
    if None in topologies:
        yield f"{counted(topologies.count(None), 'frame')} without a surface: kept unchanged"
    several = segments_of(sequence)
    if names := sorted({name for one in several for name in one.tracks}):
        yield f"left out tracks of registered frames: {', '.join(names)}"
    if any(one.surface.hard_edges is not None for one in several):
        yield "left out hard edges of registered frames"
