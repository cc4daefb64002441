"""Encoding of the inputs of a plan by the workers of an executor."""

import os
from collections import deque
from collections.abc import Iterator
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from meshreel.app.batch.discovery import BatchInput
from meshreel.app.batch.encode_input import EncodedInput, EncodeOptions, encode_input, worker_died
from meshreel.app.batch.manifest import DONE, FAILED, Record, write_file
from meshreel.app.batch.plan import Plan
from meshreel.errors import Keyword, MeshReelError, Message
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.version import __version__
from meshreel.runtime.workers.executors import completed

MIN_SUBMITTED = 256
"""Maximum number of inputs submitted and not yet written, or two per worker if that is more: bounds
the memory of finished streams, and keeps workers busy that join a cluster later."""


@dataclass(frozen=True)
class BatchReport:
    """The outcome of a run."""

    up_to_date: dict[str, Record]
    encoded: dict[str, Record]
    failed: dict[str, Record]
    """Records by input name."""

    @property
    def summary(self) -> str:
        """Numbers of inputs by outcome, as text."""
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


def run_batch(
    plan: Plan, executor: Executor | None, n_workers: int = 1, *, progress: Progress = silent
) -> BatchReport:
    """Encode the inputs of a plan; inputs fail independently.

    The stream of each input is written atomically, so finished inputs remain if the run is stopped.
    The manifest is written after each input, but slow writes (of many inputs) take at most a tenth
    of the time: if the run is killed, inputs that it does not list as done are encoded again. The
    manifest is complete at the end, or when the run is stopped.

    Parameters
    ----------
    executor : concurrent.futures.Executor or None
        Its workers need access to the inputs only, and it must replace workers that die. None only
        if there is nothing to encode.
    n_workers : int, default 1
        Number of its workers.
    progress : callable, optional
        Called with the completed fraction of inputs.
    """
    manifest = plan.manifest
    pending = {batch_input.name: record for batch_input, record in plan.to_encode.items()}
    # A rerun after a stop knows from these that it owns the outputs.
    manifest.records.update({**plan.refused, **pending})
    manifest.write()
    try:
        if executor is not None:
            stage = f"encoding, {n_workers} at a time" if n_workers else "encoding"
            if n_workers:  # otherwise the executor has reported that inputs wait
                progress(stage, Count(0, len(plan.to_encode), "inputs"))
            # Ctrl-C does not interrupt this thread, and waits for it: every stream gets its record.
            with ThreadPoolExecutor(1, "meshreel-write") as writer:
                outcomes = _outcomes(plan, executor, n_workers)
                for n_encoded, (batch_input, outcome) in enumerate(outcomes, start=1):
                    writer.submit(_finish, plan, batch_input, outcome).result()
                    del outcome  # releases its stream during the wait for the next
                    progress(stage, Count(n_encoded, len(plan.to_encode), "inputs"))
    finally:
        manifest.write()
    records = manifest.records
    groups: dict[str, dict[str, Record]] = {DONE: {}, FAILED: {**plan.refused}}
    for name in pending:
        if records[name].state in groups:
            groups[records[name].state][name] = records[name]
    up_to_date = {name: records[name] for name in plan.up_to_date}
    return BatchReport(up_to_date, groups[DONE], groups[FAILED])


def _outcomes(
    plan: Plan, executor: Executor, n_workers: int
) -> Iterator[tuple[BatchInput, "Future[EncodedInput]"]]:
    """Yield inputs in order of completion; each is encoded by one worker.

    An input whose worker died is retried alone at the end: it may not be the cause.
    """
    # By descending size: a long one that started last would run alone.
    largest_first = sorted(plan.to_encode, key=lambda batch_input: -batch_input.size_bytes)
    waiting = deque((batch_input, plan.options) for batch_input in largest_first)
    pending: dict[Future[EncodedInput], tuple[BatchInput, EncodeOptions]] = {}
    retries: deque[tuple[BatchInput, EncodeOptions]] = deque()
    limit = max(MIN_SUBMITTED, 2 * n_workers)
    try:
        while waiting or pending or retries:
            if not (waiting or pending):
                waiting.append(retries.popleft())
            while waiting and len(pending) < limit:
                batch_input, options = waiting.popleft()
                item = str(batch_input.source), options, __version__
                pending[executor.submit(encode_input, *item)] = batch_input, options
            for future in completed(pending):
                batch_input, options = pending.pop(future)
                error = CancelledError() if future.cancelled() else future.exception()
                smaller = options.smaller(error) if error else None
                if error is None or smaller is None:
                    yield batch_input, future
                else:
                    (retries if worker_died(error) else waiting).append((batch_input, smaller))
                del future  # releases its stream during the wait for the next
    finally:
        for future in pending:
            future.cancel()


def _finish(plan: Plan, batch_input: BatchInput, outcome: "Future[EncodedInput]") -> None:
    """Write the stream, if encoding succeeded, and the record."""
    is_replaced = batch_input in plan.replaced
    try:
        encoded = outcome.result()
        write_file(plan.out_dir / batch_input.output, encoded.data, overwrite=is_replaced)
        changes = {"state": DONE, **encoded.figures}
    except Exception as error:
        reason = _reason_of(error, batch_input.name, plan.input_dir)
        changes = {"state": FAILED, "owns_output": is_replaced, "error": reason}
    plan.manifest.update(batch_input.name, replace(plan.to_encode[batch_input], **changes))


def _reason_of(error: BaseException, path: str, input_dir: Path | str) -> Message:
    """The error in one line, without its input; paths are relative to the input folder."""
    top = f"{input_dir.absolute()}{os.sep}" if isinstance(input_dir, Path) else f"{input_dir}/"
    if isinstance(error, MeshReelError):
        has_other_path = error.path.removeprefix(top) not in ("", path)
        parts = error.message.parts if has_other_path else error.args
    elif isinstance(error, CancelledError):
        parts = ("the call was lost; check that the scheduler is running",)
    elif isinstance(error, MemoryError):
        parts = ("not enough memory, even with smaller blocks; use fewer workers",)
    elif isinstance(error, OSError) and error.filename:
        parts = (f"{error.strerror or error}: {error.filename}",)
    else:
        parts = (f"{type(error).__name__}: {error}",)
    # Messages about several files, and texts of libraries, name paths within their parts.
    texts = [
        part if isinstance(part, Keyword) else part.replace(top, "").replace("\n", " ")
        for part in parts
    ]
    return Message(*texts)
