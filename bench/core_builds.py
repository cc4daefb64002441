"""Compare builds of the C core: `python bench/core_builds.py [--source FILE] BUILD...`.

A build is a shared library, for example one made by `python core/compile.py -o FILE`. Each round
runs every build once, in a separate process: it encodes and decodes the sequence in the default
and the lossless mode, and sums the processor time of each function of the core. The table lists the
minimum over rounds, in milliseconds for the first build and relative to it for the others.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

import meshreel
from measuring import print_table
from meshreel.kernel import library
from meshreel.kernel.files import OpenFile
from meshreel.model.flag import simulate_flag

MIN_MS = 5.0
"""Faster functions of the first build are not listed."""

Times = dict[str, float]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("builds", nargs="*", type=Path, metavar="BUILD")
    parser.add_argument("--source", help="a sequence; a flag of 60 frames without it")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.worker:
        print(json.dumps(processor_time(options.source)))
        return
    rounds: dict[Path, list[Times]] = {build: [] for build in options.builds}
    for _ in range(options.rounds):
        for build, times in rounds.items():
            times.append(run_worker(build, options.source))
    first, *others = map(fastest, rounds.values())
    rows = [
        [function, f"{base:.0f}", *(f"{times[function] / base:.2f}" for times in others)]
        for function, base in sorted(first.items(), key=itemgetter(1))
        if base >= MIN_MS
    ]
    print_table("", ["function", *(build.stem for build in options.builds)], rows)


def processor_time(source: str | None) -> Times:
    """Milliseconds in each function of the core while a sequence is encoded and decoded."""
    times: Times = defaultdict(float)

    def timed(call: Callable[..., Any], name: str) -> Any:
        start = time.thread_time()
        try:
            return call()
        finally:
            times[name] += 1000 * (time.thread_time() - start)

    encode, decode = library.call, OpenFile.call
    for module in list(sys.modules.values()):  # each kernel module imports the function by name
        if getattr(module, "call", None) is encode:
            module.call = lambda name, *given, **options: timed(  # type: ignore[attr-defined]
                partial(encode, name, *given, **options), name
            )
    OpenFile.call = lambda file, name, *given: timed(  # type: ignore[method-assign]
        partial(decode, file, name, *given), name
    )
    sequence = meshreel.load(source) if source else simulate_flag(60)
    meshreel.decode(meshreel.encode(sequence))
    meshreel.decode(meshreel.encode(sequence, lossless=True))
    return {**times, "total": sum(times.values())}


def run_worker(build: Path, source: str | None) -> Times:
    """Times of one build, measured in a separate process."""
    arguments = [sys.executable, __file__, "--worker", *(["--source", source] if source else [])]
    environment = {**os.environ, library.PATH_VARIABLE: str(build.resolve())}
    done = subprocess.run(arguments, env=environment, check=True, capture_output=True, text=True)
    times: Times = json.loads(done.stdout)
    return times


def fastest(times: list[Times]) -> Times:
    return {function: min(run[function] for run in times) for function in times[0]}


if __name__ == "__main__":
    main()
