"""Build an archive of the C library for each platform: `python core/libraries.py`.

Each contains the headers, the static and the shared library, and the configuration files for CMake
and pkg-config. Needs CMake, ninja, and the package `ziglang`, which compiles for all platforms.
"""

import argparse
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import abi
import compile as core
from binaries import read_binary
from wheels import MACHINES, MAY_IMPORT, SYSTEM

SYSTEMS = {"linux": "Linux", "macosx": "Darwin", "win": "Windows"}
LIBRARIES = {
    "linux": ("lib/libmeshreel.so", "lib/libmeshreel.a"),
    "macosx": ("lib/libmeshreel.dylib", "lib/libmeshreel.a"),
    "win": ("bin/libmeshreel.dll", "lib/libmeshreel_static.a"),
}
"""Paths of the shared and of the static library."""
COMMON_FILES = (
    "include/meshreel.h",
    "include/meshreel_threads.hpp",
    "lib/cmake/meshreel/meshreel-config.cmake",
    "lib/cmake/meshreel/meshreel-targets.cmake",
    "lib/pkgconfig/meshreel.pc",
)


def install(target: str, prefix: Path) -> None:
    """Compile the libraries for a platform, and install them in a folder.

    Raises
    ------
    RuntimeError
        If CMake or a compiler fails.
    """
    system, processor = target.split("-", 1)
    with tempfile.TemporaryDirectory() as work:
        triple = core.TARGETS[target].triple
        tools = {name: _tool(Path(work, name), name, triple) for name in ("cc", "ar", "ranlib")}
        settings = {
            "CMAKE_SYSTEM_NAME": SYSTEMS[system],
            "CMAKE_SYSTEM_PROCESSOR": processor,
            "CMAKE_C_COMPILER": tools["cc"],
            "CMAKE_AR": tools["ar"],
            "CMAKE_RANLIB": tools["ranlib"],
            "CMAKE_BUILD_TYPE": "Release",
            "CMAKE_INSTALL_LIBDIR": "lib",
        }
        options = [f"-D{name}={value}" for name, value in settings.items()]
        build = Path(work, "build")
        _run("cmake", "-G", "Ninja", "-S", core.CORE, "-B", build, *options)
        _run("cmake", "--build", build)
        _run("cmake", "--install", build, "--prefix", prefix)


def _tool(path: Path, name: str, triple: str) -> Path:
    """Write a script that runs a program of ziglang, for CMake to call."""
    words = [sys.executable, "-m", "ziglang", name]
    words += ["-target", triple] if name == "cc" else []
    path.write_text(f'#!/bin/sh\nexec {shlex.join(words)} "$@"\n')
    path.chmod(0o755)
    return path


def _run(*command: str | Path) -> None:
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{shlex.join(map(str, command))}: {done.stdout}{done.stderr}")


def faults(prefix: Path, target: str) -> list[str]:
    """Return the faults of installed libraries, as messages."""
    libraries = LIBRARIES[target.split("-", 1)[0]]
    wanted = (*COMMON_FILES, *libraries)
    if lacking := [name for name in wanted if not (prefix / name).exists()]:
        return [f"files are missing: {lacking}"]
    found, library = [], read_binary((prefix / libraries[0]).read_bytes())
    if (library.kind, library.machine) != MACHINES[target]:
        found.append(f"the library is {library.kind} for {library.machine}")
    if lacking := sorted(set(abi.functions()) - library.exported):
        found.append(f"the library does not export {lacking}")
    if more := sorted(name for name in library.exported if name.startswith("reel_")):
        found.append(f"the library exports internal functions {more}")
    needed = {name for name in library.needed if not SYSTEM.fullmatch(name)}
    if foreign := sorted(name for name in needed if not name.startswith("libc.so")):
        found.append(f"the library depends on {foreign}")
    if library.kind == "ELF" and (more := sorted(library.imported - MAY_IMPORT)):
        found.append(f"the library imports {more}")
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Build and check the requested archives."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=core.CORE.parent / "dist")
    parser.add_argument("targets", nargs="*", help=f"of {', '.join(MACHINES)}; default: all")
    options = parser.parse_args(arguments)
    if core.zig() is None or not (shutil.which("cmake") and shutil.which("ninja")):
        sys.exit("libraries for all machines need CMake, ninja, and the package ziglang")
    options.output.mkdir(parents=True, exist_ok=True)
    bad = False
    for target in options.targets or MACHINES:
        with tempfile.TemporaryDirectory() as work:
            prefix = Path(work, f"meshreel-{target}")
            install(target, prefix)
            shutil.copy(core.CORE.parent / "LICENSE", prefix)
            problems = faults(prefix, target)
            kind = "zip" if target.startswith("win") else "gztar"
            made = shutil.make_archive(
                os.fspath(options.output / prefix.name), kind, work, prefix.name
            )
        print(f"{Path(made).name}: {'; '.join(problems) or 'checked'}", flush=True)
        bad |= bool(problems)
    sys.exit(bad)


if __name__ == "__main__":
    main()
