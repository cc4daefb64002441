"""Long captures: runs of frames are registered on their own, by workers, and joined."""

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor, Future
from contextlib import AbstractContextManager, closing
from functools import partial
from itertools import islice, pairwise, starmap
from typing import TypeVar

from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.registration.capture import Capture, Frames, Surveyed, Topology, survey
from meshreel.registration.growing import REGISTERING, Segment, grow_segments
from meshreel.registration.joining import Chain, Join, best_key, chains, join, joins, merged
from meshreel.registration.stores import Arrays, TemporaryStore
from meshreel.runtime.progress import Count, Progress
from meshreel.runtime.threads import one_blas_thread, results_in_order
from meshreel.runtime.version import __version__
from meshreel.runtime.workers.executors import completed

RUN_FRAMES = 120
"""Frames of a run. Results depend on it, so it does not depend on the number of workers."""

CONTEXT = 2
"""Frames before and after those of a run that tell debris from parts."""

MIN_PENDING = 8
"""Least number of calls that wait for a worker, whose arguments and results are in memory."""

Open = Callable[[], AbstractContextManager[MeshSequence]]
"""Opens some frames of a capture; can be pickled."""

Key = TypeVar("Key")
Result = TypeVar("Result")


def ranges_of(n_frames: int) -> list[range]:
    """Return the frames of each run, whose last one is the first of the next."""
    n_runs = max(1, round(n_frames / RUN_FRAMES))
    starts = [number * n_frames // n_runs for number in range(n_runs)]
    return [*map(range, starts, [*(start + 1 for start in starts[1:]), n_frames])]


def on_worker(
    capture: Capture,
    first: int,
    open_frames: Open,
    version: str,
    function: Callable[..., Result],
    *args: object,
) -> Result:
    """Return the result of a function for opened frames.

    Parameters
    ----------
    first : int
        Number of the first opened frame in the capture.
    version : str
        Version of the caller; raises InvalidInputError for another one.
    """
    if version != __version__:
        raise InvalidInputError(
            f"the worker has meshreel {__version__} and the caller {version}; install the same"
        )
    with open_frames() as sequence, one_blas_thread():
        return function(Frames(capture, sequence, first), *args)


Report = Callable[[str, int], None]
"""Called with a stage and its number of finished frames."""


def survey_run(
    frames: Frames, numbers: range, report: Report = lambda stage, n_done: None
) -> list[Surveyed]:
    """Return what is in some frames."""
    surveyed = []
    for frame in results_in_order(partial(survey, frames), numbers, lambda _: True):
        surveyed.append(frame)
        report("cleaning", len(surveyed))
    return surveyed


def register_run(
    frames: Frames,
    topologies: Mapping[int, Topology | None],
    report: Report = lambda stage, n_done: None,
) -> list[Arrays]:
    """Return the segments of some frames, as arrays."""
    with closing(TemporaryStore()) as store:
        segments = grow_segments(frames, topologies, frames.capture.tolerance, store, report)
        return [segment.arrays() for segment in segments]


def join_run(frames: Frames, segment: Arrays, plan: Join) -> list[Arrays]:
    """Return the segment of another key in the frames of a piece, as arrays."""
    return [join(frames, Segment.of_arrays(segment), plan).arrays()]


class Runs:
    """The runs of a capture, and the workers that register them.

    Parameters
    ----------
    frames : Frames
        All frames of the capture, in this process.
    open_part : callable
        Returns a function that opens a range of frames, also on a worker.
    executor : Executor, optional
        Default: this process.
    n_workers : int
    progress : callable
    """

    def __init__(
        self,
        frames: Frames,
        open_part: Callable[[range], Open],
        executor: Executor | None,
        n_workers: int,
        progress: Progress,
    ) -> None:
        self.ranges: list[range] = ranges_of(frames.capture.n_frames)
        self._capture, self._frames, self._open_part = frames.capture, frames, open_part
        self._executor, self._max_pending = executor, max(MIN_PENDING, 2 * n_workers)
        self._progress = progress

    def survey(self) -> list[Surveyed]:
        """Return what is in each frame."""
        starts = [*(numbers.start for numbers in self.ranges), self._capture.n_frames]

        def call(numbers: range) -> Callable[[], list[Surveyed]]:
            report = partial(self._report, numbers.start)
            return self._call(numbers, survey_run, numbers, report=report)

        found: dict[int, Surveyed] = {}
        parts = starmap(range, pairwise(starts))
        for numbers, frames in self._results((part, call(part)) for part in parts):
            found |= dict(zip(numbers, frames, strict=True))
            self._report(0, "cleaning", len(found))
        return [found[number] for number in sorted(found)]

    def segments(
        self, topologies: Mapping[int, Topology | None], store: TemporaryStore
    ) -> list[Segment]:
        """Register all frames, unless the store has them."""
        by_run: dict[int, list[Segment]] = {}

        def call_of(number: int) -> Callable[[], list[Arrays]]:
            numbers = self.ranges[number]
            own = {frame: topologies[frame] for frame in numbers}
            report = partial(self._report, numbers.start)
            return self._call(numbers, register_run, own, report=report)

        names = {number: f"run_{number}" for number in range(len(self.ranges))}
        for number, segments in self._kept(store, names, call_of):
            by_run[number] = segments
            self._report(0, REGISTERING, sum(len(self.ranges[done]) for done in by_run))
        runs = [(numbers, by_run[number]) for number, numbers in enumerate(self.ranges)]
        finished, waiting = [], [*chains(runs)]
        while waiting:
            joined, waiting = self._join(waiting, topologies, store)
            finished += joined
        return sorted(finished, key=lambda segment: segment.first)

    def _join(
        self, waiting: list[Chain], topologies: Mapping[int, Topology | None], store: TemporaryStore
    ) -> tuple[list[Segment], list[Chain]]:
        """Return a segment of each chain, as far as frames follow its key, and the rest."""
        keys = [best_key(chain, topologies) for chain in waiting]
        plans, names = dict[tuple[int, int], Join](), dict[tuple[int, int], str]()
        for number, (chain, key) in enumerate(zip(waiting, keys, strict=True)):
            for plan in joins(chain, key, self._frames.normalized):
                plans[number, plan.piece], ends = plan, (plan.numbers[0], plan.numbers[-1])
                name = "join_{}_to_{}_{}".format(chain[key].segment.key, *ends)
                names[number, plan.piece] = name

        def join_call(place: tuple[int, int]) -> Callable[[], list[Arrays]]:
            segment, numbers = waiting[place[0]][place[1]]
            return self._call(numbers, join_run, segment.part(numbers).arrays(), plans[place])

        joined: list[dict[int, Segment]] = [{} for _ in waiting]
        n_done = 0
        for (number, piece), segments in self._kept(store, names, join_call):
            (joined[number][piece],) = segments
            n_done += len(plans[number, piece].numbers)
            self._report(0, "joining runs", n_done)
        finished, rest = [], list[Chain]()
        for chain, key, parts in zip(waiting, keys, joined, strict=True):
            segment, others = merged(chain, key, parts, store)
            finished.append(segment)
            rest += others
        return finished, rest

    def _call(
        self, numbers: range, function: Callable[..., Result], *args: object, **options: object
    ) -> Callable[[], Result]:
        """Return a call of a function with the frames; `options` are for this process."""
        if self._executor is None:
            return partial(function, self._frames, *args, **options)
        first, stop = numbers.start - CONTEXT, numbers.stop + CONTEXT
        opened = range(max(first, 0), min(stop, self._capture.n_frames))
        frames = self._capture, opened.start, self._open_part(opened)
        return partial(on_worker, *frames, __version__, function, *args)

    def _kept(
        self,
        store: TemporaryStore,
        names: Mapping[Key, str],
        call_of: Callable[[Key], Callable[[], list[Arrays]]],
    ) -> Iterator[tuple[Key, list[Segment]]]:
        """Yield the segments that the store or calls return, in any order; store those of calls."""
        kept = {key: segments for key in names if (segments := store.kept(names[key])) is not None}
        for key, segments in kept.items():
            yield key, [*map(Segment.of_arrays, segments)]
        calls = ((key, call_of(key)) for key in names if key not in kept)
        for key, segments in self._results(calls):
            yield key, [*map(Segment.of_arrays, store.keep(names[key], segments))]

    def _results(
        self, calls: Iterator[tuple[Key, Callable[[], Result]]]
    ) -> Iterator[tuple[Key, Result]]:
        """Yield the result of each call by its key, in order of completion."""
        if self._executor is None:
            yield from ((key, call()) for key, call in calls)
            return
        pending: dict[Future[Result], Key] = {}
        try:
            while True:
                for key, call in islice(calls, self._max_pending - len(pending)):
                    pending[self._executor.submit(call)] = key
                if not pending:
                    break
                for future in completed(pending):
                    yield pending.pop(future), future.result()
        finally:
            for future in pending:
                future.cancel()

    def _report(self, n_before: int, stage: str, n_done: int) -> None:
        n_frames = self._capture.n_frames
        self._progress(stage, Count(min(n_before + n_done, n_frames), n_frames, "frames"))
