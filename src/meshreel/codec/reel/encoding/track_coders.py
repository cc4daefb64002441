"""Coders of a track: of its blocks within a bound, or exactly."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.bitstream.layout import Section
from meshreel.codec.choices import Order, Tune
from meshreel.codec.config import DEFAULT_EFFORT
from meshreel.codec.reel.encoding.block_coder import (
    FieldBlockCoder,
    FieldFrames,
    KeyedBlocks,
    largest_rounding,
)
from meshreel.codec.reel.encoding.corrections import check_promise
from meshreel.codec.reel.encoding.effort import choices_for, finest_step
from meshreel.codec.reel.encoding.shared_corners import SharedTrack
from meshreel.codec.reel.encoding.track_residuals import (
    exact_residuals,
    residuals,
)
from meshreel.codec.reel.normative.blocks import write_exact_block, write_missing, write_track_block
from meshreel.codec.reel.normative.expected import MovingSurface
from meshreel.codec.reel.normative.graphs import ItemGraph, item_graph
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.source import CodedMesh
from meshreel.codec.subspace.trajectories import BoundingFrame, bounding_frame
from meshreel.codec.track_bounds import Measure, TrackBound
from meshreel.codec.tracks import TURN_COLUMNS, Coding, TrackHeader, write_track
from meshreel.errors import InvalidInputError
from meshreel.kernel.mesh import Neighbors, neighbors
from meshreel.model.sequence import Extent
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackKind, TrackSource

Values = npt.NDArray[Any]
Vertices = npt.NDArray[np.floating]
Sections = list[tuple[Section, bytes]]
Integers = npt.NDArray[np.int64]

LARGEST_STEP = 0.1
"""Coarsest step that is tried, in diagonals of the range: as of positions."""

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
    graph : Neighbors
        Of its vertices, faces or corners.
    surface, keeps_vertex_order
        As of `TrackCoder`.
    """

    header: TrackHeader
    order: Integers | None
    graph: Neighbors
    surface: MovingSurface | None = None
    keeps_vertex_order: bool = True

    def leading_section(self) -> tuple[Section, bytes]:
        """What is said of the track before the first block."""
        return Section.TRACK, write_track(self.header)

    def code(self, values: Values, positions: Vertices | None = None) -> Sections:
        """The sections of the next block, of values of shape (T_b, N, C)."""
        coded, order = values, self.order
        if self.surface is not None and positions is not None:
            if not self.keeps_vertex_order:
                coded, order = in_order(values, order), None
            coded = exact_residuals(self.header, self.surface, positions, coded)
        return list(write_exact_block(in_order(coded, order), self.graph))

    def predicted(self, coding: Coding, rate: float, surface: MovingSurface) -> "ExactTrackCoder":
        """The coder of the same track that codes what differences of positions leave of it."""
        header = replace(self.header, coding=coding.as_exact, rate=rate)
        return replace(self, header=header, surface=surface)


@dataclass(frozen=True)
class PreparedValues:
    """A block of values, ready to be coded with any step.

    Attributes
    ----------
    frames : FieldFrames
    missing : tuple of Section and bytes, or None
        Which values are missing, if some are.
    """

    frames: FieldFrames
    missing: tuple[Section, bytes] | None


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
    surface : MovingSurface or None
        The mesh as it goes out, where the track is predicted from decoded positions.
    rounding : float, default 0
        Largest error, in units of the track, that its number type alone makes.
    keeps_vertex_order : bool, default True
        Whether values go out in the order in which they are given, and not in internal order.
    """

    header: TrackHeader
    order: Integers | None
    share: float
    coder: FieldBlockCoder
    surface: MovingSurface | None = None
    rounding: float = 0.0
    keeps_vertex_order: bool = True

    @cached_property
    def _blocks(self) -> KeyedBlocks:
        return KeyedBlocks(self.coder)

    def leading_section(self) -> tuple[Section, bytes]:
        """What is said of the track before the first block."""
        return Section.TRACK, write_track(self.header)

    def code(self, values: Values, positions: Vertices | None = None) -> Sections:
        """The sections of the next block; raises as `prepared`.

        Parameters
        ----------
        values : float array of shape (T_b, N, C)
        positions : float array of shape (T_b, V, 3), optional
            Decoded, as they go out; needed where the track is predicted from them.
        """
        return self.coded(self.prepared(values, positions))

    def prepared(self, values: Values, positions: Vertices | None = None) -> PreparedValues:
        """A block of values, as `code` has them, ready to be coded with any step.

        Raises
        ------
        InvalidInputError
            If its numbers cannot be coded within the bound.
        """
        check_values(self.header.name, values, self.header)
        is_missing, order = np.isnan(values), self.order
        coded, origin = values, self.header.origin
        if self.surface is not None and positions is not None:
            if not self.keeps_vertex_order:
                coded, order = in_order(values, order), None
            coded = residuals(self.header, self.surface, positions, coded)
        if not is_missing.any():
            return PreparedValues(self.coder.frames(coded, order), None)
        frames = self.coder.frames(filled(coded, np.isnan(coded), origin), order)
        ordered = in_order(is_missing, self.order)
        return PreparedValues(frames, write_missing(ordered, self.coder.mesh.neighbors))

    def coded(self, prepared: PreparedValues) -> Sections:
        """The sections of the next block."""
        begin, *sections = self._blocks.code(prepared.frames).sections
        return [begin, *([prepared.missing] if prepared.missing else []), *sections]

    def predicted(
        self, coding: Coding, rate: float, surface: MovingSurface, bound: TrackBound
    ) -> "TrackCoder":
        """The coder of the same track that codes what decoded positions leave of it.

        Parameters
        ----------
        coding : Coding
        rate : float
        surface : MovingSurface
            The mesh as it goes out.
        bound : TrackBound
        """
        header, is_turned = self.header, coding is Coding.TURNS
        origin = (0.0,) * (TURN_COLUMNS if is_turned else header.n_columns)
        frame = BoundingFrame(origin, 1.0 if is_turned else header.scale)
        allowed = self.share * header.scale
        if bound.measure is Measure.ANGLE:
            allowed = math.radians(bound.amount) * (1.0 - UNIT_LENGTH_TOLERANCE)
        origins = (0.0,) * header.n_columns
        return replace(
            self,
            header=replace(header, coding=coding, rate=rate, scale=frame.scale, origin=origins),
            share=(allowed - self.rounding) / frame.scale,
            coder=replace(self.coder, frame=frame),
            surface=surface,
        )

    @property
    def as_exact(self) -> ExactTrackCoder:
        """The coder of the same track that changes nothing."""
        header = exact_header(self.header.name, self.header, self.header.n_columns)
        graph = self.coder.mesh.neighbors
        return ExactTrackCoder(header, self.order, graph)

    def with_step(self, step: float) -> "TrackCoder":
        """The same with another step, from its first block on."""
        coder = self.coder
        finest = finest_step(self.header.n_coded)
        fitting = max(finest, min(step, LARGEST_STEP))
        return replace(self, coder=coder.with_step(fitting, self.share))


def in_order(values: Values, order: Integers | None) -> Values:
    """Values of shape (T_b, N, C) in an order, of the number of the value at each place."""
    return values if order is None else values.take(order, axis=1)


def exact_coder(name: str, track: TrackSource, mesh: CodedMesh) -> ExactTrackCoder:
    """The coder of a track whose values come back as they are."""
    graph, order = _graph_of(name, track, mesh)
    header = exact_header(name, track, track.shape[2])
    return ExactTrackCoder(
        header,
        order,
        neighbors(*graph),
        keeps_vertex_order=mesh.keeps_vertex_order,
    )


def exact_header(name: str, track: TrackSource | TrackHeader, n_columns: int) -> TrackHeader:
    """What is said of a track whose values come back as they are."""
    what = name, track.unit, track.kind, track.domain, track.dtype
    header = TrackHeader(*what, 1.0, (0.0,) * n_columns, Coding.EXACT)
    if isinstance(track, SharedTrack | TrackHeader):
        return replace(header, sharing=track.sharing, rows=track.rows)
    return header


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
            f"track {name!r}: an error of {allowed:.3g} cannot be guaranteed, since its numbers of "
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
    if isinstance(track, SharedTrack):
        header = replace(header, sharing=track.sharing, rows=track.rows)
    coder = FieldBlockCoder(
        FieldMesh(graph.faces, graph.n_items, choices.stencil_size),
        frame,
        choices,
        sections_of=write_track_block,
        each_column=bound.measure is Measure.NUMBER,
    )
    at_most = rounding * frame.scale
    return TrackCoder(header, order, share, coder, None, at_most, mesh.keeps_vertex_order)


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
    if isinstance(track, SharedTrack):
        return track.graph, track.order
    if track.domain is Domain.VERTEX:
        return ItemGraph(mesh.faces, mesh.n_verts), mesh.order
    if mesh.order_kept is not Order.KEEP:
        raise InvalidInputError(
            f"track {name!r} is of each {track.domain}, whose order would be lost; keep it "
            '(order="keep"), or drop the track'
        )
    graph = item_graph(track.domain, mesh.output_faces, mesh.surface, mesh.n_verts)
    return graph, None
