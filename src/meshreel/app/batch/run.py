"""Encoding of the inputs of a plan by an engine."""

import os
import threading
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import monotonic
from typing import Any

from meshreel.app.batch.discovery import BatchInput
from meshreel.app.batch.encode_input import Encoded, EncodeOptions, encode_input
from meshreel.app.batch.manifest import DONE, FAILED, Record
from meshreel.app.batch.plan import Plan
from meshreel.app.batch.report import write_report
from meshreel.errors import MeshReelError, StoreError
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.version import __version__

MANIFEST_SHARE, QUICK_S = 0.1, 0.02
"""Share of the time for writing the manifest, unless that is quick: stores are slow, and with many
inputs it is large.
"""


@dataclass(frozen=True)
class BatchReport:
    """The outcome of a run.

    Attributes
    ----------
    up_to_date, encoded, failed : dict of str to Record
        Records by input name.
    """

    up_to_date: dict[str, Record]
    encoded: dict[str, Record]
    failed: dict[str, Record]

    @property
    def summary(self) -> str:
        """Text with the number of each."""
        return (
            f"{len(self.up_to_date)} up to date, {len(self.encoded)} encoded, "
            f"{len(self.failed)} failed"
        )

    def as_dict(self) -> dict[str, Any]:
        """All records in plain types, for JSON."""
        groups = asdict(self)
        return {
            **{group: len(records) for group, records in groups.items()},
            "inputs": {
                name: {"outcome": group, **record}
                for group, records in groups.items()
                for name, record in records.items()
            },
        }


def run_batch(plan: Plan, engine: Engine | None, *, progress: Progress = silent) -> BatchReport:
    """Encode the inputs of a plan; inputs fail independently.

    The stream of each input is written atomically, so finished inputs remain if the run is stopped.
    The manifest is written after each input, but slow writes (many inputs, a store) take at most a
    tenth of the time: if the run is killed, inputs that it does not list as done are encoded again.
    Manifest and report are complete at the end, or when the run is stopped.

    Parameters
    ----------
    engine : Engine or None
        None only if there is nothing to encode.
    progress : callable, optional
        Called with the completed fraction of inputs.
    """
    run = _Run(plan)
    run.begin()
    try:
        if engine is not None:
            _encode_all(run, plan, engine, progress)
    finally:
        run.end()
    return run.report()


def _encode_all(run: "_Run", plan: Plan, engine: Engine, progress: Progress) -> None:
    outcomes = _spread(plan, engine) if _is_spread(plan, engine) else _one_each(plan, engine)
    n_inputs, n_writers = len(plan.to_encode), plan.folder.n_writers
    progress(_stage(engine), Count(0, n_inputs, "inputs"))
    # Ctrl-C does not interrupt these threads, and waits for them: every stream gets its record.
    with ThreadPoolExecutor(n_writers, "meshreel-write") as writers:
        writing: deque[Future[None]] = deque()
        for n_encoded, (one, outcome) in enumerate(outcomes, start=1):
            writing.append(writers.submit(run.finish, one, outcome))
            del outcome  # releases its stream during the wait for the next
            if len(writing) == n_writers:
                writing.popleft().result()
            progress(_stage(engine), Count(n_encoded, n_inputs, "inputs"))
        for future in writing:
            future.result()


def _is_spread(plan: Plan, engine: Engine) -> bool:
    """Whether workers share the blocks of each input: there are more workers than inputs."""
    return plan.options.are_cut and len(plan.to_encode) < engine.n_workers


def _one_each(plan: Plan, engine: Engine) -> Iterator[tuple[BatchInput, "Future[Encoded]"]]:
    """Yield inputs in order of completion; each is encoded by one worker."""
    inputs: dict[tuple[str, str | int | None], BatchInput] = {
        (str(one.source), one.animation): one for one in _largest_first(plan)
    }
    items = [_item(plan, one) for one in inputs.values()]
    for item, outcome in engine.as_completed(encode_input, items, retry=_in_smaller_blocks):
        source, options, _ = item
        yield inputs[source, options.reading.animation], outcome


def _largest_first(plan: Plan) -> list[BatchInput]:
    """The inputs by descending file size: a long one that started last would run alone."""
    return sorted(plan.to_encode, key=lambda one: -one.size_bytes)


Item = tuple[str, EncodeOptions, str]


def _item(plan: Plan, one: BatchInput) -> Item:
    """Arguments of `encode_input`."""
    return str(one.source), plan.options_of(one), __version__


def _in_smaller_blocks(item: Item, error: BaseException) -> Item | None:
    """Arguments with smaller blocks if a worker ran out of memory; else None."""
    source, options, version = item
    smaller = options.smaller(error)
    return None if smaller is None else (source, smaller, version)


def _spread(plan: Plan, engine: Engine) -> Iterator[tuple[BatchInput, "Future[Encoded]"]]:
    """Yield inputs in sequence; all workers encode blocks of the current one."""
    for one in _largest_first(plan):
        retry: Item | None = _item(plan, one)
        while retry is not None:
            item, retry = retry, None
            outcome: Future[Encoded] = Future()
            try:
                outcome.set_result(encode_input(*item, engine))
            except Exception as error:
                outcome.set_exception(error)
                retry = _in_smaller_blocks(item, error)
        yield one, outcome


def _stage(engine: Engine) -> str:
    n_workers = engine.n_workers
    return f"encoding, {n_workers} at a time" if n_workers else "encoding, when there are workers"


class _Run:
    """Updates the records during a run, from several threads."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan
        self._lock = threading.Lock()
        self._next_write_s = 0.0

    def begin(self) -> None:
        """Record all outputs as pending, so that a rerun after a stop knows that it owns them."""
        records = self._plan.manifest.records
        records.update(self._plan.refused)
        records.update({one.name: record for one, record in self._plan.to_encode.items()})
        self._plan.manifest.write()

    def finish(self, one: BatchInput, outcome: "Future[Encoded]") -> None:
        """Write the stream, if encoding succeeded, and the record."""
        pending = self._plan.to_encode[one]
        try:
            encoded = outcome.result()
            self._write_stream(one, encoded.data)
            record = replace(pending, state=DONE, **encoded.figures)
        except Exception as error:
            record = replace(
                pending,
                state=FAILED,
                owns_output=one in self._plan.replaced,
                error=_reason_of(error, one.path, self._plan.input_dir),
            )
        with self._lock:
            self._plan.manifest.records[one.name] = record
            if (began_s := monotonic()) >= self._next_write_s:
                with suppress(StoreError):  # the next write, or the last, may succeed
                    self._plan.manifest.write()
                if (taken_s := monotonic() - began_s) > QUICK_S:
                    self._next_write_s = began_s + taken_s / MANIFEST_SHARE

    def end(self) -> None:
        """Write manifest and report."""
        self._plan.manifest.write()
        write_report(self._plan.manifest)

    def report(self) -> BatchReport:
        """The inputs of this run by outcome."""
        plan, records = self._plan, self._plan.manifest.records
        tried = {one.name: records[one.name] for one in plan.to_encode}
        return BatchReport(
            {name: records[name] for name in plan.up_to_date},
            {name: record for name, record in tried.items() if record.state == DONE},
            {**plan.refused, **{name: record for name, record in tried.items()
                                if record.state == FAILED}},
        )  # fmt: skip

    def _write_stream(self, one: BatchInput, data: bytes) -> None:
        self._plan.folder.write(one.output, data, overwrite=one in self._plan.replaced)


def _reason_of(error: BaseException, path: str, input_dir: Path | str) -> str:
    """The error in one line, without its input; paths are relative to the input folder."""
    if isinstance(error, MeshReelError):
        text = str(error)
    elif isinstance(error, MemoryError):
        text = "not enough memory, even with smaller blocks; use fewer --workers"
    elif isinstance(error, OSError) and error.filename:
        text = f"{error.strerror or error}: {error.filename}"
    else:
        text = f"{type(error).__name__}: {error}"
    top = f"{input_dir.absolute()}{os.sep}" if isinstance(input_dir, Path) else f"{input_dir}/"
    text = text.replace(top, "").removeprefix(f"{path}: ")
    return " ".join(text.split())
