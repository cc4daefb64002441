"""A run: the inputs of a plan, encoded by an engine."""

import os
from collections.abc import Iterator
from concurrent.futures import Future
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from meshreel import __version__
from meshreel.app.batch.discovery import BatchInput
from meshreel.app.batch.encode_input import Encoded, EncodeOptions, encode_input
from meshreel.app.batch.manifest import DONE, FAILED, Record
from meshreel.app.batch.plan import Plan
from meshreel.app.batch.report import write_report
from meshreel.errors import MeshReelError
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.runtime.threads import in_background


@dataclass(frozen=True)
class BatchReport:
    """The outcome of a run.

    Attributes
    ----------
    up_to_date, encoded, failed : dict of str to Record
        By the names of the inputs.
    """

    up_to_date: dict[str, Record]
    encoded: dict[str, Record]
    failed: dict[str, Record]

    @property
    def summary(self) -> str:
        """How many of each, in words."""
        return (
            f"{len(self.up_to_date)} up to date, {len(self.encoded)} encoded, "
            f"{len(self.failed)} failed"
        )

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types, for JSON."""
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
    """Encode the inputs of a plan; the failure of one does not keep the others from it.

    Streams and manifest are written here, each whole or not at all, after each input: what was
    finished stays when the run is stopped. A page with all figures is written at the end, or when
    the run is stopped.

    Parameters
    ----------
    engine : Engine or None
        None only where there is nothing to encode.
    progress : callable, optional
        Called with the share of inputs done.
    """
    run = _Run(plan)
    run.begin()
    try:
        if engine is not None:
            _encode_all(run, plan, engine, progress)
    finally:
        write_report(plan.manifest)
    return run.report()


def _encode_all(run: "_Run", plan: Plan, engine: Engine, progress: Progress) -> None:
    outcomes = _spread(plan, engine) if _is_spread(plan, engine) else _one_each(plan, engine)
    progress(_stage(engine), Count(0, len(plan.to_encode), "inputs"))
    for n_done, (one, outcome) in enumerate(outcomes, start=1):
        # In a thread, which ctrl-C does not reach: a stream is not written without its record.
        in_background(partial(run.finish, one, outcome)).result()
        del outcome  # its stream is written; the next may take long
        progress(_stage(engine), Count(n_done, len(plan.to_encode), "inputs"))


def _is_spread(plan: Plan, engine: Engine) -> bool:
    """Whether workers share each input by its blocks, for there are more workers than inputs."""
    return plan.options.are_cut and len(plan.to_encode) < engine.n_workers


def _one_each(plan: Plan, engine: Engine) -> Iterator[tuple[BatchInput, "Future[Encoded]"]]:
    """The inputs as they come to an end; each is a worker's."""
    inputs: dict[tuple[str, str | int | None], BatchInput] = {
        (str(one.source), one.animation): one for one in _long_ones_first(plan)
    }
    items = [_item(plan, one) for one in inputs.values()]
    for item, outcome in engine.as_completed(encode_input, items, retry=_in_smaller_blocks):
        source, options, _ = item
        yield inputs[source, options.reading.animation], outcome


def _long_ones_first(plan: Plan) -> list[BatchInput]:
    """The inputs by the bytes of their files: a long one that began last would run alone."""
    return sorted(plan.to_encode, key=lambda one: -one.size_bytes)


Item = tuple[str, EncodeOptions, str]


def _item(plan: Plan, one: BatchInput) -> Item:
    """The arguments with which an input is encoded."""
    return str(one.source), plan.options_of(one), __version__


def _in_smaller_blocks(item: Item, error: BaseException) -> Item | None:
    """The call with smaller blocks, where a worker's memory was too little; else None."""
    source, options, version = item
    smaller = options.smaller(error)
    return None if smaller is None else (source, smaller, version)


def _spread(plan: Plan, engine: Engine) -> Iterator[tuple[BatchInput, "Future[Encoded]"]]:
    """One input after another; all workers code its blocks."""
    for one in _long_ones_first(plan):
        following: Item | None = _item(plan, one)
        while following is not None:
            item, following = following, None
            outcome: Future[Encoded] = Future()
            try:
                outcome.set_result(encode_input(*item, engine))
            except Exception as error:
                outcome.set_exception(error)
                following = _in_smaller_blocks(item, error)
        yield one, outcome


def _stage(engine: Engine) -> str:
    n_workers = engine.n_workers
    return f"encoding, {n_workers} at a time" if n_workers else "encoding, when there are workers"


class _Run:
    """The records while they change."""

    def __init__(self, plan: Plan) -> None:
        self._plan = plan

    def begin(self) -> None:
        """Claim the outputs to come, so that a run stopped at any point knows its own."""
        records = self._plan.manifest.records
        records.update(self._plan.refused)
        records.update({one.name: record for one, record in self._plan.to_encode.items()})
        self._plan.manifest.write()

    def finish(self, one: BatchInput, outcome: "Future[Encoded]") -> None:
        """Write the stream, if there is one, and the record."""
        manifest, pending = self._plan.manifest, self._plan.to_encode[one]
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
        manifest.records[one.name] = record
        manifest.write()

    def report(self) -> BatchReport:
        """The inputs of this run by what became of them."""
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
    """The error in one line, without the path of its input; paths are relative to the inputs."""
    if isinstance(error, MeshReelError):
        text = str(error)
    elif isinstance(error, MemoryError):
        text = "not enough memory, in smaller blocks either; fewer --workers need less"
    elif isinstance(error, OSError) and error.filename:
        text = f"{error.strerror or error}: {error.filename}"
    else:
        text = f"{type(error).__name__}: {error}"
    top = f"{input_dir.absolute()}{os.sep}" if isinstance(input_dir, Path) else f"{input_dir}/"
    text = text.replace(top, "").removeprefix(f"{path}: ")
    return " ".join(text.split())
