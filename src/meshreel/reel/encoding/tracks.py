"""Tracks beside the positions: found how fine they have to be, and coded block after block."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import Section
from meshreel.codec.achieved import measure_tracks
from meshreel.codec.choices import Order
from meshreel.codec.source import CodedMesh, CodedTrack, Source
from meshreel.codec.track_bounds import EXACT, Measure, TrackBound
from meshreel.codec.tracks import TrackHeader, read_track, write_track
from meshreel.errors import InvalidInputError, SolverError
from meshreel.kernel.mesh import Neighbours, neighbours
from meshreel.reel.agreed.blocks import write_exact_block, write_missing, write_track_block
from meshreel.reel.agreed.graphs import ItemGraph, item_graph
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.reel.encoding.block_coder import (
    FieldBlockCoder,
    KeyedBlocks,
    check_promise,
    largest_rounding,
)
from meshreel.reel.encoding.effort import STEPS_OF_BOUND, choices_for, finest_step
from meshreel.reel.encoding.rate_control import least_cost
from meshreel.reel.options import DEFAULT_EFFORT, Tune
from meshreel.runtime.progress import Count, Progress
from meshreel.sequence import Extent
from meshreel.subspace.trajectories import BoundingFrame, bounding_frame
from meshreel.surface import Domain
from meshreel.tracks import TrackKind, TrackSource, value_range

Values = npt.NDArray[Any]
Integers = npt.NDArray[np.int64]

RAW_SHARE = 8
"""Where a track takes more than one of so many of its raw bytes, it is coded exactly too."""

LARGEST_STEP = 0.1
"""Coarsest step that is tried, in diagonals of the range: as of positions."""

SLACK = 1e-9
"""Share by which an error may seem larger than it is, by the rounding of the measure."""

UNIT_LENGTH_TOLERANCE = 1e-3
"""By how much the length of a normal may differ from 1; one of length 0 is none."""


@dataclass(frozen=True)
class ExactTrackCoder:
    """Codes blocks of a track whose values come back as they are.

    Attributes
    ----------
    header : TrackHeader
    order : int64 array of shape (N,), or None
        Number of the value of each vertex in internal order; None: they are in it.
    graph : Neighbours
        Of its vertices, faces or corners.
    """

    header: TrackHeader
    order: Integers | None
    graph: Neighbours

    def leading_section(self) -> tuple[Section, bytes]:
        """What is said of the track before the first block."""
        return Section.TRACK, write_track(self.header)

    def code(self, values: Values) -> list[tuple[Section, bytes]]:
        """The sections of the next block, of values of shape (T_b, N, C)."""
        ordered = values if self.order is None else values.take(self.order, axis=1)
        return list(write_exact_block(ordered, self.graph))


@dataclass(frozen=True)
class TrackCoder:
    """Codes blocks of a track within a bound.

    Attributes
    ----------
    header : TrackHeader
    order : int64 array of shape (N,), or None
        Number of the value of each vertex in internal order; None: they are in it.
    share : float
        The bound, in diagonals of the range.
    coder : FieldBlockCoder
    """

    header: TrackHeader
    order: Integers | None
    share: float
    coder: FieldBlockCoder

    @cached_property
    def _blocks(self) -> KeyedBlocks:
        return KeyedBlocks(self.coder)

    def leading_section(self) -> tuple[Section, bytes]:
        """What is said of the track before the first block."""
        return Section.TRACK, write_track(self.header)

    def code(self, values: Values) -> list[tuple[Section, bytes]]:
        """The sections of the next block, of values of shape (T_b, N, C).

        Raises
        ------
        InvalidInputError
            If its numbers cannot be coded within the bound.
        """
        check_values(self.header.name, values, self.header)
        is_missing = np.isnan(values)
        if not is_missing.any():
            return list(self._blocks.code(self.coder.frames(values, self.order)).sections)
        frames = self.coder.frames(filled(values, is_missing, self.header.origin), self.order)
        begin, *sections = self._blocks.code(frames).sections
        ordered = is_missing if self.order is None else is_missing.take(self.order, axis=1)
        return [begin, write_missing(ordered, self.coder.mesh.neighbours), *sections]

    @property
    def as_exact(self) -> ExactTrackCoder:
        """The coder of the same track that changes nothing."""
        header = exact_header(self.header.name, self.header, self.header.n_columns)
        return ExactTrackCoder(header, self.order, self.coder.mesh.neighbours)

    def with_step(self, step: float) -> "TrackCoder":
        """The same with another step, from its first block on."""
        coder = self.coder
        finest = finest_step(coder.mesh.n_verts, self.header.n_columns)
        fitting = max(finest, min(step, LARGEST_STEP))
        return replace(self, coder=coder.with_step(fitting, self.share))


def coded_tracks(source: Source, progress: Progress) -> list[CodedTrack]:
    """The tracks of a sequence that is all there, each within its bound.

    Raises
    ------
    InvalidInputError
        If a bound cannot be promised.
    """
    pieces = [slice(piece.start, piece.stop) for piece in source.pieces()]
    found = []
    for number, (name, bound) in enumerate(source.bounds.items()):
        progress("encoding tracks", Count(number, len(source.bounds), "tracks"))
        track = source.sequence.tracks[name]
        found.append(coded_track(name, track, bound, source.mesh, pieces))
    return found


def check_kept(source: Source, data: bytes) -> None:
    """Nothing if every track of a stream is within its bound.

    Raises
    ------
    SolverError
        If one is not.
    """
    measured = measure_tracks(source.sequence, data, order=source.config.order)
    for header in (read_track(track.leading[1]) for track in source.tracks):
        found = measured[header.name].largest
        if found > header.bound * (1.0 + SLACK):
            raise SolverError(
                f"track {header.name!r} decodes to errors of up to {found:g}, and {header.bound:g} "
                "was promised; nothing is written; please report this sequence"
            )


def coded_track(
    name: str, track: TrackSource, bound: TrackBound, mesh: CodedMesh, pieces: Sequence[slice]
) -> CodedTrack:
    """A track of a sequence that is all there.

    The step is the one that takes the fewest bytes, corrections included.

    Parameters
    ----------
    name : str
    track : TrackSource
    bound : TrackBound
    mesh : CodedMesh
    pieces : sequence of slice
        Frames of each block.

    Raises
    ------
    InvalidInputError
        If the bound cannot be promised.
    """
    if bound == EXACT:
        return _coded_exactly(exact_coder(name, track, mesh), track, pieces)
    coder = track_coder(name, track, bound, mesh, value_range(track))
    _, fitted = _fitted(coder, track, pieces)
    if fitted.size_bytes * RAW_SHARE < math.prod(track.shape) * track.dtype.itemsize:
        return fitted
    exact = _coded_exactly(coder.as_exact, track, pieces)
    return min(fitted, exact, key=lambda one: one.size_bytes)


def live_track(
    name: str, first: TrackSource, bound: TrackBound, mesh: CodedMesh
) -> TrackCoder | ExactTrackCoder:
    """The coder of a track of which the first block is known: that decides the step of all.

    Raises
    ------
    InvalidInputError
        If the bound cannot be promised.
    """
    if bound == EXACT:
        return exact_coder(name, first, mesh)
    coder = track_coder(name, first, bound, mesh, value_range(first))
    step, _ = _fitted(coder, first, [slice(0, first.shape[0])])
    return coder.with_step(step)


def _fitted(
    coder: TrackCoder, track: TrackSource, pieces: Sequence[slice]
) -> tuple[float, CodedTrack]:
    """The step that takes the fewest bytes, corrections included, and the track coded with it."""
    smallest: list[list[tuple[Section, bytes]]] = []
    least = math.inf

    def size_bytes(step: float) -> float:
        nonlocal smallest, least
        tried = coder.with_step(step)
        blocks = [tried.code(track.read(piece.start, piece.stop)) for piece in pieces]
        size = float(sum(len(payload) for block in blocks for _, payload in block))
        if size < least:
            smallest, least = blocks, size
        return size

    step = least_cost(size_bytes, coder.share / STEPS_OF_BOUND)
    return step, CodedTrack(coder.leading_section(), smallest)


def _coded_exactly(
    coder: ExactTrackCoder, track: TrackSource, pieces: Sequence[slice]
) -> CodedTrack:
    blocks = [coder.code(track.read(piece.start, piece.stop)) for piece in pieces]
    return CodedTrack(coder.leading_section(), blocks)


def exact_coder(name: str, track: TrackSource, mesh: CodedMesh) -> ExactTrackCoder:
    """The coder of a track whose values come back as they are."""
    graph, order = _graph_of(name, track, mesh)
    header = exact_header(name, track, track.shape[2])
    return ExactTrackCoder(header, order, neighbours(*graph))


def exact_header(name: str, track: TrackSource | TrackHeader, n_columns: int) -> TrackHeader:
    """What is said of a track whose values come back as they are."""
    what = name, track.unit, track.kind, track.domain, track.dtype
    return TrackHeader(*what, 1.0, (0.0,) * n_columns, is_exact=True)


def filled(values: Values, is_missing: npt.NDArray[np.bool_], origin: Sequence[float]) -> Values:
    """Values of shape (T_b, N, C) with something smooth where they are missing.

    Each takes those before and after it in time, on a straight line between them; one that is
    missing in all frames the origin of its column.
    """
    found = values.copy()
    times = np.arange(len(values))
    for item, column in np.argwhere(is_missing.any(axis=0)):
        here = is_missing[:, item, column]
        known = found[~here, item, column]
        found[here, item, column] = (
            np.interp(times[here], times[~here], known) if len(known) else origin[column]
        )
    return found


def track_coder(
    name: str,
    track: TrackSource,
    bound: TrackBound,
    mesh: CodedMesh,
    extent: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]],
) -> TrackCoder:
    """The coder of a track; its step is still to be set.

    Parameters
    ----------
    name, track, bound, mesh
        As of `coded_track`.
    extent : two arrays of shape (C,)
        Lowest and highest number of each column.
    """
    low, high = np.nan_to_num(extent[0]), np.nan_to_num(extent[1])  # where all is missing
    frame = bounding_frame(Extent(low, high, 0.0))
    allowed = length_allowed(bound, frame)
    share = allowed / frame.scale
    graph, order = _graph_of(name, track, mesh)
    rounding = largest_rounding(float(low.min()), float(high.max()), track.dtype, frame)
    try:
        check_promise(share, rounding, track.dtype)
    except InvalidInputError:
        least = 1.01 * rounding * frame.scale
        raise InvalidInputError(
            f"track {name!r}: an error of {allowed:.3g} cannot be promised, since its numbers of "
            f"type {track.dtype} are rounded by up to {least:.2g}; allow more, or ask for exact"
        ) from None
    effort = DEFAULT_EFFORT if mesh.config.effort is None else mesh.config.effort
    choices = choices_for(effort, Tune.GEOMETRY, None)
    header = TrackHeader(
        name,
        track.unit,
        track.kind,
        track.domain,
        track.dtype,
        frame.scale,
        frame.origin,
        bound=bound.amount if bound.measure is Measure.ANGLE else allowed,
    )
    coder = FieldBlockCoder(
        FieldMesh(graph.faces, graph.n_items, choices.stencil_size),
        frame,
        choices,
        sections_of=write_track_block,
        each_column=bound.measure is Measure.NUMBER,
    )
    return TrackCoder(header, order, share, coder)


def length_allowed(bound: TrackBound, frame: BoundingFrame) -> float:
    """Largest length of the difference of two values (or of each number) that a bound allows."""
    if bound.measure is Measure.SHARE:
        return bound.amount / 100.0 * frame.scale
    if bound.measure is Measure.ANGLE:
        return math.sin(math.radians(bound.amount)) * (1.0 - UNIT_LENGTH_TOLERANCE)
    return bound.amount


def check_values(name: str, values: Values, header: TrackHeader) -> None:
    """Nothing if all values can be coded within a bound.

    Raises
    ------
    InvalidInputError
        Naming the first that is infinite, or, of normals, not of length 1 or 0.
    """
    is_infinite = np.isinf(values)
    if is_infinite.any():
        frame, item, column = np.argwhere(is_infinite)[0]
        raise InvalidInputError(
            f"track {name!r} has {values[frame, item, column]} at {header.domain} {item}; no bound "
            "can be promised of that: ask for exact"
        )
    if header.kind is not TrackKind.NORMAL:
        return
    lengths = np.linalg.norm(values.astype(np.float64), axis=2)
    is_off = (np.abs(lengths - 1.0) > UNIT_LENGTH_TOLERANCE) & (lengths != 0)
    if is_off.any():
        frame, item = np.argwhere(is_off)[0]
        raise InvalidInputError(
            f"track {name!r} has normals, which must have the length 1; that of {header.domain} "
            f"{item} has {lengths[frame, item]:.6g}: divide by it, or call the kind vector"
        )


def _graph_of(name: str, track: TrackSource, mesh: CodedMesh) -> tuple[ItemGraph, Integers | None]:
    if track.domain is Domain.VERTEX:
        return ItemGraph(mesh.faces, mesh.n_verts), mesh.order
    if mesh.order_kept is not Order.KEEP:
        raise InvalidInputError(
            f"track {name!r} is of each {track.domain}, whose order would be lost; keep it "
            '(order="keep"), or drop the track'
        )
    graph = item_graph(track.domain, mesh.output_faces, mesh.surface, mesh.n_verts)
    return graph, None
