"""Segments of a sequence, coded with one target: a quality, a bound, an error or a size of all."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import count

from meshreel.codec.decoder import SMALL_POSITIONS, TINY_POSITIONS
from meshreel.codec.joining import join_streams
from meshreel.codec.reel.encoding import whole
from meshreel.codec.reel.encoding.block_coder import KgMeter
from meshreel.codec.reel.encoding.block_frames import BlockFrames
from meshreel.codec.reel.encoding.grid_positions import frame_error, suits_one_frame
from meshreel.codec.reel.encoding.target_step import FIRST_STEP, step_within_limit
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.source import Source
from meshreel.codec.targets import TargetKind
from meshreel.runtime.progress import Count, Progress, report_try, silent
from meshreel.runtime.threads import results_in_order

EncodeOne = Callable[[Source, Progress], bytes]

JOINT_TARGETS = (TargetKind.KG, TargetKind.SIZE)
"""Targets of the sequence as a whole, which one step for all segments has to meet."""


def encode_segments(
    encode: EncodeOne, sources: Sequence[Source], progress: Progress
) -> Iterator[bytes]:
    """Yield a stream for each segment; together they meet the target of their options.

    A quality, a step and a bound apply to each segment, relative to the bounding box of all; for a
    KG error and a size, the quantization step that all segments share is searched for.

    Parameters
    ----------
    encode : callable
        Encodes one segment.
    sources : sequence of Source
        The segments, all of one sequence and with the same options.
    progress
        As in `codec.methods.Method.encode`.

    Raises
    ------
    InvalidInputError
        If the target cannot be met.
    """
    config = sources[0].config
    assert isinstance(config, ReelOptions)  # the options of this method
    if config.target.kind in JOINT_TARGETS:
        encode = partial(whole.encode, step=_common_step(sources, progress))
    total, n_done = sum(source.n_frames for source in sources), 0

    def encode_one(source: Source) -> tuple[bytes, int]:
        if _n_positions(source) <= SMALL_POSITIONS:
            return encode(source, silent), source.n_frames

        def report(stage: str, share: float) -> None:
            if stage.partition(",")[0] in ("encoding", "measuring"):
                n_coded = n_done + int(share * source.n_frames)
                progress(stage, Count(n_coded, total, "frames"))

        return encode(source, report), source.n_frames

    progress("encoding", Count(n_done, total, "frames"))
    for stream, n_frames in results_in_order(encode_one, sources, _is_parallel):
        yield stream
        n_done += n_frames
        progress("encoding", Count(n_done, total, "frames"))


def _is_parallel(source: Source) -> bool:
    return TINY_POSITIONS < _n_positions(source) <= SMALL_POSITIONS


def _common_step(sources: Sequence[Source], progress: Progress) -> float:
    """Return the step, in diagonals, with which all segments together meet the target."""
    config = sources[0].config
    assert isinstance(config, ReelOptions)  # the options of this method
    numbers = count(1)
    n_bytes = whole.CACHED_POSITION_BYTES * sum(map(_n_positions, sources))
    fits = config.memory_bytes is None or n_bytes <= config.memory_bytes / 2
    cached = list(_searches(sources)) if fits else None

    def measure(step: float) -> float:
        report_try(progress, next(numbers))
        if config.target.kind is TargetKind.KG:
            meter = KgMeter()
            for source, search in cached or _searches(sources):
                if search is not None:
                    search.add_errors(step, meter)
                    continue
                vertices = source.sequence.read(0, 1)
                spread = BlockFrames(vertices, source.frame).spread
                meter.add_squares(frame_error(source, vertices, step), spread)
            return meter.value

        def encode_one(source: Source) -> bytes:
            return whole.encode(source, silent, step=step)

        streams = results_in_order(encode_one, sources, _is_parallel)
        whole_sequence = sources[0].whole
        assert whole_sequence is not None
        name, timing = whole_sequence.name, whole_sequence.timing
        return float(len(join_streams(list(streams), name=name, timing=timing)))

    start = FIRST_STEP * sources[0].model_size
    has_tracks = any(source.bounds for source in sources)
    return step_within_limit(config, measure, start, has_tracks=has_tracks)


def _searches(sources: Sequence[Source]) -> Iterator[tuple[Source, whole.RateSearch | None]]:
    """Yield each segment with its search, which keeps its blocks; none for one frame on a grid."""
    for source in sources:
        is_frame = suits_one_frame(source)
        yield source, None if is_frame else whole.RateSearch(source, silent)


def _n_positions(source: Source) -> int:
    return source.n_frames * source.sequence.n_verts
