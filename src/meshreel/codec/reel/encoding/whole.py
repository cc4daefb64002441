"""Sequences that are all there: streams are made of them until one meets the target."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property

import numpy as np

from meshreel.codec.achieved import measure_stream
from meshreel.codec.bitstream.container import Sections
from meshreel.codec.reel.encoding.block_coder import (
    FieldBlockCoder,
    FieldFrames,
    KeyBlock,
    KeyedBlocks,
    coder_of,
    largest_rounding,
)
from meshreel.codec.reel.encoding.effort import finest_step
from meshreel.codec.reel.encoding.following_tracks import FollowingTracks
from meshreel.codec.reel.encoding.grid_positions import may_lie_on_grid, on_grid
from meshreel.codec.reel.encoding.meters import KgMeter, Meter, StedMeter
from meshreel.codec.reel.encoding.rate_control import least_cost
from meshreel.codec.reel.encoding.smoothness import sampled_frames, step_share
from meshreel.codec.reel.encoding.target_step import aimed
from meshreel.codec.reel.encoding.tracks import coded_tracks
from meshreel.codec.source import Source
from meshreel.codec.targets import TargetKind
from meshreel.errors import InvalidInputError, SolverError
from meshreel.metrics.rate import rate_bpvf
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Count, Progress
from meshreel.runtime.threads import prefetch

LARGEST_ERROR_STEP = 0.1
"""Coarsest step that is tried to meet an error, in sizes of the model."""

KEPT_BYTES = 36
"""Memory of a position of a block that is kept: as it came, and as coordinate matrices."""


def encode(source: Source, progress: Progress, engine: Engine | None) -> bytes:
    """The bytes of a stream of the source that meets its target.

    Parameters
    ----------
    source : Source
    progress : callable
    engine : Engine or None
        Whose workers code the blocks; None codes them here.

    Raises
    ------
    InvalidInputError
        If no stream meets the target.
    """
    if source.bounds:
        source = replace(source, tracks=coded_tracks(source, progress))
    sequence = WholeSequence(source, progress, engine)
    step, bound = aimed(source.config, sequence, has_tracks=bool(source.tracks))
    following = FollowingTracks(source, progress) if source.tracks else None
    if following is not None:
        step = sequence.step_for_tracks(following, step, bound)
    data = sequence.stream(step, bound)
    other = None
    if bound is not None and may_lie_on_grid(source, len(data)):
        other = on_grid(source, progress, engine)
    if following is not None:
        data = following.stream(data)
    if other is not None:
        data = min(data, other, key=len)
    if bound is not None:
        achieved = measure_stream(
            source.sequence, data, order=source.config.order, progress=progress
        )
        if achieved.max_error_percent > 100.0 * bound:
            raise SolverError(
                f"max_error {100.0 * bound:g} was not kept: the stream decodes to "
                f"{achieved.max_error_percent:g}; nothing is written; please report this sequence"
            )
    return data


class WholeSequence:
    """A sequence that is all there, as `kind.Material` has it; every stream made of it is kept.

    Parameters
    ----------
    source, progress, engine
        As `encode` takes them.

    Attributes
    ----------
    dtype : dtype
        Number type of the positions.
    finest_step : float
        The finest step that it can be coded with.
    """

    def __init__(self, source: Source, progress: Progress, engine: Engine | None) -> None:
        self._source = source
        self._n_frames, self.dtype = source.n_frames, source.dtype
        self._target = source.config.target
        self._progress = progress
        self._engine = engine
        self._streams: dict[float, bytes] = {}
        self._errors: dict[float, float] = {}
        self._best: tuple[float, list[tuple[int, Sections]]] | None = None
        self._coder = coder_of(source.mesh, source.frame)
        self.finest_step = finest_step()

    @property
    def diagonal(self) -> float:
        """Of the bounding box of all frames, in model units."""
        return self._source.frame.scale

    @cached_property
    def own_diagonal(self) -> float:
        """Of the model itself, the mean of all frames, in diagonals of the bounding box."""
        return self._source.sequence.extent.mean_diagonal / self.diagonal or 1.0

    @cached_property
    def step_share(self) -> float:
        """The step for this surface by the usual one of a quality."""
        sequence, mesh = self._source.sequence, self._source.mesh
        numbers = sampled_frames(self._n_frames)
        frames = [sequence.read(number, number + 1) for number in numbers]
        return step_share(mesh.given_faces, mesh.n_verts, np.concatenate(frames))

    @cached_property
    def rounding(self) -> float:
        """Largest error of a position, in diagonals, that its number type alone makes."""
        extent = self._source.sequence.extent
        low, high = float(extent.low.min()), float(extent.high.max())
        return largest_rounding(low, high, self.dtype, self._source.frame)

    def size_bytes(self, step: float, bound: float) -> float:
        """Bytes of the stream with a step, corrected to keep a bound in diagonals."""
        return len(self.stream(step, bound))

    def measured(self, step: float) -> float:
        """The error, the bytes or the bits for each vertex and frame, with a step."""
        if self._target.kind in (TargetKind.KG, TargetKind.STED):
            return self._error(step)
        size_bytes = len(self.stream(step))
        if self._target.kind is TargetKind.SIZE:
            return float(size_bytes)
        sequence = self._source.sequence
        return rate_bpvf(size_bytes, sequence.n_verts, self._n_frames)

    def step_for_tracks(
        self, following: FollowingTracks, step: float, bound: float | None
    ) -> float:
        """A step, or a finer one with which positions and the tracks that follow take fewer bytes.

        Velocities and normals are predicted from decoded positions, the better the finer these are.
        A step that was asked for stays, and so does one that meets a budget.
        """
        if self._target.kind is TargetKind.STEP or self._target.kind.is_budget:
            return step
        coarsest = self.stream(step, bound)
        sizes = {step: following.size_bytes(coarsest)}
        if not following.may_want_finer(coarsest, sizes[step]):
            return step

        def cost(finer: float) -> float:
            if finer > step:
                return math.inf
            if finer not in sizes:
                sizes[finer] = following.size_bytes(self.stream(finer, bound))
            return sizes[finer]

        return least_cost(cost, step, ratio=2.0)

    def stream(self, step: float, bound: float | None = None) -> bytes:
        """The stream of a step; with a bound in diagonals, corrected to keep it."""
        step = self._possible(step)
        if step not in self._streams:
            self._streams[step] = self._made(step, bound)
        return self._streams[step]

    def _possible(self, step: float) -> float:
        """A step, or the nearest that makes sense.

        Errors are no longer those of a moving surface where the step is as large as the model:
        a search for an error goes no farther. A budget may need more, and a step that was asked
        for is taken as it is.
        """
        if self._target.kind in (TargetKind.KG, TargetKind.STED, TargetKind.MAX_ERROR):
            step = min(step, LARGEST_ERROR_STEP * self.own_diagonal)
        return max(step, self.finest_step)

    def _error(self, step: float) -> float:
        """The error that is to be met, with a step.

        Nothing becomes bytes; the integers of the best step so far are kept.
        """
        step = self._possible(step)
        if step not in self._errors:
            self._tell(0)
            meter, blocks = self._new_meter(), KeyedBlocks(self._coder.with_step(step, None))
            coded = list(self._told(self._metered(blocks, meter)))
            self._errors[step] = meter.value
            is_better = self._best is None or step > self._best[0]
            if self._keeps_blocks and is_better and meter.value <= self._target.value:
                self._best = step, coded
        return self._errors[step]

    def _metered(self, blocks: KeyedBlocks, meter: Meter) -> Iterator[tuple[int, Sections]]:
        for frames in self._blocks():
            coded = blocks.code(frames)
            meter.add(frames, coded)
            yield frames.block.n_frames, coded.sections

    def _made(self, step: float, bound: float | None) -> bytes:
        self._tell(0)
        coder = self._coder.with_step(step, bound)
        leading = list(coder.leading_sections())
        blocks: Iterator[tuple[int, Sections]]
        if self._best is not None and self._best[0] == step:
            blocks = iter(self._best[1])
            self._best = None  # sections can be taken once
        elif self._engine is not None and not self._errors:
            blocks = self._coded_elsewhere(coder, self._engine)
        else:
            blocks = self._coded(coder)
            if self._is_cut:  # integers of a block are found while those before become bytes
                blocks = prefetch(blocks)
        coded = [(n_frames, list(sections)) for n_frames, sections in self._told(blocks)]
        return self._source.stream(leading, coded)

    def _coded(self, coder: FieldBlockCoder) -> Iterator[tuple[int, Sections]]:
        """Frames and sections of each block."""
        read, blocks = self._blocks(), KeyedBlocks(coder)
        for frames in read:
            yield frames.block.n_frames, blocks.code(frames).sections

    def _coded_elsewhere(
        self, coder: FieldBlockCoder, engine: Engine
    ) -> Iterator[tuple[int, Sections]]:
        """The same, where workers code all blocks but the first.

        Where one of them becomes a key block, what was begun behind it is begun anew.
        """
        first, *others = self._source.pieces()
        frames = coder.frames(first.read_given(), first.order)
        coded = coder.code(frames)
        yield frames.block.n_frames, coded.sections
        key: KeyBlock | None = coded.key
        while others:
            items = ((piece, key, number) for number, piece in enumerate(others, start=1))
            n_coded = 0
            for found in engine.map_in_order(coder.code_piece, items):
                yield found.n_frames, found.sections
                n_coded += 1
                if found.key is not None:
                    key = found.key
                    break
            others = others[n_coded:]

    def _blocks(self) -> Iterable[FieldFrames]:
        """The blocks, ready to be coded: kept for further trials, or read anew for each."""
        if self._keeps_blocks:
            return self._kept_blocks
        return self._read_blocks()

    @property
    def _is_cut(self) -> bool:
        return self._source.block_frames < self._n_frames

    @property
    def _is_one_try(self) -> bool:
        return self._target.kind in (TargetKind.QUALITY, TargetKind.STEP)

    @cached_property
    def _keeps_blocks(self) -> bool:
        sequence = self._source.sequence
        if not self._is_cut:
            return True
        if self._is_one_try:
            return False
        kept_bytes = KEPT_BYTES * self._n_frames * sequence.n_verts
        memory = self._source.config.memory_bytes
        return memory is None or kept_bytes <= memory / 2

    @cached_property
    def _kept_blocks(self) -> list[FieldFrames]:
        return list(self._read_blocks())

    def _read_blocks(self) -> Iterator[FieldFrames]:
        pieces = self._source.pieces()
        return (self._coder.frames(piece.read_given(), piece.order) for piece in pieces)

    def _new_meter(self) -> Meter:
        """A meter of the error that is to be met."""
        if self._target.kind is TargetKind.KG:
            return KgMeter()
        if not self._keeps_blocks:
            raise InvalidInputError(
                "sted compares frames of the whole sequence, which do not fit into the memory "
                "allowed; allow more, or ask for kg or quality"
            )
        return StedMeter(self._source.mesh.faces)

    def _told(self, blocks: Iterator[tuple[int, Sections]]) -> Iterator[tuple[int, Sections]]:
        """The blocks, while the listener is told how many of their frames are coded."""
        done = 0
        for n_coded, sections in blocks:
            yield n_coded, sections
            done += n_coded
            self._tell(done)

    def _tell(self, n_done: int) -> None:
        """Tell the listener of frames coded; nothing is all done while another try may follow."""
        number = 1 + len(self._streams) + len(self._errors)
        stage = "encoding" if self._is_one_try else f"encoding, try {number}"
        if self._is_one_try or n_done < self._n_frames:
            self._progress(stage, Count(n_done, self._n_frames, "frames"))
