"""Build and check a wheel for each platform: `python core/wheels.py`.

Needs the packages `hatchling` and `ziglang`. The wheel for this machine is also run. The library
for Linux on arm64 decodes all conformance streams if qemu-aarch64 and a cross compiler are
installed (Debian: qemu-user, gcc-aarch64-linux-gnu).
"""

import argparse
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path

import abi
import compile as core
from binaries import read_binary

ROOT = core.CORE.parent
CHECK = ROOT / "conformance" / "check.c"
PAGE = {"meshreel/app/viewer/page/index.html", "meshreel/app/viewer/page/player.js"}
HEADERS = {"meshreel/kernel/meshreel.h", "meshreel/kernel/meshreel_threads.hpp"}
MACHINES = {
    "linux-x86_64": ("ELF", "x86_64"),
    "linux-aarch64": ("ELF", "aarch64"),
    "macosx-arm64": ("Mach-O", "arm64"),
    "macosx-x86_64": ("Mach-O", "x86_64"),
    "win-amd64": ("PE", "amd64"),
}
MAY_IMPORT = {"bcmp", "memcmp", "memcpy", "memmove", "memset"}
"""Symbols that an ELF library may import from its process."""
SYSTEM = re.compile(
    r"kernel32\.dll|ntdll\.dll|ucrtbase\.dll|api-ms-win-crt-.*|/usr/lib/libSystem.*"
)
"""Libraries that are part of Windows and of macOS."""
TRIAL = """
import sys, numpy as np, meshreel
assert meshreel.__file__.startswith(sys.argv[1]), meshreel.__file__
steps = np.linspace(0, 1, 9)
x, y = map(np.ravel, np.meshgrid(steps, steps))
vertices = np.stack([np.stack([x, y, np.sin(6 * x + t)], 1) for t in range(8)])
at = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
faces = np.concatenate([np.stack([at, at + 1, at + 9], 1), np.stack([at + 1, at + 10, at + 9], 1)])
given = meshreel.MeshSequence(vertices, faces)
error = np.abs(meshreel.decode(meshreel.encode(given)).vertices - given.vertices).max()
assert error < 0.01, error
"""


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


def run_wheel(wheel: Path) -> None:
    """Encode and decode with the contents of a wheel.

    Raises
    ------
    subprocess.CalledProcessError
        If encoding or decoding fails.
    """
    with tempfile.TemporaryDirectory() as work:
        with zipfile.ZipFile(wheel) as archive:
            archive.extractall(work)
        environment = {**os.environ, "PYTHONPATH": work, "PYTHONSAFEPATH": "1"}
        subprocess.run([sys.executable, "-c", TRIAL, work], check=True, env=environment)


def run_emulated(wheel: Path) -> bool:
    """Decode all conformance streams with an arm64 wheel; return False if that cannot run here.

    Raises
    ------
    RuntimeError
        If the results differ from those of the core compiled for this machine.
    """
    compilers = shutil.which("cc"), shutil.which("aarch64-linux-gnu-gcc")
    if None in compilers or shutil.which("qemu-aarch64") is None:
        return False
    library = "meshreel/kernel/" + core.TARGETS["linux-aarch64"].library
    sources = [file for file in core.sources() if file.suffix == ".c"]
    with tempfile.TemporaryDirectory() as work:
        with zipfile.ZipFile(wheel) as archive:
            parts = [sources, [Path(archive.extract(library, work))]]
        programs = [Path(work, "here"), Path(work, "there")]
        for compiler, files, program in zip(compilers, parts, programs, strict=True):
            command = [compiler, *core.FLAGS, f"-I{core.INCLUDE}", CHECK, *files, "-o", program]
            subprocess.run([str(one) for one in command], check=True)
        emulator = ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"]
        for stream in sorted(CHECK.with_name("streams").glob("*.reel")):
            outputs = Path(work, "here.out"), Path(work, "there.out")
            for before, program, output in zip(([], emulator), programs, outputs, strict=True):
                subprocess.run([*before, program, stream, output], check=True)
            if outputs[0].read_bytes() != outputs[1].read_bytes():
                raise RuntimeError(f"{wheel.name} decodes {stream.name} to other numbers")
    return True


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
        was_run = False
        if is_for_this_machine(target) and not problems:
            run_wheel(wheel)
            was_run = True
        elif target == "linux-aarch64" and not problems:
            was_run = run_emulated(wheel)
        outcome = "checked and run" if was_run else "checked, not run"
        print(f"{wheel.name}: {'; '.join(problems) or outcome}", flush=True)
        bad |= bool(problems)
    sys.exit(bad)


if __name__ == "__main__":
    main()
