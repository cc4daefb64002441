"""Pythons of other platforms that run on Linux, to try wheels: `core/wheels.py` calls this.

Linux on arm64: Debian's packages, run by qemu-aarch64 (Debian: qemu-user).
Windows on x86-64: CPython's library and extension modules from the wheel of Panda3D, which brings
them for programs that embed Python; the standard library of the Python that runs this; and a
launcher compiled by ziglang. Run by Wine (Debian: wine64).
"""

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import compile as core

VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"
LAUNCHER = """
#include <wchar.h>
int Py_Main(int, wchar_t **);
int wmain(int count, wchar_t **words) { return Py_Main(count, words); }
"""
APT = """
APT::Architecture "arm64";
APT::Architectures {{ "arm64"; }};
APT::Install-Recommends "false";
Dir::State::Lists "{folder}/lists";
Dir::State::status "{folder}/status";
Dir::Cache "{folder}/cache";
"""
"""Settings by which apt-get resolves packages of arm64 and leaves those of the machine alone."""
MUSL_LOADER = "lib/ld-musl-{machine}.so.1"


class MissingError(Exception):
    """An emulator or a package is not available; the message says which."""


@dataclass(frozen=True)
class Python:
    """A Python and the packages that it runs with.

    Attributes
    ----------
    command : tuple of str
        Words that run it, by an emulator if it is for another platform.
    site : Path
        Folder of packages that it imports.
    pip : tuple of str
        Options by which pip selects wheels for it; empty for this machine.
    packages : tuple of str
        Requirements of the conformance streams, in versions that the emulator can run.
    environment : dict of str to str
        Variables that it needs.
    """

    command: tuple[str, ...]
    site: Path
    pip: tuple[str, ...] = ()
    packages: tuple[str, ...] = ("scipy",)
    environment: dict[str, str] = field(default_factory=dict)

    def install(self, wheel: Path) -> None:
        """Install a wheel with its dependencies.

        Raises
        ------
        MissingError
            If a dependency is not available.
        """
        options = ["--quiet", "--target", os.fspath(self.site), *self.pip]
        _need(sys.executable, "-m", "pip", "install", *options, wheel, *self.packages)

    def run(self, *arguments: str, folder: Path) -> str:
        """Run it in a folder, and return its output.

        Raises
        ------
        RuntimeError
            If it fails; the message contains its output.
        """
        # Spinning threads of OpenBLAS take most of the time of an emulator.
        own = {"OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": "", **self.environment}
        # Not a file for the output: Wine does not accept every one.
        done = subprocess.run(
            [*self.command, *arguments],
            cwd=folder,
            env={**os.environ, **own},
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            raise RuntimeError(f"{' '.join(arguments)}: {done.stdout}{done.stderr}")
        return done.stdout


def python_here(folder: Path) -> Python:
    """Return the Python that runs this, with a separate folder of packages."""
    site = folder / "site"
    return Python((sys.executable,), site, environment={"PYTHONPATH": os.fspath(site)})


def python_for_arm64(folder: Path) -> Python:
    """Return Debian's Python for arm64, run by qemu.

    Raises
    ------
    MissingError
        If qemu or Debian's packages are not available.
    """
    root, site = folder / "root", folder / "site"
    command = (*qemu(root), os.fspath(root / "usr/bin/python3"))
    unpack_for_arm64(root, "python3", "libstdc++6")
    query = "import sys; print('%d.%d' % sys.version_info[:2])"
    version = _need(*command, "-c", query).strip()
    tags = [f"manylinux_2_{minor}_aarch64" for minor in (28, 27, 17)] + ["manylinux2014_aarch64"]
    return Python(command, site, _pip(version, *tags), environment={"PYTHONPATH": os.fspath(site)})


def python_for_windows(folder: Path) -> Python:
    """Return a Python for Windows, run by Wine.

    Raises
    ------
    MissingError
        If Wine or the wheel of Panda3D is not available.
    """
    if shutil.which("wine") is None:
        raise MissingError("Wine is not installed (Debian: wine64, wine)")
    root, tag = folder / "python", _pip(VERSION, "win_amd64")
    downloads = folder / "downloads"
    options = ["--quiet", "--no-deps", "--dest", os.fspath(downloads), *tag]
    _need(sys.executable, "-m", "pip", "download", *options, "panda3d")
    (root / "DLLs").mkdir(parents=True)
    (wheel,) = downloads.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        for name in map(Path, archive.namelist()):
            # Windows has the libraries api-ms-*, and so has Wine.
            if name.parts[0] == "deploy_libs" and not name.name.startswith("api-ms-"):
                beside = name.name.lower().startswith(("python", "vcruntime"))
                target = root / name.name if beside else root / "DLLs" / name.name
                target.write_bytes(archive.read(name.as_posix()))
    left_out = shutil.ignore_patterns("site-packages", "test", "lib-dynload", "__pycache__")
    shutil.copytree(sysconfig.get_path("stdlib"), root / "Lib", ignore=left_out)
    _compile_launcher(root)
    site = root / "Lib/site-packages"
    environment = {"WINEPREFIX": os.fspath(folder / "prefix"), "WINEDEBUG": "-all"}
    # Wine 8 lacks functions of complex numbers that later versions import.
    packages = ("scipy<1.13", "numpy<2", "colorama")
    return Python(("wine", os.fspath(root / "python.exe")), site, tag, packages, environment)


def _compile_launcher(root: Path) -> None:
    command, library = core.zig(), f"python{VERSION.replace('.', '')}"
    assert command is not None  # `wheels.main` requires it
    zig, names = command[:-1], ["launcher.c", "python.def", "libpython.a"]
    source, exports, imports = (root / name for name in names)
    source.write_text(LAUNCHER)
    exports.write_text(f"LIBRARY {library}.dll\nEXPORTS\nPy_Main\n")
    _need(*zig, "dlltool", "-m", "i386:x86-64", "-d", exports, "-l", imports)
    triple = core.TARGETS["win-amd64"].triple
    program = root / "python.exe"
    _need(*zig, "cc", "-target", triple, "-municode", source, imports, "-o", program)


def musl_loader(machine: str, folder: Path) -> list[str]:
    """Return the words before a program that is linked with musl, on x86_64 or aarch64.

    Raises
    ------
    MissingError
        If musl or an emulator is not available.
    """
    loader = MUSL_LOADER.format(machine=machine)
    if machine == platform.machine():
        if not Path("/", loader).exists():
            raise MissingError("musl is not installed (Debian: musl)")
        return []
    if machine != "aarch64":
        raise MissingError(f"no emulator of {machine} is used")
    command = qemu(folder)
    unpack_for_arm64(folder, "musl")
    return command


def qemu(root: Path) -> list[str]:
    """Return the words that run a program for Linux on arm64, with the libraries of a folder.

    Raises
    ------
    MissingError
        If qemu is not installed.
    """
    if shutil.which("qemu-aarch64") is None:
        raise MissingError("qemu-aarch64 is not installed (Debian: qemu-user)")
    return ["qemu-aarch64", "-L", os.fspath(root)]


def unpack_for_arm64(root: Path, *packages: str) -> None:
    """Unpack Debian's packages for arm64, and those that they depend on, into a folder.

    Raises
    ------
    MissingError
        If they are not available.
    """
    if shutil.which("apt-get") is None or shutil.which("dpkg-deb") is None:
        raise MissingError("Debian's packages for arm64 need apt-get and dpkg-deb")
    work = root.with_name(root.name + "-packages")
    for name in ("lists/partial", "cache/archives/partial"):
        (work / name).mkdir(parents=True)
    (work / "status").touch()
    settings = work / "apt.conf"
    settings.write_text(APT.format(folder=work))
    environment = {"APT_CONFIG": os.fspath(settings)}
    _need("apt-get", "-q", "update", **environment)
    _need("apt-get", "-qy", "install", "--download-only", *packages, **environment)
    for package in sorted(work.glob("cache/archives/*.deb")):
        _need("dpkg-deb", "-x", package, root)


PYTHONS: dict[str, Callable[[Path], Python]] = {
    "linux-aarch64": python_for_arm64,
    "win-amd64": python_for_windows,
}
"""The function that prepares a Python, by target; it runs on Linux on x86-64."""


def _pip(version: str, *tags: str) -> tuple[str, ...]:
    platforms = [word for tag in tags for word in ("--platform", tag)]
    return (*platforms, "--python-version", version, "--only-binary=:all:")


def _need(*command: str | Path, **environment: str) -> str:
    """Run a command that prepares a trial; return its output."""
    words = list(map(str, command))
    done = subprocess.run(words, env={**os.environ, **environment}, capture_output=True, text=True)
    if done.returncode:
        lines = (done.stderr.strip() or done.stdout.strip()).splitlines()
        raise MissingError(f"{Path(words[0]).name}: {lines[-1] if lines else done.returncode}")
    return done.stdout
