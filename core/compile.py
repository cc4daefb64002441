"""Compiles the core: `python core/compile.py` puts the library where meshreel loads it.

The compiler is $CC, else cc, clang or gcc, else the one in the package `ziglang`. For other
machines (--target) and for WebAssembly it is always ziglang's, which brings all that it needs.
"""

import argparse
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

CORE = Path(__file__).resolve().parent
READER = CORE / "reader"
INCLUDE = CORE / "include"
KERNEL = CORE.parent / "src" / "meshreel" / "kernel"
# gcc for Windows keeps wide vectors on stacks that it does not align for them.
COMPILERS = () if sys.platform == "win32" else ("cc", "clang", "gcc")
FLAGS = (
    "-std=c11",
    "-fvisibility=hidden",
    # What a stream means must not depend on the machine: no fused operations, no reordering.
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-strict-aliasing",
    "-DMESHREEL_BUILD",
)
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Wshadow", "-Werror")
SANITIZERS = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
Levels = dict[str, tuple[str, ...]]
NO_COMPILER = "no C compiler is here: install gcc or clang, set CC, or `pip install ziglang`"

# Functions of `include/meshreel.h` and `reader/page.c` that the npm package calls.
PAGE_FUNCTIONS = (
    "meshreel_abi",
    "meshreel_begin",
    "meshreel_block_of",
    "meshreel_decode",
    "meshreel_info_of",
    "meshreel_load",
    "meshreel_modes_of",
    "meshreel_read_surface",
    "meshreel_surface_of",
    "meshreel_track_of",
    "meshreel_triangles",
    "page_open",
)


@dataclass(frozen=True)
class Target:
    """A kind of machine that the core is compiled for.

    Attributes
    ----------
    library : str
        The name of the file.
    flags : tuple of str
        Beside `FLAGS`.
    triple : str
        What zig calls it.
    tag : str
        The platform in the name of a wheel; of WebAssembly there are none.
    optimization : tuple of str
        Flags of all files but those in `hot`; the last of several levels counts.
    hot : dict of str to tuple of str
        Flags of the files named, instead of `optimization`.
    """

    library: str
    flags: tuple[str, ...]
    triple: str
    tag: str = ""
    optimization: tuple[str, ...] = ()
    hot: Levels = field(default_factory=dict)


ELF = ("-O3", "-fPIC", "-shared")
# Nothing of a C library is linked: the three functions that compilers call are in every process.
LONE_ELF = (*ELF, "-nostdlib", "-s")
MACH_O = ("-O3", "-fPIC", "-shared", "-Wl,-s", "-Wl,-install_name,@rpath/libreel.dylib")
PE = ("-O3", "-shared", "-s")
# An installation from source takes gcc 6 s instead of 15 (-O3, all marked functions inlined), for
# a library that is as fast on lossless files and takes 5 % longer on others. Measured with
# `bench/core_builds.py`.
SOURCE_FLAGS = ("-DREEL_INLINE=static inline",)
SOURCE_HOT: Levels = {
    **dict.fromkeys(("coordinates.c", "exact_items.c", "fields.c", "timeline.c"), ("-O3",)),
    **dict.fromkeys(
        ("connectivity.c", "frames.c", "hierarchy.c", "order.c", "predict.c", "smooth.c"), ("-O2",)
    ),
}
# Loops over vectors: as small as can be they would go through memory.
WASM_HOT: Levels = dict.fromkeys(("predict.c", "smooth.c"), ("-Os",))
# The compiler of ziglang takes -Os for -Oz, but where it is told again.
SMALLEST = ("-Os", "-Xclang", "-Oz")
LEAN_WASM = (
    "-O3",
    "-flto",
    "-nostdlib",
    "-mbulk-memory",
    "-DREEL_DECODER_ONLY",
    "-DREEL_INLINE=static inline",  # a third smaller
    "-DREEL_CALLED=static",
    "-Wl,--no-entry",
    "-Wl,--gc-sections",
    "-Wl,--strip-all",
    "-Wl,--export=__heap_base",
)
WASM = (*LEAN_WASM, *(f"-Wl,--export={name}" for name in PAGE_FUNCTIONS))


def wasm(library: str, *flags: str) -> Target:
    """A module for pages, as small as can be."""
    return Target(
        library, (*flags, *WASM), "wasm32-freestanding", optimization=SMALLEST, hot=WASM_HOT
    )


TARGETS = {
    "linux-x86_64": Target(
        "libreel.so",
        LONE_ELF,
        "x86_64-linux-gnu.2.17",
        "manylinux_2_17_x86_64.manylinux2014_x86_64",
    ),
    "linux-aarch64": Target(
        "libreel.so",
        LONE_ELF,
        "aarch64-linux-gnu.2.17",
        "manylinux_2_17_aarch64.manylinux2014_aarch64",
    ),
    "macosx-arm64": Target("libreel.dylib", MACH_O, "aarch64-macos.11.0", "macosx_11_0_arm64"),
    "macosx-x86_64": Target("libreel.dylib", MACH_O, "x86_64-macos.11.0", "macosx_11_0_x86_64"),
    "win-amd64": Target("reel.dll", PE, "x86_64-windows-gnu", "win_amd64"),
    # Positions of the method reel, and the surface: what a page needs for its first picture.
    "wasm": wasm("reel.wasm", "-msimd128", "-DREEL_ONLY_POSITIONS=1"),
    "wasm-whole": wasm("reel_whole.wasm", "-msimd128"),
    "wasm-plain": wasm("reel_plain.wasm"),  # for engines without vectors
}
HERE = Target(
    *{"win32": ("reel.dll", PE), "darwin": ("libreel.dylib", ELF)}.get(
        sys.platform, ("libreel.so", ELF)
    ),
    triple="",
    optimization=("-O1",),
    hot=SOURCE_HOT,
)
TARGET = KERNEL / HERE.library


def sources() -> list[Path]:
    """The files of the core and of the decoder of files that the library is made of."""
    return sorted(file for folder in (CORE, READER, INCLUDE) for file in folder.glob("*.[ch]"))


def zig() -> list[str] | None:
    """The command of the compiler in the package `ziglang`, or None where it is not there."""
    if importlib.util.find_spec("ziglang") is None:
        return None
    return [sys.executable, "-m", "ziglang", "cc"]


def compiler() -> list[str] | None:
    """The command of a C compiler for this machine, or None where there is none."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in COMPILERS:
        if shutil.which(name):
            return [name]
    found = zig()
    # Zig alone compiles for the very processor it runs on.
    return found and [*found, "-mcpu=baseline"]


def commands(
    output: Path, extra: Sequence[str] = (), target: str | None = None
) -> tuple[list[list[str]], list[str]]:
    """Return the commands that compile files, in any order, and the one that links them.

    They are for this machine, or for a target, and run in an empty folder.

    Raises
    ------
    RuntimeError
        If there is no compiler.
    """
    found = zig() if target else compiler()
    if found is None:
        raise RuntimeError(f"{target} needs the package ziglang" if target else NO_COMPILER)
    kind = TARGETS[target] if target else HERE
    flags = [*FLAGS, *kind.flags, *(("-target", kind.triple) if target else SOURCE_FLAGS), *extra]
    compiled = [flag for flag in flags if not flag.startswith(("-Wl,", "-nostdlib", "-shared"))]
    files = [file for file in sources() if file.suffix == ".c"]
    objects = {file: f"{file.parent.name}_{file.stem}.o" for file in files}
    steps = [
        [
            *found,
            *compiled,
            *kind.hot.get(file.name, kind.optimization),
            "-c",
            str(file),
            "-o",
            name,
        ]
        for file, name in objects.items()
    ]
    return steps, [*found, *flags, *objects.values(), "-o", str(output)]


def build(output: Path = TARGET, extra: Sequence[str] = (), target: str | None = None) -> Path:
    """Compile the library on all cores, whole or not at all.

    Raises
    ------
    RuntimeError
        If there is no compiler, or it fails; the message has what it says.
    """
    steps, link = commands(Path(output.name), extra, target)
    output = output.resolve()
    try:
        with (
            tempfile.TemporaryDirectory(dir=output.parent, prefix=".core-") as work,
            ThreadPoolExecutor(os.cpu_count()) as pool,
        ):
            # Some compilers write further files into the working directory.
            run = partial(subprocess.run, check=True, cwd=work, capture_output=True, text=True)
            list(pool.map(run, steps))
            run(link)
            Path(work, output.name).replace(output)
    except FileNotFoundError as error:
        raise RuntimeError(f"there is no compiler {link[0]!r}, which CC names") from error
    except subprocess.CalledProcessError as error:
        raise RuntimeError(f"the compiler failed:\n{error.stderr}") from error
    return output


def is_current(output: Path = TARGET) -> bool:
    """Whether the library is there and no source of it is newer."""
    if not output.exists():
        return False
    built = output.stat().st_mtime
    return all(file.stat().st_mtime <= built for file in [*sources(), Path(__file__)])


def wheel_tag() -> str:
    """The platform in the name of a wheel whose core was compiled for this machine alone."""
    name = sysconfig.get_platform()
    if sys.platform == "darwin":  # Python may run on older and other machines; the core does not
        system = max(int(platform.mac_ver()[0].split(".")[0] or 0), 11)
        name = f"macosx-{system}-0-{platform.machine()}"
    return name.replace("-", "_").replace(".", "_")


def main() -> None:
    """Compile where it is asked for, or where meshreel loads it from."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, help="the library to write")
    parser.add_argument("--target", choices=TARGETS, help="another machine, by the package ziglang")
    parser.add_argument("--warnings", action="store_true", help="warnings are errors")
    parser.add_argument("flags", nargs="*", help="more flags for the compiler, behind --")
    given = parser.parse_args()
    extra = [*(WARNINGS if given.warnings else ()), *given.flags]
    output = given.output or (Path(TARGETS[given.target].library) if given.target else TARGET)
    try:
        print(build(output, extra, given.target))
    except RuntimeError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
