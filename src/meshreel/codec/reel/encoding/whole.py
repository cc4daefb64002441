"""Encoding of whole sequences: trial streams until one meets the target."""

import math
from collections.abc import Iterable, Iterator
from functools import cached_property
from itertools import chain, starmap

import numpy as np

from meshreel.codec.achieved import measure_stream, measure_tracks
from meshreel.codec.bitstream.container import Sections, payload_bytes
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel.encoding import grid_positions
from meshreel.codec.reel.encoding.block_coder import FieldBlockCoder, KeyedBlocks, KgMeter, coder_of
from meshreel.codec.reel.encoding.block_frames import BlockFrames, largest_rounding
from meshreel.codec.reel.encoding.effort import FINEST_STEP
from meshreel.codec.reel.encoding.following_tracks import FollowingTracks
from meshreel.codec.reel.encoding.grid_positions import GridBids, suits_one_frame
from meshreel.codec.reel.encoding.rate_control import estimated_bytes, least_cost, sampled
from meshreel.codec.reel.encoding.target_step import step_for_target
from meshreel.codec.reel.encoding.tracks import encode_tracks
from meshreel.codec.reel.encoding.visibility import MAX_BLOCKS, Steps, steps_of_quality
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.source import Source
from meshreel.codec.targets import TargetKind
from meshreel.errors import Keyword, SolverError
from meshreel.model.sequence import MeshSequence, is_still
from meshreel.model.tracks import error_bound_of
from meshreel.runtime.progress import Count, Progress, report_try, silent
from meshreel.runtime.threads import one_blas_thread

SINGLE_TRIALS = TargetKind.QUALITY, TargetKind.STEP
"""Targets that set the step, without a search."""

LARGEST_ERROR_STEP = 0.1
"""Coarsest step of a search for an error, in diagonals of the model."""

SLACK = 1e-9
"""Relative tolerance of measured errors of tracks, for rounding in the measurement."""

CACHED_POSITION_BYTES = 36
"""Memory of a position of a cached block: the original, and coordinate matrices."""


@one_blas_thread()  # set once, because each limit waits for another thread
def encode(source: Source, progress: Progress, *, step: float | None = None) -> bytes:
    """Encode the source to a stream that meets its target; segments of one frame on a grid.

    Parameters
    ----------
    source : Source
    progress : callable
    step : float, optional
        Quantization step, in diagonals, that is known to meet the target.

    Raises
    ------
    InvalidInputError
        If no stream meets the target.
    """
    config = source.config
    assert isinstance(config, ReelOptions)  # the options of this method
    if source.whole is not None and suits_one_frame(source):
        if step is None and config.target.kind is not TargetKind.MAX_ERROR:
            step, _ = step_for_target(config, RateSearch(source, progress))
        return grid_positions.encode(source, progress, step)
    if source.bounds:
        source = source.with_changes(tracks=encode_tracks(source, progress))
    sequence = RateSearch(source, progress, has_step=step is not None)
    bound = None
    if step is None:
        step, bound = step_for_target(config, sequence, has_tracks=bool(source.tracks))
    following = FollowingTracks(source, progress) if source.tracks else None
    if following is not None:
        step = sequence.step_for_tracks(following, step, bound)
    data = sequence.stream(step, bound)
    has_one_shape = is_still(source.sequence)
    on_grid: float | None = step if bound is None else None
    if config.target.kind is TargetKind.QUALITY and not has_one_shape:
        on_grid = sequence.steps_of_quality(config.target.value).grid / sequence.diagonal
    bids = GridBids(source, has_one_shape, on_grid, len(data))
    # A single trial has already reported all frames.
    reported = silent if config.target.kind in SINGLE_TRIALS else progress
    streams: Iterable[tuple[bytes, Source]] = chain([(data, source)], bids.streams(reported))

    def with_tracks(data: bytes, of: Source) -> tuple[bytes, Source]:
        tracks = following if of is source else FollowingTracks(of, progress)
        return data if tracks is None else tracks.stream(data), of

    are_predicted = any(track.prediction is not None for track in source.tracks)
    if are_predicted:  # their size depends on the positions
        streams = starmap(with_tracks, streams)
    data, smallest = min(streams, key=lambda stream: len(stream[0]))
    if source.tracks and not are_predicted:
        data, _ = with_tracks(data, smallest)
    if bound is not None or source.tracks:
        _check_bounds(source, data, bound, progress)
    return data


def _check_bounds(source: Source, data: bytes, bound: float | None, progress: Progress) -> None:
    """Raise SolverError if a position or a value of a track exceeds its bound."""
    if bound is None:
        tracks = measure_tracks(source.sequence, data) if source.tracks else {}
    else:
        original = MeshSequence.of_segments([source.sequence])
        achieved = measure_stream(original, data, extent=source.extent, progress=progress)
        tracks = achieved.tracks
        if achieved.max_error_percent > 100.0 * bound:
            raise SolverError(
                Keyword("max_error"),
                f" {100.0 * bound:g} was exceeded: the largest error is "
                f"{achieved.max_error_percent:g}; nothing is written; please report this sequence",
            )
    for track in whole_stream(data).tracks:
        largest = tracks[track.name].largest
        earlier = error_bound_of(source.sequence.tracks[track.name]) or 0.0
        bound = 0.0 if track.is_exact else track.bound - earlier
        if largest > bound * (1.0 + SLACK):
            raise SolverError(
                f"track {track.name!r} decodes to errors of up to {largest:g}, above its bound of "
                f"{bound:g}; nothing is written; please report this sequence"
            )


class RateSearch:
    """Rate model of a whole sequence; caches the coded blocks of every trial.

    Parameters
    ----------
    source, progress
        As in `encode`.
    has_step : bool
        Whether the step is known, so that a single trial is reported.

    Attributes
    ----------
    dtype : dtype
        Number type of the positions.
    """

    def __init__(self, source: Source, progress: Progress, *, has_step: bool = False) -> None:
        self._source, self._has_step = source, has_step
        self._n_frames = source.n_frames
        self._sampled = sampled(source.pieces)
        self.dtype: np.dtype[np.floating] = source.dtype
        config = source.config
        assert isinstance(config, ReelOptions)  # the options of this method
        self._target = config.target
        self._progress = progress
        self._coded: dict[float, list[tuple[int, Sections]]] = {}
        self._errors: dict[float, float] = {}
        self._steps: dict[float, Steps] = {}
        self._best: tuple[float, list[tuple[int, Sections]]] | None = None

    @cached_property
    def _coder(self) -> FieldBlockCoder:
        return coder_of(self._source.mesh, self._source.frame)

    @property
    def diagonal(self) -> float:
        """Diagonal of the bounding box of all frames, in model units."""
        return self._source.frame.scale

    @cached_property
    def model_size(self) -> float:
        """Mean diagonal of single frames, in diagonals of the bounding box."""
        return self._source.model_size

    def steps_of_quality(self, quality: float) -> Steps:
        """Return the steps of a quality, in model units."""
        if quality not in self._steps:
            pieces = self._source.pieces
            pieces = pieces[:: math.ceil(len(pieces) / MAX_BLOCKS)]
            blocks = map(self._source.read, pieces)
            size = self.model_size * self.diagonal
            faces = self._source.mesh.given_faces
            self._steps[quality] = steps_of_quality(quality, faces, blocks, size)
        return self._steps[quality]

    def step_of_quality(self, quality: float) -> float:
        """Return the step of a quality, in diagonals."""
        return self.steps_of_quality(quality).modes / self.diagonal

    @cached_property
    def rounding(self) -> float:
        """Largest rounding error of a position by its number type, in diagonals."""
        extent = self._source.sequence.extent
        low, high = float(extent.low.min()), float(extent.high.max())
        return largest_rounding(low, high, self.dtype, self._source.frame)

    def size_bytes(self, step: float, bound: float) -> float:
        """Return the bytes of the blocks of a step, with corrections that keep a bound.

        Those of a long sequence are estimated from a sample.
        """
        step, pieces = self._limited(step), self._sampled
        if len(pieces) == len(self._source.pieces):
            blocks = self._coded_blocks(step, bound)
            return sum(len(payload) for _, sections in blocks for _, payload in sections)
        keyed = KeyedBlocks(self._coder.with_step(step, bound))
        coded = (keyed.code(frames).sections for frames in self._read_blocks(pieces))
        return estimated_bytes(list(map(payload_bytes, coded)), len(self._source.pieces))

    def measure(self, step: float) -> float:
        """Return the KG error or the bytes for a step."""
        if self._target.kind is TargetKind.KG:
            return self._error(step)
        return float(len(self.stream(step)))

    def step_for_tracks(
        self, following: FollowingTracks, step: float, bound: float | None
    ) -> float:
        """Return a step, or a finer one if positions and tracks then take fewer bytes together.

        Finer positions predict velocities and normals better. A step that is an option, or meets a
        size, is returned unchanged.
        """
        if self._target.kind in (TargetKind.STEP, TargetKind.SIZE):
            return step
        coarsest = self.stream(step, bound)
        sizes = {step: following.size_bytes(coarsest)}
        if not following.may_gain_from_finer(coarsest, sizes[step]):
            return step

        def cost(finer: float) -> float:
            if finer > step:
                return math.inf
            if finer not in sizes:
                sizes[finer] = following.size_bytes(self.stream(finer, bound))
            return sizes[finer]

        return least_cost(cost, step, ratio=2.0)

    def stream(self, step: float, bound: float | None = None) -> bytes:
        """Return the stream of a step, with corrections for a bound in diagonals, if any."""
        coded = self._coded_blocks(self._limited(step), bound)
        return self._source.stream([], coded, bound)

    def _limited(self, step: float) -> float:
        """Limit a step to the allowed range.

        A search for an error stops at steps as large as the model, where the error measures no
        surface any more. A size may need a coarser step, and a step that is an option is unchanged.
        """
        if self._target.kind in (TargetKind.KG, TargetKind.MAX_ERROR):
            step = min(step, LARGEST_ERROR_STEP * self.model_size)
        return max(step, FINEST_STEP)

    def _error(self, step: float) -> float:
        """Return the KG error for a step, without entropy coding.

        The integers of the best step so far are cached.
        """
        step = self._limited(step)
        if step not in self._errors:
            self._report(0)
            meter, blocks = KgMeter(), KeyedBlocks(self._coder.with_step(step, None))
            coded = list(self._with_progress(self._metered(blocks, meter)))
            self._errors[step] = meter.value
            is_better = self._best is None or step > self._best[0]
            if self._caches_blocks and is_better and meter.value <= self._target.value:
                self._best = step, coded
        return self._errors[step]

    def add_errors(self, step: float, meter: KgMeter) -> None:
        """Add the errors of all frames, coded with a step, to a meter."""
        blocks = KeyedBlocks(self._coder.with_step(self._limited(step), None))
        for _ in self._metered(blocks, meter):
            pass

    def _metered(self, blocks: KeyedBlocks, meter: KgMeter) -> Iterator[tuple[int, Sections]]:
        for frames in self._blocks():
            coded = blocks.code(frames)
            meter.add(frames, coded)
            yield frames.n_frames, coded.sections

    def _coded_blocks(self, step: float, bound: float | None) -> list[tuple[int, Sections]]:
        """Return frames and sections of each block for a step, with corrections for a bound."""
        if step in self._coded:
            return self._coded[step]
        self._report(0)
        blocks: Iterator[tuple[int, Sections]]
        if self._best is not None and self._best[0] == step:
            blocks = iter(self._best[1])
            self._best = None  # sections can be iterated once
        else:
            keyed = KeyedBlocks(self._coder.with_step(step, bound))
            blocks = ((frames.n_frames, keyed.code(frames).sections) for frames in self._blocks())
        reported = self._with_progress(blocks)
        self._coded[step] = [(n_frames, list(sections)) for n_frames, sections in reported]
        return self._coded[step]

    def _blocks(self) -> Iterable[BlockFrames]:
        """Return the blocks, cached for further trials or re-read for each."""
        if self._caches_blocks:
            return self._cached_blocks
        return self._read_blocks(self._source.pieces)

    @cached_property
    def _caches_blocks(self) -> bool:
        if self._source.block_frames >= self._n_frames:  # one block
            return True
        if self._target.kind in SINGLE_TRIALS:
            return False
        cached_bytes = CACHED_POSITION_BYTES * self._n_frames * self._source.sequence.n_verts
        memory = self._source.config.memory_bytes
        return memory is None or cached_bytes <= memory / 2

    @cached_property
    def _cached_blocks(self) -> list[BlockFrames]:
        return list(self._read_blocks(self._source.pieces))

    def _read_blocks(self, pieces: Iterable[slice]) -> Iterator[BlockFrames]:
        source = self._source
        return (self._coder.frames(source.read(piece), source.mesh.order) for piece in pieces)

    def _with_progress(
        self, blocks: Iterator[tuple[int, Sections]]
    ) -> Iterator[tuple[int, Sections]]:
        """Yield the blocks, and report the number of encoded frames."""
        n_done = 0
        for n_coded, sections in blocks:
            yield n_coded, sections
            n_done += n_coded
            self._report(n_done)

    def _report(self, n_done: int) -> None:
        """Report encoded frames, of a search as a share of its tries."""
        if self._target.kind in SINGLE_TRIALS or self._has_step:
            self._progress("encoding", Count(n_done, self._n_frames, "frames"))
        else:
            number = 1 + len(self._coded) + len(self._errors)
            report_try(self._progress, number, n_done / self._n_frames)
