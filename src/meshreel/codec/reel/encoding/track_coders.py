"""Coders of the blocks of a track, within a bound or losslessly."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers, Values, Vertices
from meshreel.codec.bitstream.layout import Order, Section
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.methods import UnreachableError
from meshreel.codec.reel.encoding.analysis import quantized_fields
from meshreel.codec.reel.encoding.block_coder import FieldBlockCoder, KeyedBlocks, shared_field_mesh
from meshreel.codec.reel.encoding.block_frames import BlockFrames, largest_rounding
from meshreel.codec.reel.encoding.corrections import FLOOR
from meshreel.codec.reel.encoding.effort import choices_for, finest_step
from meshreel.codec.reel.encoding.shared_corners import SharedTrack
from meshreel.codec.reel.encoding.track_residuals import exact_residuals, residuals
from meshreel.codec.reel.normative.blocks import (
    write_missing,
    write_track_block,
    write_values_block,
)
from meshreel.codec.reel.normative.expected import MovingSurface
from meshreel.codec.reel.normative.fields import ItemPoints, PointWeights, nugget_of
from meshreel.codec.reel.normative.grid import MAX_COORDINATE, PositionGrid
from meshreel.codec.reel.normative.mesh import FieldMesh, ItemGraph, item_graph
from meshreel.codec.reel_options import DEFAULT_EFFORT, ReelOptions, Tune
from meshreel.codec.source import CodedMesh
from meshreel.codec.subspace.trajectories import BoundingFrame, single_below, stored_frame
from meshreel.codec.track_bounds import EXACT, Measure, TrackBound
from meshreel.codec.tracks import ROTATION_COLUMNS, Coding, Sharing, TrackHeader, write_track
from meshreel.errors import CorruptStreamError, InvalidInputError, Keyword
from meshreel.kernel.fields import encode_fields
from meshreel.kernel.mesh import Neighbors, neighbors
from meshreel.kernel.predict import MAX_RELATED, kriging_weights
from meshreel.model.extent import Extent
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS, TrackSource, error_bound_of, error_unit, value_range

Sections = list[tuple[Section, bytes]]

MAX_STEP = 0.1
"""Largest step, in diagonals of the range, as for positions."""

ROUNDING_SLACK = 1e-6
"""Share of a step reserved for its rounding to single precision."""

UNIT_LENGTH_TOLERANCE = 1e-3
"""Allowed deviation of the length of a normal from 1; length 0 means that there is no normal."""


@dataclass(frozen=True)
class _Coder:
    """What coders of lossless and of bounded tracks share."""

    header: TrackHeader
    order: Integers | None
    """int64 array of shape (N,), or None. Given number of each internal item; None means internal
    order.
    """
    surface: MovingSurface | None = field(default=None, kw_only=True)
    """The decoded mesh, if its positions predict the track."""
    keeps_vertex_order: bool = field(default=True, kw_only=True)
    """Whether decoded vertices are in the given order, and not in the internal one."""

    @property
    def needs_positions(self) -> bool:
        """Whether blocks depend on decoded positions."""
        return self.header.coding.is_predicted

    def leading_section(self) -> tuple[Section, bytes]:
        """Return the section before the first block."""
        return Section.TRACK, write_track(self.header)

    def _residuals(
        self, values: Values, positions: Vertices | None, residuals_of: Callable[..., Values]
    ) -> tuple[Values, Integers | None]:
        """Return what is coded of values, and the given number of each internal item of it."""
        if self.surface is None or positions is None:
            return values, self.order
        if self.keeps_vertex_order:
            return residuals_of(self.header, self.surface, positions, values), self.order
        ordered = in_order(values, self.order)
        return residuals_of(self.header, self.surface, positions, ordered), None


@dataclass(frozen=True)
class ExactTrackCoder(_Coder):
    """Codes blocks of a lossless track."""

    graph: Neighbors
    """Adjacency of its vertices, faces, corners or rows."""

    def code(self, values: Values, positions: Vertices | None = None) -> Sections:
        """Encode the next block of values, of shape (T_b, N, C)."""
        coded, order = self._residuals(values, positions, exact_residuals)
        return list(write_values_block(in_order(coded, order), self.graph))

    def with_prediction(
        self, coding: Coding, rate: float, surface: MovingSurface
    ) -> "ExactTrackCoder":
        """Return the coder of residuals relative to differences of positions."""
        header = replace(self.header, coding=coding.as_exact, rate=rate)
        return replace(self, header=header, surface=surface)


@dataclass(frozen=True)
class PreparedValues:
    """A block of values, prepared for encoding with any step."""

    frames: BlockFrames
    missing: tuple[Section, bytes] | None
    """The section that marks missing values, if any."""


@dataclass(frozen=True)
class CodedValues:
    """A block of a track as sections."""

    sections: Sections
    fields: Floats
    """float64 array of shape (N, n), in coding order. Up to `MAX_RELATED` fields, or numbers of the
    first frame on a grid, from which those of other tracks may be predicted.
    """


@dataclass(frozen=True)
class TrackCoder(_Coder):
    """Codes blocks of a track within a bound."""

    share: float
    """The bound, in diagonals of the range."""
    coder: FieldBlockCoder
    rounding: float
    """Rounding error of the number type that is reserved, in units of the track."""
    points: ItemPoints
    n_varying: int
    """Number of columns that are not constant."""
    nugget: int | None = None
    """Code of the nugget if the initial weights follow from points, else None."""
    grid: PositionGrid | None = None
    """Grid on which blocks store values within the bound; None: they store modes."""

    @property
    def needs_positions(self) -> bool:
        """Whether blocks depend on decoded positions."""
        return self.nugget is not None or self.header.coding.is_predicted

    @cached_property
    def _blocks(self) -> KeyedBlocks:
        return KeyedBlocks(self.coder)

    def code(self, values: Values, positions: Vertices | None = None) -> Sections:
        """Encode the next block; raises as `prepare`.

        Parameters
        ----------
        values : float array of shape (T_b, N, C)
        positions : float array of shape (T_b, V, 3), optional
            Decoded positions in output order, if they predict the track; of the first frame, if
            only its weights follow from them.
        """
        return self.code_prepared(self.prepare(values, positions)).sections

    def prepare(
        self,
        values: Values,
        positions: Vertices | None = None,
        from_points: PointWeights | None = None,
    ) -> PreparedValues:
        """Prepare a block for encoding; parameters as in `code`.

        `from_points` are its initial weights, by default computed from positions if there is a
        nugget.

        Raises
        ------
        InvalidInputError
            If values cannot be encoded within the bound.
        """
        check_values(self.header.name, values, self.header)
        if self.surface is not None:  # the share excludes the rounding of values, not of residuals
            low, high = np.nanmin(values, initial=0.0), np.nanmax(values, initial=0.0)
            frame = self.coder.frame
            self._check_rounding(
                largest_rounding(low, high, values.dtype, frame), self.rounding / frame.scale
            )
        is_missing, origin = np.isnan(values), self.header.origin
        coded, order = self._residuals(values, positions, residuals)
        missing = None
        if is_missing.any():
            coded = fill_missing(coded, np.isnan(coded), origin)
            missing = write_missing(in_order(is_missing, self.order), self.coder.mesh.neighbors)
        frames = self.coder.frames(coded, order)
        if from_points is None and self.nugget is not None:
            assert positions is not None
            from_points = self.weights(positions[0])
        return PreparedValues(replace(frames, from_points=from_points), missing)

    def weights(self, positions: Vertices) -> PointWeights:
        """Return the initial weights, given decoded positions of shape (V, 3)."""
        assert self.nugget is not None
        points = self.points.of(positions)[self.coder.mesh.order]
        weights = kriging_weights(self.coder.mesh.hierarchy, points, nugget_of(self.nugget))
        return PointWeights(self.nugget, weights)

    def fields_bytes(self, targets: Floats, from_points: PointWeights | None) -> int:
        """Return the bytes of unquantized fields, of shape (N, K), with these initial weights."""
        coder = self.coder
        residuals, _ = quantized_fields(targets, coder.mesh, coder.choices, from_points)
        return len(encode_fields(residuals, coder.mesh.coding_order))

    def code_prepared(self, prepared: PreparedValues) -> CodedValues:
        """Encode the next block."""
        frames, coded = prepared.frames, None
        if self.grid is not None:
            coded = self._on_grid(self.grid, frames)
            frames = replace(frames, frame=self.coder.frame, from_points=None)
        if coded is None:
            self._check_rounding(frames.rounding, self.share - FLOOR)
            try:
                by_modes = self._blocks.code(frames)
                sections = list(by_modes.sections)
            except InvalidInputError as error:
                raise self._unreachable(str(error)) from error
            fields = np.array(by_modes.analyzed.decoded.values[:, :MAX_RELATED])
            coded = CodedValues(sections, fields)
        else:
            self._blocks.skip()
        opening, *sections = coded.sections
        missing = [prepared.missing] if prepared.missing else []
        return replace(coded, sections=[opening, *missing, *sections])

    def _check_rounding(self, rounding: float, limit: float) -> None:
        if rounding > limit:
            raise self._unreachable(f"values are rounded to {self.header.dtype} by more than that")

    def _unreachable(self, reason: str) -> UnreachableError:
        header = self.header
        return UnreachableError(
            f"track {header.name!r} cannot be coded within its bound of {header.bound:g} "
            f"{error_unit(header.kind, header.unit)}: {reason}; set a larger bound, or exact"
        )

    def _on_grid(self, grid: PositionGrid, frames: BlockFrames) -> CodedValues | None:
        """Encode a block on a grid; None if a value of it is not within the bound there."""
        coordinates = np.empty(frames.vertices.shape, np.int32)
        for number in range(frames.n_frames):
            values = frames.internal_frame(number)
            coordinates[number] = grid.coordinates(values)
            try:
                decoded = grid.positions(coordinates[number], values.dtype)
            except CorruptStreamError:  # beyond the largest float
                return None
            errors = (decoded - values.astype(np.float64)) / grid.frame.scale
            lengths = np.abs(errors) if self.coder.each_column else np.linalg.norm(errors, axis=1)
            if lengths.max() > self.share:
                return None
        mesh, n_first = self.coder.mesh, -(-MAX_RELATED // frames.n_columns)
        first = np.moveaxis(coordinates[:n_first, mesh.order], 1, 0).reshape(frames.n_verts, -1)
        fields = first[:, :MAX_RELATED].astype(np.float64)
        return CodedValues(write_values_block(coordinates, mesh.neighbors, grid.step), fields)

    def with_prediction(
        self, coding: Coding, rate: float, surface: MovingSurface, bound: TrackBound
    ) -> "TrackCoder":
        """Return the coder of residuals relative to decoded positions of the surface."""
        header, is_rotated = self.header, coding is Coding.ROTATIONS
        origin = (0.0,) * (ROTATION_COLUMNS if is_rotated else header.n_columns)
        frame = BoundingFrame(origin, 1.0 if is_rotated else header.scale)
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
    def single_step(self) -> float:
        """Largest step with which no single number needs a correction."""
        return 2.0 * (self.share - self.rounding / self.header.scale) * (1.0 - ROUNDING_SLACK)

    @property
    def of_integers(self) -> "TrackCoder | None":
        """A coder of values on a grid of all integers; None if one within the bound is coarser."""
        if self.header.coding is not Coding.MODES or self.share * self.header.scale > 0.5:
            return None
        scale = max(2.0 ** math.ceil(math.log2(self.header.scale)), 1.0)
        frame = BoundingFrame(tuple(map(float, np.rint(self.header.origin))), scale)
        # Blocks with other numbers are coded by modes, with the step and bound of the new scale.
        ratio = self.header.scale / scale
        share, step = self.share * ratio, self.coder.choices.position_step * ratio
        return replace(
            self,
            nugget=None,
            header=replace(self.header, scale=scale, origin=frame.origin),
            share=share,
            coder=replace(self.coder, frame=frame).with_step(step, share),
            grid=PositionGrid(1.0 / scale, frame),
        )

    @property
    def on_grid(self) -> "TrackCoder | None":
        """A coder of values on the coarsest grid within the bound; None if that is too fine."""
        # Of residuals of a prediction, all columns vary.
        n_joint = self.header.n_coded if self.header.coding.is_predicted else self.n_varying
        n_joint = 1 if self.coder.each_column else max(1, n_joint)
        step = float(np.float32(self.single_step * (1.0 - ROUNDING_SLACK) / math.sqrt(n_joint)))
        if step < 1.0 / MAX_COORDINATE:
            return None
        return replace(self, nugget=None, grid=PositionGrid(min(step, 1.0), self.coder.frame))

    def with_weights(self, nugget: int | None, n_learned: int) -> "TrackCoder":
        """Return a coder with other weights: their nugget, and how many modes they adapt to."""
        choices = replace(self.coder.choices, n_learned=n_learned)
        return replace(self, nugget=nugget, coder=replace(self.coder, choices=choices))

    @property
    def as_exact(self) -> ExactTrackCoder:
        """The lossless coder of the same track."""
        header = replace(self.header, coding=Coding.EXACT, bound=0.0)
        return ExactTrackCoder(header, self.order, self.coder.mesh.neighbors)

    def with_step(self, step: float) -> "TrackCoder":
        """Return a coder with the closest allowed step, for the first block."""
        step = max(finest_step(self.header.n_coded), min(step, MAX_STEP))
        return replace(self, coder=self.coder.with_step(step, self.share))


def in_order(values: Values, order: Integers | None) -> Values:
    """Permute values of shape (T_b, N, C); None changes nothing."""
    return values if order is None else values.take(order, axis=1)


def exact_coder(name: str, track: TrackSource, mesh: CodedMesh) -> ExactTrackCoder:
    """Return the coder of a lossless track."""
    graph, order = _graph_of(name, track, mesh)
    frame = BoundingFrame((0.0,) * track.shape[2], 1.0)
    header = _header(name, track, frame, coding=Coding.EXACT)
    return ExactTrackCoder(
        header, order, neighbors(*graph), keeps_vertex_order=mesh.keeps_vertex_order
    )


def _header(name: str, track: TrackSource, frame: BoundingFrame, **changes: Any) -> TrackHeader:
    """Return the header of a track with numbers in this frame."""
    if isinstance(track, SharedTrack):
        changes |= {"sharing": track.sharing, "rows": track.rows}
    description = name, track.unit, track.kind, track.domain, track.dtype
    earlier = error_bound_of(track) or 0.0
    return TrackHeader(*description, frame.scale, frame.origin, earlier=earlier, **changes)


def fill_missing(
    values: Values, is_missing: npt.NDArray[np.bool_], origin: Sequence[float]
) -> Values:
    """Fill missing values of shape (T_b, N, C) by linear interpolation over time.

    A value missing in all frames becomes the origin of its column.
    """
    result = values.copy()
    times = np.arange(len(values))
    for item, column in np.argwhere(is_missing.any(axis=0)):
        is_gap = is_missing[:, item, column]
        known = result[~is_gap, item, column]
        result[is_gap, item, column] = (
            np.interp(times[is_gap], times[~is_gap], known) if len(known) else origin[column]
        )
    return result


def track_coder(
    name: str,
    track: TrackSource,
    bound: TrackBound,
    mesh: CodedMesh,
) -> TrackCoder | ExactTrackCoder:
    """Return the coder of a track; its step is still to be set.

    It is exact if the bound is, or below the rounding of the number type. Parameters as in
    `encode_track`.
    """
    if bound == EXACT:
        return exact_coder(name, track, mesh)
    low, high = map(np.nan_to_num, value_range(track))  # NaN without any value
    frame = stored_frame(Extent(low, high, 0.0))
    n_varying = int(np.count_nonzero(high > low))
    allowed = length_allowed(bound, frame.scale if n_varying else 0.0)
    share = allowed / frame.scale
    rounding = largest_rounding(float(low.min()), float(high.max()), track.dtype, frame)
    if share <= rounding + FLOOR:
        return exact_coder(name, track, mesh)
    graph, order = _graph_of(name, track, mesh)
    config = mesh.config
    assert isinstance(config, ReelOptions)  # the options of this method
    effort = DEFAULT_EFFORT if config.effort is None else config.effort
    # Shaped noise has larger errors, which take corrections. Those of single numbers are limited by
    # rounding to the nearest.
    choices = replace(choices_for(effort, Tune.GEOMETRY, None), feedback_gain=0.0)
    if track.shape[0] * track.shape[2] == 1:
        choices = replace(choices, rate_weight=0.0)
    is_angle = bound.measure is Measure.ANGLE
    header = _header(name, track, frame, bound=bound.amount if is_angle else allowed)
    if isinstance(track, SharedTrack) and track.sharing is Sharing.ROWS:
        field_mesh = FieldMesh(graph.faces, graph.n_items, choices.stencil_size)
    else:
        domain = Domain.VERTEX if isinstance(track, SharedTrack) else track.domain
        field_mesh = shared_field_mesh(mesh, domain, graph, choices.stencil_size)
    coder = FieldBlockCoder(
        field_mesh,
        frame,
        choices,
        sections_of=write_track_block,
        each_column=bound.measure is Measure.NUMBER,
    )
    return TrackCoder(
        header,
        order,
        share,
        coder,
        rounding * frame.scale,
        _points_of(track, mesh),
        n_varying,
        keeps_vertex_order=mesh.keeps_vertex_order,
    )


def length_allowed(bound: TrackBound, range_size: float) -> float:
    """Return the length of the difference of two values, or numbers, that a bound allows."""
    if bound.measure is Measure.SHARE:
        return single_below(bound.amount / 100.0 * range_size)
    if bound.measure is Measure.ANGLE:
        return math.sin(math.radians(bound.amount)) * (1.0 - UNIT_LENGTH_TOLERANCE)
    return bound.amount


def check_values(name: str, values: Values, header: TrackHeader) -> None:
    """Check that all values can be encoded within a bound.

    Raises
    ------
    InvalidInputError
        If a value is infinite, or the length of a normal is not 1 or 0.
    """
    is_infinite = np.isinf(values)
    if is_infinite.any():
        frame, item, column = np.argwhere(is_infinite)[0]
        raise InvalidInputError(
            f"track {name!r} has {values[frame, item, column]} at {header.domain} {item}, which no "
            "error bound allows; keep the track exact with ",
            Keyword("tracks"),
            f" {name}=exact",
        )
    if not KIND_ROWS[header.kind].is_direction:
        return
    lengths = np.linalg.norm(values.astype(np.float64), axis=2)
    is_invalid = (np.abs(lengths - 1.0) > UNIT_LENGTH_TOLERANCE) & (lengths != 0)
    if is_invalid.any():
        frame, item = np.argwhere(is_invalid)[0]
        raise InvalidInputError(
            f"track {name!r}: values of the kind {header.kind} must have length 1; {header.domain} "
            f"{item} has length {lengths[frame, item]:.6g}: normalize them, or set another kind"
        )


def _points_of(track: TrackSource, mesh: CodedMesh) -> ItemPoints:
    """Return the vertices whose mean is the point of each item of a track."""
    if isinstance(track, SharedTrack) and track.vertex_of_row is not None:
        return ItemPoints(track.vertex_of_row)
    if isinstance(track, SharedTrack) or track.domain is Domain.VERTEX:
        return ItemPoints(inverse_permutation(mesh.output_order))
    if track.domain is Domain.CELL:
        surface = mesh.cell_surface if mesh.order_kept is Order.DROP else mesh.surface
        cells = surface.cells
        assert cells is not None
        return ItemPoints(cells.nodes, np.repeat(np.arange(cells.n_cells), np.diff(cells.starts)))
    sizes = mesh.surface.sizes(len(mesh.output_faces))
    if track.domain is Domain.CORNER:
        return ItemPoints(join_triangles(sizes, mesh.output_faces))
    return ItemPoints(mesh.output_faces.ravel(), np.repeat(np.arange(len(sizes)), 3 * (sizes - 2)))


def _graph_of(name: str, track: TrackSource, mesh: CodedMesh) -> tuple[ItemGraph, Integers | None]:
    if isinstance(track, SharedTrack):
        return track.graph, track.order
    domain, surface, order_kept = track.domain, mesh.surface, mesh.order_kept
    key = ItemGraph, domain
    if key in mesh.derived:
        graph, order = mesh.derived[key]
        return graph, order
    is_plain = surface.cells is None and surface.face_sizes is None
    if domain is Domain.VERTEX:
        graph, order = ItemGraph(mesh.links, mesh.n_verts), mesh.order
    elif domain is Domain.CELL and order_kept is Order.DROP:
        graph = item_graph(Domain.CELL, mesh.faces, mesh.cell_surface, mesh.n_verts)
        order = mesh.cell_order
    elif domain is Domain.FACE and order_kept is Order.DROP and is_plain:
        graph = item_graph(Domain.FACE, mesh.faces, surface, mesh.n_verts)
        order = mesh.face_order
    elif order_kept is Order.KEEP:
        graph, order = item_graph(domain, mesh.output_faces, surface, mesh.n_verts), None
    else:
        raise InvalidInputError(
            f"track {name!r} has a value per {domain}, whose order would be lost; keep it (",
            Keyword("order", "keep"),
            "), or drop the track",
        )
    mesh.derived[key] = graph, order
    return graph, order
