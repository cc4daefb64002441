"""Fuzz the core: `python core/fuzz/run.py --seconds 20`.

Builds with clang or gcc, with address and undefined-behavior sanitizers. `--libfuzzer FOLDER` is
for long searches: clang's libFuzzer keeps its corpus in the folder.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

FUZZ = Path(__file__).resolve().parent
sys.path.insert(0, str(FUZZ.parent))

import compile as core  # noqa: E402

LOOP = ("-DREEL_FUZZ_LOOP",)
STREAMS = f'-DREEL_FUZZ_STREAMS="{FUZZ.parents[1] / "conformance"}"'
LIBFUZZER = ("-fsanitize=fuzzer",)
# Forced inlining compiles slowly with sanitizers; without it, and at -O1, the program is nearly as
# fast.
GUARDED = (*core.SANITIZERS, "-DREEL_INLINE=static inline", "-DREEL_GUARDED")


def build(output: Path, compiler: Sequence[str], extra: Sequence[str] = LOOP) -> Path:
    """Build the fuzzer, and return its path.

    Raises
    ------
    subprocess.CalledProcessError
        If the compiler fails.
    """
    flags = [flag for flag in core.FLAGS if not flag.startswith("-std")]
    folders = (core.CORE, core.READER, FUZZ)
    files = [str(file) for folder in folders for file in sorted(folder.glob("*.c"))]
    command = [*compiler, "-std=gnu11", *flags, STREAMS, *extra, *files, "-o", str(output)]
    subprocess.run(command, check=True)
    return output


def build_guarded(compiler: str, extra: Sequence[str]) -> Path:
    """Build the fuzzer with sanitizers in a temporary folder."""
    program = Path(tempfile.mkdtemp(), f"fuzz-{compiler}")
    return build(program, [compiler], (*GUARDED, *extra, *LOOP))


def main() -> None:
    """Build and run the fuzzer."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", default="20", help="0 for no limit")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--first", default="0", help="number of the first run")
    parser.add_argument("--count", default=str((1 << 64) - 1), help="number of runs")
    parser.add_argument("--plain", action="store_true", help="build with -O0: slower runs")
    parser.add_argument("--libfuzzer", type=Path, metavar="FOLDER")
    options = parser.parse_args()
    compiler = next((name for name in ("clang", "gcc") if shutil.which(name)), None)
    if compiler is None or (options.libfuzzer and compiler != "clang"):
        sys.exit("fuzzing needs a compiler with sanitizers: clang, or gcc without --libfuzzer")
    if options.libfuzzer:
        options.libfuzzer.mkdir(parents=True, exist_ok=True)
        extra = ("-O2", *core.SANITIZERS[1:], "-DREEL_GUARDED", *LIBFUZZER)
        program = build(Path(tempfile.mkdtemp(), "fuzz"), [compiler], extra)
        arguments = [str(options.libfuzzer), f"-max_total_time={options.seconds}", "-max_len=4096"]
    else:
        program = build_guarded(compiler, ["-O0"] if options.plain else [])
        arguments = [options.seconds, options.seed, options.first, options.count]
    try:
        sys.exit(subprocess.run([program, *arguments]).returncode)
    finally:
        shutil.rmtree(program.parent)


if __name__ == "__main__":
    main()
