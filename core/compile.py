"""Compile the core: `python core/compile.py` writes the library to where meshreel loads it.

The compiler is $CC, else cc, clang or gcc, else the one in the package `ziglang`, which always
compiles WebAssembly (--target). With $MESHREEL_RELEASE, set for the wheels of a release, the
library is compiled for speed instead of a short installation.
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
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

CORE = Path(__file__).resolve().parent
READER = CORE / "reader"
INCLUDE = CORE / "include"
KERNEL = CORE.parent / "src" / "meshreel" / "kernel"
# gcc for Windows does not align the stack for wide vectors.
COMPILERS = () if sys.platform == "win32" else ("cc", "clang", "gcc")
FLAGS = (
    "-std=c11",
    "-fvisibility=hidden",
    # All machines must compute the same bits: no fused operations, no reordering.
    "-ffp-contract=off",
    "-fno-math-errno",
    "-fno-strict-aliasing",
    "-DMESHREEL_BUILD",
)
WARNINGS = ("-Wall", "-Wextra", "-Wconversion", "-Wno-sign-conversion", "-Wshadow", "-Werror")
SANITIZERS = ("-O1", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
Levels = dict[str, tuple[str, ...]]
NO_COMPILER = "no C compiler found: install gcc or clang, set CC, or `pip install ziglang`"

# Functions of `include/meshreel.h` and `reader/page.c` that the npm package calls.
PAGE_FUNCTIONS = (
    "meshreel_abi",
    "meshreel_begin",
    "meshreel_block_of",
    "meshreel_cells_of",
    "meshreel_close",
    "meshreel_decode",
    "meshreel_end",
    "meshreel_info_of",
    "meshreel_times_of",
    "meshreel_load",
    "meshreel_modes_of",
    "meshreel_open_segment",
    "meshreel_read_surface",
    "meshreel_segment_of",
    "meshreel_surface_of",
    "meshreel_track_of",
    "meshreel_triangles",
    "page_check_image",
    "page_open",
)
# Functions of `reel.h` that it calls to cut cells.
CELL_FUNCTIONS = ("reel_cell_size", "reel_cells_memory", "reel_cells_surface")


@dataclass(frozen=True)
class Target:
    """Compiler settings for this machine or for WebAssembly.

    Attributes
    ----------
    library : str
        File name of the library.
    flags : tuple of str
        Compiler flags in addition to `FLAGS`.
    triple : str
        The target triple of zig; empty for this machine.
    optimization : tuple of str
        Optimization flags of all files but those in `hot`; the last level takes effect.
    hot : dict of str to tuple of str
        Flags by file name, instead of `optimization`.
    linker : tuple of str
        Flags of the linker for WebAssembly; empty if the compiler links.
    """

    library: str
    flags: tuple[str, ...]
    triple: str = ""
    optimization: tuple[str, ...] = ()
    hot: Levels = field(default_factory=dict)
    linker: tuple[str, ...] = ()


RELEASE = "MESHREEL_RELEASE"
ELF = ("-O3", "-fPIC", "-shared")
MACH_O = (*ELF, "-Wl,-install_name,@rpath/libreel.dylib")
PE = ("-O3", "-shared", "-s")
# For installation from source: gcc takes 6 s instead of 15 s (-O3, all marked functions inlined);
# the library is as fast on lossless files and 5 % slower on others. Measured with
# `bench/core_builds.py` of fbb5bab9.
SOURCE_FLAGS = ("-DREEL_INLINE=static inline",)
SOURCE_HOT: Levels = {
    **dict.fromkeys(
        (
            "closest.c",
            "coordinates.c",
            "exact_items.c",
            "fields.c",
            "kriging.c",
            "surface_integers.c",
            "timeline.c",
        ),
        ("-O3",),
    ),
    **dict.fromkeys(
        (
            *("connectivity.c", "frames.c", "hierarchy.c", "order.c", "order_items.c"),
            *("predict.c", "smooth.c", "surface.c", "walk.c", "walk_codes.c"),
        ),
        ("-O2",),
    ),
}
# Loops over vectors: optimized for minimal size, their values would be spilled to memory.
WASM_HOT: Levels = dict.fromkeys(("predict.c", "smooth.c"), ("-Os",))
# The compiler of ziglang maps -Oz to -Os unless it is passed to the frontend.
SMALLEST = ("-Os", "-Xclang", "-Oz")
WASM = (
    "-flto",
    "-msimd128",
    "-mbulk-memory",
    "-fno-vectorize",
    "-fno-slp-vectorize",
    "-DREEL_DECODER_ONLY",
    "-DREEL_INLINE=static inline",  # a third smaller than forced inlining
)
# wasm-ld optimizes the whole program. `zig cc` does not forward the flags of its optimizer.
WASM_LINKER = (
    "--no-entry",
    "--gc-sections",
    "--strip-all",
    "--compress-relocations",
    "--stack-first",  # an overflow traps
    "-zstack-size=1048576",
    # These four: 5 % smaller after gzip, and as fast.
    "--mllvm=-disable-lsr",  # no separate pointer for each array of a loop
    "--mllvm=-inline-threshold=-100",  # inline only functions with one caller
    "--mllvm=-enable-merge-functions",
    "--mllvm=-enable-load-pre=false",
    "--export=__heap_base",
    *(f"--export={name}" for name in PAGE_FUNCTIONS),
)
# For web pages, optimized for size.
WASM_MODULE = Target(
    "reel_full.wasm",
    WASM,
    "wasm32-freestanding",
    optimization=SMALLEST,
    hot=WASM_HOT,
    linker=(*WASM_LINKER, *(f"--export={name}" for name in CELL_FUNCTIONS)),
)
TARGETS = {
    "wasm": WASM_MODULE,
    "wasm-meshes": replace(  # a fifth smaller: without exact values and cells
        WASM_MODULE,
        library="reel.wasm",
        flags=(*WASM, "-DREEL_MESHES_ONLY"),
        linker=WASM_LINKER,
    ),
}
LIBRARY, SHARED = {"win32": ("reel.dll", PE), "darwin": ("libreel.dylib", MACH_O)}.get(
    sys.platform, ("libreel.so", ELF)
)
HOST = (
    Target(LIBRARY, SHARED)
    if os.environ.get(RELEASE)
    else Target(LIBRARY, (*SHARED, *SOURCE_FLAGS), optimization=("-O1",), hot=SOURCE_HOT)
)
OUTPUT = KERNEL / HOST.library


def sources() -> list[Path]:
    """Return the source files of the library: the core and the file decoder."""
    return sorted(file for folder in (CORE, READER, INCLUDE) for file in folder.glob("*.[ch]"))


def zig(tool: str = "cc") -> list[str] | None:
    """Return the command of a tool in the package `ziglang`, or None if not installed."""
    if importlib.util.find_spec("ziglang") is None:
        return None
    return [sys.executable, "-m", "ziglang", tool]


def compiler() -> list[str] | None:
    """Return the command of a C compiler for this machine, or None if there is none."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in COMPILERS:
        if shutil.which(name):
            return [name]
    command = zig()
    # By default zig compiles for the exact processor it runs on.
    return command and [*command, "-mcpu=baseline"]


def commands(
    output: Path, extra: Sequence[str] = (), target: str | None = None
) -> tuple[list[list[str]], list[str]]:
    """Return the commands that compile the files, in any order, and the one that links them.

    They compile for this machine or a target of `TARGETS`, and must run in an empty folder.

    Raises
    ------
    RuntimeError
        If there is no compiler.
    """
    command = zig() if target else compiler()
    if command is None:
        raise RuntimeError(f"{target} needs the package ziglang" if target else NO_COMPILER)
    platform_target = TARGETS[target] if target else HOST
    flags = [
        *FLAGS,
        *platform_target.flags,
        *(("-target", platform_target.triple) if target else ()),
        *extra,
    ]
    cflags = [flag for flag in flags if not flag.startswith(("-Wl,", "-nostdlib", "-shared"))]
    files = [file for file in sources() if file.suffix == ".c"]
    objects = {file: f"{file.parent.name}_{file.stem}.o" for file in files}
    steps = [
        [
            *command,
            *cflags,
            *platform_target.hot.get(file.name, platform_target.optimization),
            "-c",
            str(file),
            "-o",
            name,
        ]
        for file, name in objects.items()
    ]
    linker = zig("wasm-ld") if platform_target.linker else None
    link = [*linker, *platform_target.linker] if linker else [*command, *flags]
    return steps, [*link, *sorted(objects.values()), "-o", str(output)]


def build(output: Path = OUTPUT, extra: Sequence[str] = (), target: str | None = None) -> Path:
    """Compile the library on all cores; `output` is replaced only on success.

    Raises
    ------
    RuntimeError
        If there is no compiler, or it fails; the message contains its output.
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
        raise RuntimeError(f"CC names the compiler {link[0]!r}, which does not exist") from error
    except subprocess.CalledProcessError as error:
        raise RuntimeError(f"the compiler failed:\n{error.stderr}") from error
    return output


def is_current(output: Path = OUTPUT) -> bool:
    """Return whether the library exists and is newer than its sources."""
    if not output.exists():
        return False
    built_at = output.stat().st_mtime
    return all(file.stat().st_mtime <= built_at for file in [*sources(), Path(__file__)])


def wheel_tag() -> str:
    """Return the platform tag of a wheel whose core was compiled for this machine only."""
    name = sysconfig.get_platform()
    if sys.platform == "darwin":  # Python may support older and other machines than the core
        oldest = os.environ.get("MACOSX_DEPLOYMENT_TARGET") or platform.mac_ver()[0]
        name = f"macosx-{max(int(oldest.split('.')[0] or 0), 11)}-0-{platform.machine()}"
    return name.replace("-", "_").replace(".", "_")


def main() -> None:
    """Compile the library to --output, or to where meshreel loads it from."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, help="path of the library")
    parser.add_argument("--target", choices=TARGETS, help="compile for this with ziglang")
    parser.add_argument("--warnings", action="store_true", help="warnings are errors")
    parser.add_argument("flags", nargs="*", help="additional compiler flags, after --")
    options = parser.parse_args()
    extra = [*(WARNINGS if options.warnings else ()), *options.flags]
    output = options.output or (Path(TARGETS[options.target].library) if options.target else OUTPUT)
    try:
        print(build(output, extra, options.target))
    except RuntimeError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
