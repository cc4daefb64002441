"""The method `reel`: a source to the sections of a stream that meets its target."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

from meshreel.bitstream.writer import Sections, whole_stream
from meshreel.codec.achieved import measure_stream
from meshreel.codec.source import Source
from meshreel.codec.targets import Aim, Target
from meshreel.errors import InvalidInputError, SolverError
from meshreel.metrics.rate import rate_bpvf
from meshreel.reel.encoding.block_coder import (
    FieldBlockCoder,
    FieldFrames,
    KeyBlock,
    check_promise,
    field_mesh_of,
    largest_rounding,
)
from meshreel.reel.encoding.effort import STEPS_OF_BOUND, checked_step, finest_step, quality_step
from meshreel.reel.encoding.meters import KgMeter, Meter, StedMeter
from meshreel.reel.encoding.rate_control import least_cost, meet_limit
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Count, Progress
from meshreel.runtime.threads import one_ahead
from meshreel.subspace.trajectories import from_matrices

FIRST_QUALITY = 75.0
"""Where the search for an error or a size begins."""

LARGEST_ERROR_STEP = 0.1
"""Coarsest step that is tried to meet an error, in sizes of the model."""

KEPT_BYTES = 36
"""Memory of a position of a block that is kept: as it came, and as coordinate matrices."""


@dataclass(frozen=True)
class Trial:
    """A stream made with a step.

    Attributes
    ----------
    data : bytes
    error : float or None
        What is to be met, where it is an error.
    """

    data: bytes
    error: float | None


class ReelEncoder:
    """Makes streams of a source until one meets the target.

    Parameters
    ----------
    source : Source
    progress : callable
    engine : Engine or None
        Whose workers code the blocks; None codes them here.
    """

    def __init__(self, source: Source, progress: Progress, engine: Engine | None) -> None:
        self._engine = engine
        self._source = source
        self._config = source.config
        self._progress = progress
        self._trials: dict[float, Trial] = {}
        choices = self._config.field_choices
        self._coder = FieldBlockCoder(
            field_mesh_of(source.mesh, choices.stencil_size), source.frame, choices
        )

    def encode(self) -> bytes:
        """The bytes of the stream.

        Raises
        ------
        InvalidInputError
            If no stream meets the target.
        """
        target = self._config.target
        if target.aim is Aim.STEP:
            return self._trial(checked_step(target.value, self._finest_step)).data
        if target.aim is Aim.QUALITY:
            return self._trial(self._step_of(target.value)).data
        if target.aim is Aim.MAX_ERROR:
            return self._within_error(target)
        return self._within_limit(target)

    def _blocks(self) -> Iterable[FieldFrames]:
        """The blocks, ready to be coded: kept for further trials, or read anew for each."""
        if self._keeps_blocks:
            return self._kept_blocks
        return map(self._coder.frames, self._source.blocks())

    @property
    def _is_cut(self) -> bool:
        return self._source.block_frames < self._source.sequence.n_frames

    @cached_property
    def _keeps_blocks(self) -> bool:
        sequence = self._source.sequence
        if not self._is_cut:
            return True
        if self._config.target.aim in (Aim.QUALITY, Aim.STEP):
            return False  # one trial is enough
        kept_bytes = KEPT_BYTES * sequence.n_frames * sequence.n_verts
        memory = self._config.memory_bytes
        return memory is None or kept_bytes <= memory / 2

    @cached_property
    def _kept_blocks(self) -> list[FieldFrames]:
        return [self._coder.frames(vertices) for vertices in self._source.blocks()]

    def _new_meter(self) -> Meter | None:
        """What measures the error that is to be met, if one is."""
        aim = self._config.target.aim
        if aim is Aim.KG:
            return KgMeter(self._source.sequence.extent)
        if aim is not Aim.STED:
            return None
        if not self._keeps_blocks:
            raise InvalidInputError(
                "sted compares frames of the whole sequence, which do not fit into the memory "
                "allowed; allow more, or ask for kg or quality"
            )
        return StedMeter(self._source.mesh.faces)

    def _step_of(self, quality: float) -> float:
        """Step of a quality in diagonals of the whole bounding box, as a trial takes it."""
        return self._step_of_size(quality_step(quality))

    def _step_of_size(self, share: float) -> float:
        """A share of the model's own size in diagonals of the whole bounding box."""
        return share * self._own_diagonal

    @cached_property
    def _own_diagonal(self) -> float:
        return self._source.sequence.extent.mean_diagonal / self._source.frame.scale or 1.0

    @cached_property
    def _finest_step(self) -> float:
        return finest_step(self._source.mesh.n_verts)

    def _trial(self, step: float, bound: float | None = None) -> Trial:
        """The stream of a step; with a bound in diagonals, corrected to keep it.

        Errors are no longer those of a moving surface where the step is as large as the model:
        coarser ones are only tried to keep a budget.
        """
        if not self._config.target.aim.is_budget:
            step = min(step, self._step_of_size(LARGEST_ERROR_STEP))
        step = max(step, self._finest_step)
        if step not in self._trials:
            self._trials[step] = self._made(step, bound)
        return self._trials[step]

    def _made(self, step: float, bound: float | None) -> Trial:
        self._tell(0)
        coder, meter = self._coder.with_step(step, bound), self._new_meter()
        leading = chain(self._source.mesh.leading_sections(), coder.leading_sections())
        if self._engine is not None and meter is None:
            blocks = self._coded_elsewhere(coder)
        else:
            blocks = self._coded(coder, meter)
            if self._is_cut:  # integers of a block are found while those before become bytes
                blocks = one_ahead(blocks)
        data = whole_stream(self._source.header(), leading, self._told(blocks))
        return Trial(data, None if meter is None else meter.value)

    def _told(self, blocks: Iterator[tuple[int, Sections]]) -> Iterator[tuple[int, Sections]]:
        """The blocks, while the listener is told how many of their frames are coded."""
        done = 0
        for n_coded, sections in blocks:
            yield n_coded, sections
            done += n_coded
            self._tell(done)

    def _tell(self, n_done: int) -> None:
        """Tell the listener of frames coded; nothing is all done while another try may follow."""
        is_one_try = self._config.target.aim in (Aim.QUALITY, Aim.STEP)
        stage = "encoding" if is_one_try else f"encoding, try {len(self._trials) + 1}"
        n_frames = self._source.sequence.n_frames
        if is_one_try or n_done < n_frames:
            self._progress(stage, Count(n_done, n_frames, "frames"))

    def _coded(self, coder: FieldBlockCoder, meter: Meter | None) -> Iterator[tuple[int, Sections]]:
        """Frames and sections of each block; all others refer to the first."""
        key: KeyBlock | None = None
        for number, frames in enumerate(self._blocks()):
            coded = coder.code(frames, key, number)
            key = key or coded.key
            if meter is not None:
                matrices = coded.frames_of(slice(None))
                decoded = from_matrices(matrices, coder.frame, frames.vertices.dtype)
                meter.add(frames.vertices, decoded)
            yield len(frames.vertices), coded.sections

    def _coded_elsewhere(self, coder: FieldBlockCoder) -> Iterator[tuple[int, Sections]]:
        """The same, where workers code all blocks but the first."""
        assert self._engine is not None
        first, *others = self._source.pieces()
        frames = coder.frames(first.read())
        coded = coder.code(frames)
        yield len(frames.vertices), coded.sections
        items = ((piece, coded.key, number) for number, piece in enumerate(others, start=1))
        yield from self._engine.map_in_order(coder.code_piece, items)

    @cached_property
    def _rounding(self) -> float:
        """Largest error of a position in diagonals that its number type alone makes."""
        extent = self._source.sequence.extent
        low, high = float(extent.low.min()), float(extent.high.max())
        return largest_rounding(low, high, self._source.sequence.dtype, self._source.frame)

    def _within_limit(self, target: Target) -> bytes:
        """The stream that comes nearest to the target's number from below."""
        found: dict[float, float] = {}

        def measured(step: float) -> float:
            if step not in found:
                found[step] = self._measure(self._trial(step))
            return found[step]

        start = self._step_of(FIRST_QUALITY)
        step = meet_limit(measured, target.value, start, rises=not target.aim.is_budget)
        if step is None:
            raise InvalidInputError(
                f"{target.aim.value} {target.value:g} cannot be met: the best stream has "
                f"{min(found.values()):g}; " + _remedy(target.aim)
            )
        return self._trial(step).data

    def _measure(self, trial: Trial) -> float:
        """The error, the bytes or the rate of a trial: what its target limits."""
        if trial.error is not None:
            return trial.error
        if self._config.target.aim is Aim.SIZE:
            return float(len(trial.data))
        sequence = self._source.sequence
        return rate_bpvf(len(trial.data), sequence.n_verts, sequence.n_frames)

    def _within_error(self, target: Target) -> bytes:
        """The smallest stream found that keeps every vertex within a bound."""
        percent = target.bound.percent(self._source.frame.scale)
        bound = percent / 100.0
        try:
            check_promise(bound, self._rounding, self._source.sequence.dtype)
        except InvalidInputError as error:
            if not target.is_length:
                raise
            length = f"{target.value:g} model units are {percent:.3g} % of the diagonal"
            raise InvalidInputError(f"{length}: {error}") from None
        step = least_cost(lambda step: len(self._trial(step, bound).data), bound / STEPS_OF_BOUND)
        data = self._trial(step, bound).data
        achieved = measure_stream(
            self._source.sequence, data, order=self._config.order, progress=self._progress
        )
        if achieved.max_error_percent > percent:
            raise SolverError(
                f"max_error {percent:g} was not kept: the stream decodes to "
                f"{achieved.max_error_percent:g}; nothing is written; please report this sequence"
            )
        return data


def _remedy(aim: Aim) -> str:
    if aim.is_budget:
        return 'allow more, or leave the order out (order="drop")'
    return "positions come back no nearer than their number type; allow more"
