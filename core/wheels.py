"""Build and check a wheel for each platform: `python core/wheels.py`.

Needs the packages `hatchling` and `ziglang`. Each wheel that can run here runs the demo and decodes
the conformance streams: that for this machine and, on Linux on x86-64, those for Linux on arm64 and
for Windows, by qemu and Wine (`emulation.py`). With musl, a program in C decodes the streams. The
output says what was not run, and why.
"""

import argparse
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import abi
import compile as core
import emulation
from binaries import read_binary

ROOT = core.CORE.parent
CHECK = ROOT / "conformance" / "check.c"
STREAMS = ROOT / "conformance" / "streams"
PAGE = {"meshreel/app/viewer/page/index.html", "meshreel/app/viewer/page/player.js"}
HEADERS = {"meshreel/kernel/meshreel.h", "meshreel/kernel/meshreel_threads.hpp"}
MACHINES = {
    "linux-x86_64": ("ELF", "x86_64"),
    "linux-aarch64": ("ELF", "aarch64"),
    "macosx-arm64": ("Mach-O", "arm64"),
    "macosx-x86_64": ("Mach-O", "x86_64"),
    "win-amd64": ("PE", "amd64"),
    "win-arm64": ("PE", "arm64"),
}
MAY_IMPORT = {"bcmp", "memcmp", "memcpy", "memmove", "memset"}
"""Symbols that an ELF library may import from its process."""
SYSTEM = re.compile(
    r"kernel32\.dll|ntdll\.dll|ucrtbase\.dll|api-ms-win-crt-.*|/usr/lib/libSystem.*"
)
"""Libraries that are part of Windows and of macOS."""
DEMO_FRAMES = 20
"""Frames of the demo; an emulator takes seconds for each."""


def make_wheel(target: str, folder: Path) -> Path:
    """Build the wheel for a platform in a folder.

    Raises
    ------
    RuntimeError
        If hatchling fails.
    """
    with tempfile.TemporaryDirectory() as work:
        done = subprocess.run(
            [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", work],
            cwd=ROOT,
            env={**os.environ, "MESHREEL_TARGET": target},
            capture_output=True,
            text=True,
        )
        if done.returncode:
            raise RuntimeError(f"{target}: {done.stdout}{done.stderr}")
        (made,) = Path(work).glob("*.whl")
        return Path(shutil.move(made, folder / made.name))


def declared() -> set[str]:
    """Return the functions declared in `reel.h` and `meshreel.h`."""
    text = (core.CORE / "reel.h").read_text()
    return {*re.findall(r"^REEL_API \w+ (reel_\w+)\(", text, re.MULTILINE), *abi.functions()}


def faults(wheel: Path, target: str) -> list[str]:
    """Return the faults of a wheel, as messages."""
    expected, found = core.TARGETS[target], []
    if not wheel.name.endswith(f"-py3-none-{expected.tag}.whl"):
        found.append(f"its name is {wheel.name}")
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        own = [name for name in names if name.endswith((".so", ".dylib", ".dll"))]
        if own != [f"meshreel/kernel/{expected.library}"]:
            return [*found, f"its libraries are {own}"]
        library = read_binary(archive.read(own[0]))
        metadata = archive.read(next(name for name in names if name.endswith("/WHEEL"))).decode()
    if not set(names) >= PAGE:
        found.append("the player page is missing")
    if not any(name.endswith("/THIRD_PARTY_LICENSES.md") for name in names):
        found.append("the licenses of the page's dependencies are missing")
    if lacking := HEADERS - set(names):
        found.append(f"the headers {sorted(lacking)} are missing")
    if "Root-Is-Purelib: false" not in metadata:
        found.append("its metadata claims that it is platform-independent")
    if (library.kind, library.machine) != MACHINES[target]:
        found.append(f"the library is {library.kind} for {library.machine}")
    if lacking := declared() - library.exported:
        found.append(f"the library does not export {sorted(lacking)}")
    if foreign := {name for name in library.needed if not SYSTEM.fullmatch(name)}:
        found.append(f"the library depends on {sorted(foreign)}")
    if library.kind == "ELF" and (more := library.imported - MAY_IMPORT):
        found.append(f"the library imports {sorted(more)}")
    return found


def is_for_this_machine(target: str) -> bool:
    """Return whether a wheel is for this machine."""
    system = {"linux": "linux", "darwin": "macosx", "win32": "win"}.get(sys.platform, "")
    return target == f"{system}-{platform.machine().lower()}"


def try_wheel(wheel: Path, target: str) -> str:
    """Run a wheel where that is possible; return what was run, or why it was not.

    Raises
    ------
    RuntimeError
        If the wheel does not run, or decodes a conformance stream to other values.
    """
    return "; ".join([_try_python(wheel, target), *_try_musl(wheel, target)])


def _try_python(wheel: Path, target: str) -> str:
    """Run the demo and decode the conformance streams, in Python."""
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        try:
            if is_for_this_machine(target):
                python = emulation.python_here(folder)
            elif is_for_this_machine("linux-x86_64") and target in emulation.PYTHONS:
                python = emulation.PYTHONS[target](folder)
            else:
                return "not run: no Python for this platform runs here"
            python.install(wheel)
        except emulation.MissingError as error:
            return f"not run: {error}"
        where = python.run("-c", "import meshreel; print(meshreel.__file__)", folder=folder).strip()
        if python.site.as_posix() not in where.replace("\\", "/"):
            raise RuntimeError(f"{where} was imported instead of {wheel.name}")
        python.run("-m", "meshreel", "demo", "--frames", str(DEMO_FRAMES), folder=folder)
        python.run("-m", "conformance.check", folder=ROOT)
        by = "" if python.command[0] == sys.executable else f" by {python.command[0]}"
    return f"demo and conformance streams run{by}"


def _try_musl(wheel: Path, target: str) -> list[str]:
    """Decode the conformance streams with a program that is linked with musl."""
    if not target.startswith("linux-") or not is_for_this_machine("linux-x86_64"):
        return []
    machine = target.removeprefix("linux-")
    with tempfile.TemporaryDirectory() as work:
        try:
            before = emulation.musl_loader(machine, Path(work, "root"))
        except emulation.MissingError as error:
            return [f"with musl not run: {error}"]
        decode_streams(wheel, target, f"{machine}-linux-musl", before, Path(work))
    return ["conformance streams decoded with musl" + (f" by {before[0]}" if before else "")]


def decode_streams(
    wheel: Path, target: str, triple: str, before: Sequence[str], folder: Path
) -> None:
    """Decode all conformance streams with the library of a wheel, in a program in C.

    Parameters
    ----------
    wheel : Path
    target : str
        Target of the wheel.
    triple : str
        What to compile the program for.
    before : sequence of str
        Words before the program.
    folder : Path
        For temporary files.

    Raises
    ------
    RuntimeError
        If it fails, or the values differ from those of the core compiled for this machine.
    """
    sources = [file for file in core.sources() if file.suffix == ".c"]
    with zipfile.ZipFile(wheel) as archive:
        name = f"meshreel/kernel/{core.TARGETS[target].library}"
        library = Path(archive.extract(name, folder))
    zig = core.zig()
    assert zig is not None  # `main` requires it
    expected, found = folder / "expected", folder / "found"
    common: list[str | Path] = ["-O2", *core.FLAGS, f"-I{core.INCLUDE}", CHECK]
    _run(*zig, *common, *sources, "-o", expected)
    _run(*zig, "-target", triple, "-dynamic", *common, library, "-o", found)
    for stream in sorted(STREAMS.glob("*.reel")):
        outputs = folder / "expected.out", folder / "found.out"
        _run(expected, stream, outputs[0])
        _run(*before, found, stream, outputs[1])
        if outputs[0].read_bytes() != outputs[1].read_bytes():
            raise RuntimeError(f"{stream.name} is decoded to other values")


def _run(*command: str | Path) -> None:
    words = list(map(str, command))
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{shlex.join(words)}: {done.stdout}{done.stderr}")


def main(arguments: Sequence[str] | None = None) -> None:
    """Build and check the requested wheels."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "dist")
    parser.add_argument("targets", nargs="*", help=f"of {', '.join(MACHINES)}; default: all")
    options = parser.parse_args(arguments)
    if core.zig() is None:
        sys.exit("wheels for other machines need the package ziglang: pip install ziglang")
    options.output.mkdir(parents=True, exist_ok=True)
    bad = False
    for target in options.targets or MACHINES:
        wheel = make_wheel(target, options.output)
        problems = faults(wheel, target)
        outcome = "checked"
        if not problems:
            try:
                outcome = f"checked; {try_wheel(wheel, target)}"
            except RuntimeError as error:
                problems = [str(error)]
        print(f"{wheel.name}: {'; '.join(problems) or outcome}", flush=True)
        bad |= bool(problems)
    sys.exit(bad)


if __name__ == "__main__":
    main()
