"""Search for the quantization step of a track, and for what predicts it."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from meshreel.arrays import Floats, Values, Vertices
from meshreel.codec.bitstream.container import payload_bytes
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.reel.encoding.analysis import field_targets
from meshreel.codec.reel.encoding.effort import STEPS_OF_BOUND
from meshreel.codec.reel.encoding.rate_control import estimated_bytes, least_cost, sampled
from meshreel.codec.reel.encoding.track_coders import CodedValues, PreparedValues, TrackCoder
from meshreel.codec.reel.normative.fields import PointWeights
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.codec.source import CodedTrack
from meshreel.errors import InvalidInputError
from meshreel.model.tracks import KIND_ROWS, TrackSource

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

NO_FIELDS = np.empty((0, 0))

ROUNDING_VARIANCE = 1.0 / 12.0
"""Variance of a rounded number, in squared steps."""

MAX_POINTS_RATIO = 0.99
"""Weights from points have to save 1 %: a value then needs positions of its block."""

MIN_COMPARED_MODES, MAX_COMPARED_VALUES = 2, 1 << 18
"""Weights are compared by the strongest modes: at least this many, and up to this many values."""


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
    keeps_fields : bool, optional
        Whether to keep the fields of all blocks, for `as_related`.
    candidates : sequence of RelatedTrack, optional
        Earlier tracks that may predict this one.
    """

    def __init__(
        self,
        coder: TrackCoder,
        track: TrackSource,
        pieces: Sequence[slice],
        decoded: DecodedPositions | None = None,
        number: int = 0,
        candidates: Sequence[RelatedTrack] = (),
        *,
        keeps_fields: bool = False,
    ) -> None:
        self._coder, self._track, self._pieces, self._decoded = coder, track, pieces, decoded
        self._number, self._keeps_fields = number, keeps_fields
        self._related: RelatedTrack | None = None
        self._candidates = [
            other
            for other in candidates
            if other.mesh is coder.coder.mesh and other.n_relations < MAX_RELATIONS
        ][::-1][:MAX_CANDIDATES]
        self._sampled = sampled(pieces)
        self._trials: dict[float, tuple[float, float]] = {}
        """Bytes, and the share of them that corrections take, by step."""
        self._best: tuple[float, list[CodedValues]] | None = None
        self._single: PreparedValues | None = None

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
        n_frames, _, n_columns = self._track.shape
        is_single = n_frames * n_columns == 1
        may_follow = bool(KIND_ROWS[self._coder.header.kind].follows)
        if start is not None:
            first = start
        elif is_single:  # its largest error is half a step
            first = self._coder.single_step
        elif may_follow:
            first = self._coder.share / STEPS_OF_BOUND
        else:
            coder = self._coder.with_step(self._coder.share / 2.0).coder
            frames = self._prepare(self._sampled[0]).frames
            n_modes = field_targets(frames, coder.mesh, coder.choices).shape[1]
            n_steps = math.pow(frames.n_frames, 0.27) * math.pow(n_modes, 0.33)
            first = self._coder.share * BOUNDS_PER_STEP / n_steps

        if n_trials is None and self._decoded is not None:
            self._choose_weights(first)
        if may_follow:
            # If positions predict the track, its residuals decide the step.
            step = least_cost(self._size_bytes, first, n_trials=n_trials or MAX_TRIALS)
        else:
            # A second step brings corrections closer to their share of the bytes at the best one.
            steps = [first]
            if not is_single and n_trials != 1:
                self._size_bytes(first)
                change = math.pow(BEST_SHARE / max(self._trials[first][1], 1e-9), SHARE_EXPONENT)
                steps.append(first * min(max(change, MAX_CHANGE[0]), MAX_CHANGE[1]))
            step = min(steps, key=self._size_bytes)

        if self._best is None or self._best[0] != step:
            self._best = step, self._coded_by(self._coder.with_step(step), self._pieces)
        if n_trials is None:
            self._best = step, self._on_grid(step, self._best[1]) or self._best[1]
        return step, self._coded_track(self._best[1])

    @property
    def as_related(self) -> RelatedTrack:
        """The encoded track, after `best`, for those that follow; requires its fields."""
        assert self._best is not None
        blocks = zip(self._pieces, self._best[1], strict=True)
        fields = {piece.start: block.fields for piece, block in blocks}
        related = None if self._coder.grid else self._related
        n_relations = 0 if related is None else related.n_relations + 1
        return RelatedTrack(self._number, self._coder.coder.mesh, fields, n_relations)

    def _coded_track(self, blocks: list[CodedValues]) -> CodedTrack:
        return CodedTrack(self._coder.leading_section(), [block.sections for block in blocks])

    def _on_grid(self, step: float, by_modes: list[CodedValues]) -> list[CodedValues] | None:
        """Encode the track on a grid; None if that takes more bytes than by modes of this step."""
        n_frames, coder, by_step = self._track.shape[0], None, self._coder.with_step(step)
        numbers = numbers_of(self._track)
        if len(numbers) <= FEW_VALUES and np.array_equal(numbers, np.rint(numbers)):
            coder = by_step.of_integers
        coder = by_step.on_grid if coder is None else coder
        if coder is None:
            return None
        size_bytes = self._coded_track(by_modes).size_bytes
        n_sampled = max(2, GRID_SAMPLE // math.prod(self._track.shape[1:]))
        n_sampled = min(n_sampled, self._pieces[0].stop)
        if n_sampled < n_frames:
            # A copy, as a coder remembers its key block.
            sections = replace(coder).code_prepared(self._prepare(slice(0, n_sampled))).sections
            if payload_bytes(sections) * n_frames > size_bytes * n_sampled:
                return None
        blocks = self._coded_by(coder, self._pieces)
        if self._coded_track(blocks).size_bytes >= size_bytes:
            return None
        self._coder = replace(coder)
        return blocks

    @property
    def coder(self) -> TrackCoder:
        """The coder of the best step, after `best`."""
        assert self._best is not None
        return self._coder if self._coder.grid else self._coder.with_step(self._best[0])

    def _choose_weights(self, step: float) -> None:
        """Choose the weights with which the strongest modes of the first block take least bytes."""
        n_learned, piece = self._coder.coder.choices.n_learned, self._sampled[0]
        coder = self._coder.with_step(step).coder
        frames = self._prepare(self._sampled[0]).frames
        n_modes = max(MIN_COMPARED_MODES, MAX_COMPARED_VALUES // frames.n_verts)
        targets = field_targets(frames, coder.mesh, coder.choices)[:, :n_modes]

        def size_bytes(choice: WeightChoice) -> float:
            nugget, n_learned, related = choice
            coder = self._coder.with_weights(nugget, n_learned)
            try:
                size = coder.fields_bytes(targets, self._weights(coder, piece, related))
            except InvalidInputError:  # residuals of a fine step exceed the integers of a stream
                return math.inf
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
        self._trials, self._best, self._single = {}, None, None

    def _size_bytes(self, step: float) -> float:
        if step not in self._trials:
            blocks = self._coded_by(self._coder.with_step(step), self._sampled)
            sizes = [payload_bytes(block.sections) for block in blocks]
            sections = chain.from_iterable(block.sections for block in blocks)
            corrections = sum(len(data) for name, data in sections if name is Section.CORRECTIONS)
            size = estimated_bytes(sizes, len(self._pieces))
            smallest = min((size for size, _ in self._trials.values()), default=math.inf)
            if len(blocks) == len(self._pieces) and size < smallest:
                self._best = step, blocks
            self._trials[step] = size, corrections / sum(sizes)
        return self._trials[step][0]

    def _coded_by(self, coder: TrackCoder, pieces: Sequence[slice]) -> list[CodedValues]:
        blocks = map(coder.code_prepared, map(self._prepare, pieces))
        if self._keeps_fields:
            return list(blocks)
        return [replace(block, fields=NO_FIELDS) for block in blocks]

    def _prepare(self, piece: slice) -> PreparedValues:
        """Return the prepared block of frames; an only block is cached."""
        is_single = self._pieces == [piece]
        if is_single and self._single is not None:
            return self._single
        values, positions = self._track.read(piece.start, piece.stop), None
        if self._decoded is not None and self._coder.surface is not None:
            positions = self._decoded(piece.start, piece.stop)
        weights = self._weights(self._coder, piece, self._related)
        prepared = self._coder.prepare(values, positions, weights)
        if is_single:
            self._single = prepared
        return prepared

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


def numbers_of(track: TrackSource) -> Values:
    """Return the different numbers in the middle of a track, without missing ones."""
    middle = track.shape[0] // 2
    numbers: Values = np.unique(track.read(middle, middle + 1))
    return numbers[~np.isnan(numbers)]
