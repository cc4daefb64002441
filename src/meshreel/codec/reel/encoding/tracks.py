"""Encoding of tracks, with a search for their quantization steps."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np

from meshreel.arrays import Floats, Values, Vertices
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.connectivity.order import inverse_permutation
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.methods import LiveStart
from meshreel.codec.reel.encoding.analysis import field_targets
from meshreel.codec.reel.encoding.effort import STEPS_OF_BOUND
from meshreel.codec.reel.encoding.rate_control import estimated_bytes, least_cost, sampled
from meshreel.codec.reel.encoding.shared_corners import SharedTrack, shared_track
from meshreel.codec.reel.encoding.track_coders import (
    CodedValues,
    ExactTrackCoder,
    PreparedValues,
    TrackCoder,
    exact_coder,
    track_coder,
)
from meshreel.codec.reel.encoding.track_residuals import DifferenceFit, moving_surface
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.reel.normative.points import PointWeights
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.source import CodedMesh, CodedTrack, Source
from meshreel.codec.targets import TargetKind
from meshreel.codec.track_bounds import EXACT, TrackBound, kept_bounds
from meshreel.codec.tracks import Coding, Sharing
from meshreel.model.surface import Domain
from meshreel.model.tracks import KIND_ROWS, TrackSource, value_range
from meshreel.runtime.progress import Count, Progress

RAW_RATIO = 8
"""A track compressed less than this many times is also tried losslessly."""

FEW_VALUES = 16
"""A track with at most this many different numbers in a frame is also tried losslessly."""

MAX_TRIALS = 6
"""Maximum number of steps tried for residuals of a prediction from positions."""

NUGGETS = 13, 7
"""Codes of the nuggets that are tried: 1/32 for smooth fields, 2 for noisy ones."""

MAX_RELATIONS, MAX_CANDIDATES = 8, 6
"""Longest chain of related tracks, and the number of earlier tracks that are compared."""

N_SAMPLED, MIN_SAVED_BITS = 1 << 14, 0.05
"""Related tracks are compared by this many items, the last ones in coding order; the closest is
tried if it promises to save this many bits per number."""

MAX_CACHED_WEIGHTS = 4
"""Number of blocks whose weights are cached."""

BOUNDS_PER_STEP = 1.8
"""The best step for T frames with K modes is about this many bounds / (T^0.27 K^0.33)."""

BEST_SHARE, SHARE_EXPONENT, MAX_CHANGE = 0.04, 0.1, (0.8, 1.4)
"""At the best step, corrections take about this share of the bytes; a second step is the first,
multiplied by the ratio of the shares to this power, within these limits."""

GRID_SAMPLE = 1 << 18
"""Values on a grid are compared with modes by the first frames, up to this many numbers."""

ROUNDING_VARIANCE = 1.0 / 12.0
"""Variance of a rounded number, in squared steps."""

MAX_POINTS_RATIO = 0.99
"""Weights from points have to save 1 %: a value then needs positions of its block."""

MIN_COMPARED_MODES, MAX_COMPARED_VALUES = 2, 1 << 18
"""Weights are compared by the strongest modes: at least this many, and up to this many values."""

MAX_ROWS_SHARE = 0.1
"""If the sharing of corners takes more than this share of the bytes of values, separate values of
corners are tried too."""


def encode_tracks(source: Source, progress: Progress) -> list[CodedTrack]:
    """Encode the tracks of a sequence, each within its bound.

    Those within a bound are encoded once, unless their size decides that of the positions;
    `FollowingTracks` searches for their steps and weights.

    Raises
    ------
    InvalidInputError
        If a bound cannot be guaranteed.
    """
    tracks = []
    for number, (name, bound) in enumerate(source.bounds.items()):
        progress("encoding tracks", Count(number, len(source.bounds), "tracks"))
        track = _with_shared_values(name, source.sequence.tracks[name], bound, source)
        prediction = _prediction(source, track, bound)
        config = source.config
        assert isinstance(config, ReelOptions)  # the options of this method
        has_size = config.target.kind is TargetKind.SIZE
        n_trials = None if has_size and prediction is None else 1
        coded = encode_track(name, track, bound, source, n_trials)
        is_exact = prediction is None and bound == EXACT
        tracks.append(coded if is_exact else replace(coded, prediction=prediction, values=track))
    return tracks


def _with_shared_values(
    name: str, track: TrackSource, bound: TrackBound, source: Source
) -> TrackSource:
    """Return the track of the values that corners share, if it takes fewer bytes than the track."""

    def values_bytes(candidate: TrackSource) -> int:
        return encode_track(name, candidate, bound, source, 1).size_bytes

    shared = shared_track(track, source.mesh)
    if shared is None or shared.sharing is Sharing.VERTICES:
        return shared or track
    size_bytes = values_bytes(shared)
    if len(shared.rows) <= MAX_ROWS_SHARE * size_bytes:
        return shared
    return shared if len(shared.rows) + size_bytes < values_bytes(track) else track


def encode_track(
    name: str,
    track: TrackSource,
    bound: TrackBound,
    source: Source,
    n_trials: int | None = None,
) -> CodedTrack:
    """Encode a track with the step that takes the fewest bytes, including corrections.

    Parameters
    ----------
    n_trials : int, optional
        As of `StepSearch.best`.

    Raises
    ------
    InvalidInputError
        If the bound cannot be guaranteed.
    """
    mesh, pieces = source.mesh, source.pieces
    if bound == EXACT:
        return encode_losslessly(exact_coder(name, track, mesh), track, pieces)
    coder = track_coder(name, track, bound, mesh, value_range(track))
    _, lossy = StepSearch(coder, track, pieces).best(n_trials)
    is_compact = lossy.size_bytes * RAW_RATIO < math.prod(track.shape) * track.dtype.itemsize
    if is_compact and len(_numbers(track)) > FEW_VALUES:
        return lossy
    exact = encode_losslessly(coder.as_exact, track, pieces)
    return min(lossy, exact, key=lambda coded: coded.size_bytes)


def _numbers(track: TrackSource) -> Values:
    """Return the different numbers in the middle of a track, without missing ones."""
    middle = track.shape[0] // 2
    numbers: Values = np.unique(track.read(middle, middle + 1))
    return numbers[~np.isnan(numbers)]


def _prediction(
    source: Source, track: TrackSource, bound: TrackBound
) -> tuple[Coding, float] | None:
    """Return the coding of a track as residuals relative to positions, and its rate, if any.

    Only lossless positions predict lossless values.
    """
    if KIND_ROWS[track.kind].follows == "normals" and bound != EXACT:
        return Coding.ROTATIONS, 0.0
    if not _is_velocity(track):
        return None
    if bound == EXACT and not (source.config.method == LOSSLESS and track.dtype.kind == "f"):
        return None
    fit = DifferenceFit()
    for piece in source.pieces:
        fit.add(track.read(piece.start, piece.stop), source.read(piece))
    return fit.best(source.sequence.timing.fps)


def _is_velocity(track: TrackSource) -> bool:
    """Whether a track contains velocities of vertices, which positions may predict."""
    is_of_vertices = track.domain is Domain.VERTEX
    if isinstance(track, SharedTrack):
        is_of_vertices = track.sharing is Sharing.VERTICES
    return KIND_ROWS[track.kind].follows == "motion" and is_of_vertices


def live_track_coder(
    name: str,
    first: TrackSource,
    bound: TrackBound,
    mesh: CodedMesh,
    decoded: "DecodedPositions | None",
) -> TrackCoder | ExactTrackCoder:
    """Return the coder of a track with the best step for its first block.

    Velocities are predicted from decoded positions if that takes fewer bytes; normals are not,
    because later ones may be unreachable.

    Parameters
    ----------
    name, first, bound, mesh
        As in `encode_track`; only the first block is known.
    decoded : DecodedPositions or None
        Positions of the first block; None disables prediction.

    Raises
    ------
    InvalidInputError
        If the bound cannot be guaranteed.
    """
    if bound == EXACT:
        return exact_coder(name, first, mesh)
    piece = slice(0, first.shape[0])
    coder = track_coder(name, first, bound, mesh, value_range(first))
    search = StepSearch(coder, first, [piece], decoded)
    step, coded = search.best()
    if decoded is not None and _is_velocity(first):
        fit = DifferenceFit()
        in_given_order = decoded(piece.start, piece.stop)
        if not mesh.keeps_vertex_order:
            in_given_order = in_given_order[:, inverse_permutation(mesh.order)]
        fit.add(first.read(piece.start, piece.stop), in_given_order)
        prediction = fit.best()
        if prediction is not None:
            predicted = coder.with_prediction(*prediction, moving_surface(mesh), bound)
            of_residuals = StepSearch(predicted, first, [piece], decoded)
            predicted_step, residual = of_residuals.best()
            if residual.size_bytes < coded.size_bytes:
                return of_residuals.coder.with_step(predicted_step)
    return search.coder.with_step(step)


def live_track_coders(
    start: LiveStart, positions: Callable[[], Vertices] | None
) -> dict[str, TrackCoder | ExactTrackCoder]:
    """Return the coders of tracks that are not dropped, by name; raises as `live_track_coder`."""
    bounds = kept_bounds(start.mesh.config, start.tracks, start.targets)
    decoded = None
    if positions is not None:
        first = cache(positions)  # decoded only if a track needs them, and once for all
        decoded = DecodedPositions(lambda begin, end: first()[begin:end])
    return {
        name: live_track_coder(name, start.tracks[name], bound, start.mesh, decoded)
        for name, bound in bounds.items()
    }


@dataclass(frozen=True, eq=False)
class RelatedTrack:
    """A track from which others may be predicted."""

    number: int
    """Place among the tracks of a sequence."""
    mesh: FieldMesh
    """Hierarchy of its items."""
    fields: Mapping[int, Floats]
    """Fields as in `CodedValues`, by the first frame of the block."""
    n_relations: int
    """Length of the chain of tracks that it is predicted from."""


WeightChoice = tuple[int | None, int, RelatedTrack | None]
"""Code of the nugget of weights from points, number of modes they adapt to, and related track."""


class DecodedPositions:
    """Decoded positions, and the weights that follow from them, for the tracks of a sequence.

    Parameters
    ----------
    read : callable
        Decodes positions of a range of frames, in output order.
    """

    def __init__(self, read: Callable[[int, int], Vertices]) -> None:
        self._read = read
        self._weights: dict[tuple[int, int, int | None], tuple[FieldMesh, PointWeights]] = {}
        """By hierarchy, first frame and nugget; the hierarchies are kept, so that no other one gets
        the same id.
        """

    def __call__(self, start: int, stop: int) -> Vertices:
        """Decode frames start..stop - 1."""
        return self._read(start, stop)

    def weights(self, coder: TrackCoder, start: int) -> PointWeights:
        """Return the initial weights of the block that begins at a frame; the latest are cached."""
        mesh = coder.coder.mesh
        key = id(mesh), start, coder.nugget
        if key not in self._weights:
            while len(self._weights) >= MAX_CACHED_WEIGHTS:
                self._weights.pop(next(iter(self._weights)))
            self._weights[key] = mesh, coder.weights(self._read(start, start + 1)[0])
        return self._weights[key][1]


class StepSearch:
    """Searches for the step with which a track takes the fewest bytes, including corrections.

    Steps of a long track are compared by a sample of its blocks.

    Parameters
    ----------
    pieces : sequence of slice
        Frames of each block.
    decoded : DecodedPositions, optional
        Default: weights follow from connectivity.
    number : int, optional
        Place among the tracks of the sequence.
    candidates : sequence of RelatedTrack, optional
        Earlier tracks that may predict this one.
    """

    def __init__(
        self,
        coder: TrackCoder,
        track: TrackSource,
        pieces: Sequence[slice],
        decoded: "DecodedPositions | None" = None,
        number: int = 0,
        candidates: Sequence[RelatedTrack] = (),
    ) -> None:
        self._coder, self._track, self._pieces, self._decoded = coder, track, pieces, decoded
        self._number = number
        self._related: RelatedTrack | None = None
        self._candidates = [
            other
            for other in candidates
            if other.mesh is coder.coder.mesh and other.n_relations < MAX_RELATIONS
        ][::-1][:MAX_CANDIDATES]
        self._sampled = sampled(pieces)
        self._sizes: dict[float, float] = {}
        self._shares: dict[float, float] = {}
        """Share of the bytes that corrections take, by step."""
        self._best: tuple[float, list[CodedValues]] | None = None

    def best(
        self, n_trials: int | None = None, start: float | None = None
    ) -> tuple[float, CodedTrack]:
        """Return the best of some steps, or of earlier ones, and the track encoded with it.

        Parameters
        ----------
        n_trials : int, optional
            Steps to try for an estimate, with weights from connectivity. Default: enough for the
            final track, whose weights are chosen too.
        start : float, optional
            First step, in diagonals of the range. Default: from the bound and the modes.
        """
        first = self._first_step if start is None else start
        if n_trials is None and self._decoded is not None:
            self._choose_weights(first)
        if self._may_follow:
            step = least_cost(self._size_bytes, first, n_trials=n_trials or MAX_TRIALS)
        else:
            steps = [first] if self._is_single or n_trials == 1 else self._two_steps(first)
            step = min(steps, key=self._size_bytes)
        if self._best is None or self._best[0] != step:
            self._best = step, self._coded(step, self._pieces)
        if n_trials is None:
            self._best = step, self._on_grid(self._best[1]) or self._best[1]
        return step, self._coded_track(self._best[1])

    @property
    def as_related(self) -> RelatedTrack:
        """The encoded track, after `best`, for those that follow."""
        assert self._best is not None
        blocks = zip(self._pieces, self._best[1], strict=True)
        fields = {piece.start: block.fields for piece, block in blocks}
        related = None if self._coder.grid else self._related
        n_relations = 0 if related is None else related.n_relations + 1
        return RelatedTrack(self._number, self._coder.coder.mesh, fields, n_relations)

    def _coded_track(self, blocks: list[CodedValues]) -> CodedTrack:
        return CodedTrack(self._coder.leading_section(), [block.sections for block in blocks])

    def _on_grid(self, by_modes: list[CodedValues]) -> list[CodedValues] | None:
        """Encode the track on a grid; None if that takes more bytes than by modes."""
        n_frames, coder = self._track.shape[0], None
        numbers = _numbers(self._track)
        if len(numbers) <= FEW_VALUES and np.array_equal(numbers, np.rint(numbers)):
            coder = self._coder.of_integers
        coder = self._coder.on_grid if coder is None else coder
        if coder is None:
            return None
        size_bytes = self._coded_track(by_modes).size_bytes
        n_sampled = max(2, GRID_SAMPLE // math.prod(self._track.shape[1:]))
        n_sampled = min(n_sampled, self._pieces[0].stop)
        if n_sampled < n_frames:
            sections = coder.code_prepared(self._prepare(slice(0, n_sampled))).sections
            sampled_bytes = sum(len(payload) for _, payload in sections)
            if sampled_bytes * n_frames > size_bytes * n_sampled:
                return None
        blocks = [coder.code_prepared(block) for block in self._blocks(self._pieces)]
        if self._coded_track(blocks).size_bytes >= size_bytes:
            return None
        self._coder = coder
        return blocks

    @property
    def coder(self) -> TrackCoder:
        """The coder, after `best` with the chosen weights; its step is still to be set."""
        return self._coder

    def _two_steps(self, first: float) -> list[float]:
        """Return a step, and one whose corrections take about the best share of the bytes."""
        self._size_bytes(first)
        low, high = MAX_CHANGE
        change = math.pow(BEST_SHARE / max(self._shares[first], 1e-9), SHARE_EXPONENT)
        return [first, first * min(max(change, low), high)]

    @property
    def _may_follow(self) -> bool:
        """Whether positions may predict the track; its residuals then decide the step."""
        return bool(KIND_ROWS[self._coder.header.kind].follows)

    @property
    def _is_single(self) -> bool:
        """Whether a value is a single number, whose largest error is half a step."""
        return self._track.shape[0] * self._track.shape[2] == 1

    @property
    def _first_step(self) -> float:
        if self._is_single:
            return self._coder.single_step
        if self._may_follow:
            return self._coder.share / STEPS_OF_BOUND
        piece = self._sampled[0]
        coder = self._coder.with_step(self._coder.share / 2.0).coder
        frames = self._prepare(piece).frames
        n_modes = field_targets(frames, coder.mesh, coder.choices).shape[1]
        n_steps = math.pow(frames.n_frames, 0.27) * math.pow(n_modes, 0.33)
        return self._coder.share * BOUNDS_PER_STEP / n_steps

    def _choose_weights(self, step: float) -> None:
        """Choose the weights with which the strongest modes of the first block take least bytes."""
        n_learned, piece = self._coder.coder.choices.n_learned, self._sampled[0]
        coder = self._coder.with_step(step).coder
        frames = self._prepare(piece).frames
        n_modes = max(MIN_COMPARED_MODES, MAX_COMPARED_VALUES // frames.n_verts)
        targets = field_targets(frames, coder.mesh, coder.choices)[:, :n_modes]

        def size_bytes(choice: WeightChoice) -> float:
            nugget, n_learned, related = choice
            coder = self._coder.with_weights(nugget, n_learned)
            size = coder.fields_bytes(targets, self._weights(coder, piece, related))
            return size if nugget is None else size / MAX_POINTS_RATIO

        def best_of(choices: Iterable[WeightChoice]) -> WeightChoice:
            sizes.update((choice, size_bytes(choice)) for choice in choices)
            return min(sizes, key=lambda choice: sizes[choice])

        sizes: dict[WeightChoice, float] = {}
        nugget, _, _ = best = best_of((nugget, n_learned, None) for nugget in (None, *NUGGETS))
        if nugget is not None:
            best = best_of([(nugget, 0, None)])
        closest = self._closest(targets, piece)
        if closest is not None:
            best = best_of([(NUGGETS[0] if nugget is None else nugget, best[1], closest)])
        nugget, n_learned, self._related = best
        self._coder = self._coder.with_weights(nugget, n_learned)
        self._sizes, self._best = {}, None
        self.__dict__.pop("_single", None)

    def _size_bytes(self, step: float) -> float:
        if step not in self._sizes:
            blocks = self._coded(step, self._sampled)
            sizes = [sum(len(payload) for _, payload in block.sections) for block in blocks]
            corrections = (
                len(payload)
                for block in blocks
                for name, payload in block.sections
                if name is Section.CORRECTIONS
            )
            self._shares[step] = sum(corrections) / sum(sizes)
            size = estimated_bytes(sizes, len(self._pieces))
            if len(blocks) == len(self._pieces) and size < min(
                self._sizes.values(), default=math.inf
            ):
                self._best = step, blocks
            self._sizes[step] = size
        return self._sizes[step]

    def _coded(self, step: float, pieces: Sequence[slice]) -> list[CodedValues]:
        coder = self._coder.with_step(step)
        return [coder.code_prepared(prepared) for prepared in self._blocks(pieces)]

    def _blocks(self, pieces: Sequence[slice]) -> Iterable[PreparedValues]:
        """Return the prepared blocks of frames; a single one is cached."""
        return [self._single] if len(pieces) == 1 else map(self._prepare, pieces)

    @cached_property
    def _single(self) -> PreparedValues:
        return self._prepare(self._pieces[0])

    def _prepare(self, piece: slice) -> PreparedValues:
        values, positions = self._track.read(piece.start, piece.stop), None
        if self._decoded is not None and self._coder.surface is not None:
            positions = self._decoded(piece.start, piece.stop)
        weights = self._weights(self._coder, piece, self._related)
        return self._coder.prepare(values, positions, weights)

    def _weights(
        self, coder: TrackCoder, piece: slice, related: RelatedTrack | None
    ) -> PointWeights | None:
        """Return the initial weights of a block that follow from points, if any."""
        if self._decoded is None or coder.nugget is None:
            return None
        weights = self._decoded.weights(coder, piece.start)
        if related is None:
            return weights
        distance, fields = self._number - related.number, related.fields[piece.start]
        return replace(weights, related=distance, fields=fields)

    def _closest(self, targets: Floats, piece: slice) -> RelatedTrack | None:
        """Return the candidate that explains most of what weights from points leave of fields.

        It is None if none promises to save bits.
        """
        levels = self._coder.coder.mesh.hierarchy
        n_coarsest = int(levels.level_starts[1])
        if not self._candidates or self._decoded is None or n_coarsest == len(targets):
            return None
        coder = self._coder.with_weights(NUGGETS[0], 0)
        last = slice(max(len(targets) - N_SAMPLED, n_coarsest), None)
        stencil = levels.stencil[last]
        weights = self._decoded.weights(coder, piece.start).weights[last]
        weights = np.where(stencil < 0, 0.0, weights)

        def innovations(fields: Floats) -> Floats:
            return np.asarray(fields[last] - np.einsum("ij,ijk->ik", weights, fields[stencil]))

        left = innovations(targets)

        def saved_bits(other: RelatedTrack) -> float:
            known = innovations(other.fields[piece.start])
            rest = left - known @ np.linalg.lstsq(known, left, rcond=None)[0]
            before, after = (np.mean(some**2, axis=0) + ROUNDING_VARIANCE for some in (left, rest))
            return float(np.mean(np.log2(before / after))) / 2.0

        closest = max(self._candidates, key=saved_bits)
        return closest if saved_bits(closest) > MIN_SAVED_BITS else None


def encode_losslessly(
    coder: ExactTrackCoder,
    track: TrackSource,
    pieces: Sequence[slice],
    decoded: Callable[[int, int], Vertices] | None = None,
) -> CodedTrack:
    """Encode a track losslessly; parameters as in `StepSearch`."""
    blocks = []
    for piece in pieces:
        positions = None if decoded is None else decoded(piece.start, piece.stop)
        blocks.append(coder.code(track.read(piece.start, piece.stop), positions))
    return CodedTrack(coder.leading_section(), blocks)
