"""Measure the sequences of bench/corpus/manifest.toml, and store them in docs/results/corpus.json.

    python bench/corpus_results.py --work corpus --mirrors mirrors
    python bench/corpus_results.py --work corpus --only "fox*"

Each sequence is fetched, read and measured in a separate process with one core, and limits of
time and memory; what fails is stored with the reason. Results in the folder `--work` are reused,
so use a new one for each commit. `python docs/result_tables.py --write` updates docs/corpus.md.
"""

import argparse
import fnmatch
import json
import multiprocessing
import os
import resource
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any
from zlib import crc32

from corpus.measure import SETTINGS, features, measure
from corpus.sources import (
    MAX_CHANGING,
    MAX_FRAMES,
    MAX_POSITIONS,
    Files,
    Source,
    first_frames,
    read_manifest,
)
from corpus.tables import losses_of
from meshreel.runtime.progress import Progress
from meshreel.runtime.threads import limit_cores
from meshreel.studies.runs import Outcome, Result, Run, Store, file_name, finite, result_of
from meshreel.studies.timing import machine_facts, timed_once
from stored_results import RESULTS, commit

DRAWN = 4
"""Pictures of every fourth sequence are compared."""

MAX_MESSAGE = 200
DIGITS = 3
"""Significant digits of stored errors and seconds."""


def run_of(source: Source, files: Files) -> Run:
    """The run of a sequence."""

    is_drawn = crc32(source.name.encode()) % DRAWN == 0

    def execute(_: Progress) -> Outcome:
        sequence = source.load(files)
        kept = first_frames(sequence)
        figures = {"n_frames_in_file": sequence.n_frames, **measure(kept, is_drawn=is_drawn)}
        if losses_of(figures):
            figures["features"] = features(kept)
        return Outcome(finite(figures))

    setting = {"settings": SETTINGS, "limits": [MAX_FRAMES, MAX_POSITIONS, MAX_CHANGING]}
    return Run(source.name, "result", setting, execute, is_foreign=True)


def store_of(source: Source, work: Path) -> Store:
    """The folder of the results of a sequence."""
    folder = work / "results" / file_name(source.name)
    folder.mkdir(parents=True, exist_ok=True)
    identity = {key: str(getattr(source, key)) for key in ("repo", "commit", "path", "options")}
    return Store(folder, identity)


def result_within(source: Source, work: Path, files: Files, limits: argparse.Namespace) -> Result:
    """The stored result of a sequence, or a new one from a process with limits."""
    store, run = store_of(source, work), run_of(source, files)
    result = store.find(run)
    if result is not None:
        return result
    reason, seconds = timed_once(partial(_execute_within, run, store, limits))
    result = store.find(run) or store.write(run, Outcome({"refused": reason}))
    outcome = result.get("refused", f"{result.get('n_frames')} x {result.get('n_verts')}")
    print(f"{source.name}: {outcome} ({seconds.wall:.1f} s)", flush=True)
    return result


def _execute_within(run: Run, store: Store, limits: argparse.Namespace) -> str:
    """Execute a run in a process with limits; return the reason if it does not store a result."""
    context = multiprocessing.get_context("fork")
    process = context.Process(target=_execute, args=(run, store, limits.memory << 30))
    process.start()
    process.join(limits.seconds)
    if process.is_alive():
        process.kill()
        process.join()
        return f"not finished after {limits.seconds} s"
    return f"exit code {process.exitcode}"


def _execute(run: Run, store: Store, memory: int) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    limit_cores(1)
    try:
        result_of(run, store)
    except MemoryError:
        store.write(run, Outcome({"refused": f"more than {memory >> 30} GiB of memory"}))


def summary(source: Source, result: Result) -> dict[str, Any]:
    """A row of the stored results."""
    row: dict[str, Any] = {"name": source.name, "kind": source.kind, "repo": source.repo}
    if "refused" in result:
        message = result["refused"].splitlines()[0].rpartition(f"{source.commit[:12]}/")[2]
        message = message.removeprefix(f"{source.path}: ")
        return {**row, "path": source.path, "refused": message[:MAX_MESSAGE]}
    figures = {key: value for key, value in result.items() if key not in ("identity", "dtype")}
    if figures["n_frames_in_file"] == figures["n_frames"]:
        del figures["n_frames_in_file"]
    return {**row, **_rounded(figures)}


def _rounded(value: Any) -> Any:
    """The value with rounded numbers, and without what is False."""
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items() if item is not False}
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def write_results(sources: list[Source], results: list[Result]) -> None:
    """Write docs/results/corpus.json, one line per sequence."""
    rows = [
        json.dumps(summary(*pair), separators=(",", ":"))
        for pair in zip(sources, results, strict=True)
    ]
    head = {"machine": machine_facts(), "commit": commit()}
    lines = [f"{json.dumps(key)}: {json.dumps(value)}" for key, value in head.items()]
    text = ",\n".join([*lines, '"sequences": [\n' + ",\n".join(rows) + "\n]"])
    (RESULTS / "corpus.json").write_text(f"{{\n{text}\n}}\n", encoding="utf-8")


def main() -> None:
    """Measure all sequences, or some without storing the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--work", type=Path, required=True, help="folder of files and results")
    parser.add_argument("--mirrors", type=Path, help="folder of git directories, OWNER+NAME")
    parser.add_argument("--only", help="a pattern of names; the table is not stored")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--seconds", type=float, default=300, help="time limit of a sequence")
    parser.add_argument("--memory", type=int, default=8, help="memory limit in GiB")
    options = parser.parse_args()
    sources = read_manifest()
    if options.only:
        sources = [one for one in sources if fnmatch.fnmatchcase(one.name, options.only)]
    files = Files(options.work, options.mirrors)
    work = partial(result_within, work=options.work, files=files, limits=options)
    by_kind = sorted(sources, key=lambda one: crc32(one.name.encode()))  # results of all kinds soon
    with ThreadPoolExecutor(options.jobs) as pool:
        found = dict(zip((one.name for one in by_kind), pool.map(work, by_kind), strict=True))
    results = [found[one.name] for one in sources]
    if not options.only:
        write_results(sources, results)


if __name__ == "__main__":
    main()
