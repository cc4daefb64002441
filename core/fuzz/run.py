"""Feeds hostile bytes to the core: `python core/fuzz/run.py --seconds 20`.

Built by clang or gcc with sanitizers of addresses and undefined behaviour. `--libfuzzer FOLDER` is
for long searches: clang's libFuzzer keeps what it finds in the folder.
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
LIBFUZZER = ("-fsanitize=fuzzer",)
# Sanitizers take long to compile what is inlined by force; without it, and at -O1, they run nearly
# as fast.
GUARDED = (*core.SANITIZERS, "-DREEL_INLINE=static inline", "-DREEL_GUARDED")


def build(output: Path, compiler: Sequence[str], extra: Sequence[str] = LOOP) -> Path:
    """The program that runs the core on hostile bytes.

    Raises
    ------
    subprocess.CalledProcessError
        If it cannot be built.
    """
    flags = [flag for flag in core.FLAGS if not flag.startswith("-std")]
    folders = (core.CORE, core.READER, FUZZ)
    files = [str(file) for folder in folders for file in sorted(folder.glob("*.c"))]
    command = [*compiler, "-std=gnu11", *flags, *extra, *files, "-o", str(output)]
    subprocess.run(command, check=True)
    return output


def guarded(compiler: str, extra: Sequence[str]) -> Path:
    """What sanitizers watch; built where temporary files are, named by its compiler."""
    program = Path(tempfile.mkdtemp(), f"fuzz-{compiler}")
    return build(program, [compiler], (*GUARDED, *extra, *LOOP))


def main() -> None:
    """Build it, and run it for some time."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", default="20", help="0 for no end")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--first", default="0", help="number of the first run of a seed")
    parser.add_argument("--count", default=str((1 << 64) - 1), help="of runs")
    parser.add_argument("--plain", action="store_true", help="built soon by -O0, and run slowly")
    parser.add_argument("--libfuzzer", type=Path, metavar="FOLDER")
    given = parser.parse_args()
    found = next((name for name in ("clang", "gcc") if shutil.which(name)), None)
    if found is None or (given.libfuzzer and found != "clang"):
        sys.exit("hostile bytes need a compiler with sanitizers: clang, or gcc without libFuzzer")
    if given.libfuzzer:
        given.libfuzzer.mkdir(parents=True, exist_ok=True)
        extra = ("-O2", *core.SANITIZERS[1:], "-DREEL_GUARDED", *LIBFUZZER)
        program = build(Path(tempfile.mkdtemp(), "fuzz"), [found], extra)
        words = [str(given.libfuzzer), f"-max_total_time={given.seconds}", "-max_len=4096"]
    else:
        program = guarded(found, ["-O0"] if given.plain else [])
        words = [given.seconds, given.seed, given.first, given.count]
    try:
        sys.exit(subprocess.run([program, *words]).returncode)
    finally:
        shutil.rmtree(program.parent)


if __name__ == "__main__":
    main()
