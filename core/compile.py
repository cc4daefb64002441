"""Compiles the core: `python core/compile.py` puts the library where meshreel loads it.

The compiler is $CC, else cc, clang or gcc, else the one in the package `ziglang`.
"""

import argparse
import importlib.util
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

CORE = Path(__file__).resolve().parent
LIBRARY = {"win32": "reel.dll", "darwin": "libreel.dylib"}.get(sys.platform, "libreel.so")
TARGET = CORE.parent / "src" / "meshreel" / "kernel" / LIBRARY
COMPILERS = ("cc", "clang", "gcc")
FLAGS = (
    "-std=c11",
    "-O3",
    "-fPIC",
    "-shared",
    "-fvisibility=hidden",
    # What a stream means must not depend on the machine: no fused operations, no reordering.
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-strict-aliasing",
)
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Wshadow", "-Werror")
TIME_LIMIT_S = 300


def sources() -> list[Path]:
    """The files of the core that the library is made of."""
    return sorted([*CORE.glob("*.c"), *CORE.glob("*.h")])


def compiler() -> list[str] | None:
    """The command of a C compiler, or None where there is none."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in COMPILERS:
        if shutil.which(name):
            return [name]
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc"]
    return None


def command(target: Path, extra: Sequence[str] = ()) -> list[str]:
    """The command that compiles the library.

    Raises
    ------
    RuntimeError
        If there is no compiler.
    """
    found = compiler()
    if found is None:
        raise RuntimeError(
            "no C compiler is here; install gcc or clang, set CC, or `pip install ziglang`"
        )
    files = [str(file) for file in sources() if file.suffix == ".c"]
    return [*found, *FLAGS, *extra, *files, "-o", str(target)]


def build(target: Path = TARGET, extra: Sequence[str] = ()) -> Path:
    """Compile the library, whole or not at all.

    Raises
    ------
    RuntimeError
        If there is no compiler, or it fails; the message has its first complaint.
    """
    unfinished = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        subprocess.run(
            command(unfinished, extra),
            check=True,
            timeout=TIME_LIMIT_S,
            capture_output=True,
            text=True,
        )
        unfinished.replace(target)
    except subprocess.CalledProcessError as error:
        raise RuntimeError(f"the compiler failed:\n{error.stderr}") from error
    finally:
        unfinished.unlink(missing_ok=True)
    return target


def is_current(target: Path = TARGET) -> bool:
    """Whether the library is there and no source of it is newer."""
    if not target.exists():
        return False
    built = target.stat().st_mtime
    return all(file.stat().st_mtime <= built for file in [*sources(), Path(__file__)])


def main() -> None:
    """Compile where it is asked for, or where meshreel loads it from."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=TARGET, help="the library to write")
    parser.add_argument("--warnings", action="store_true", help="warnings are errors")
    parser.add_argument("flags", nargs="*", help="more flags for the compiler, behind --")
    given = parser.parse_args()
    extra = [*(WARNINGS if given.warnings else ()), *given.flags]
    print(build(given.output, extra))


if __name__ == "__main__":
    main()
