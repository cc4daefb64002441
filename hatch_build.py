"""Builds the core and the page of the player; hatchling calls this.

The core comes from `core/` by a C compiler: that of the machine, or the package `ziglang`, which is
asked for only where there is none. Without it nothing installs. The page comes from `web/` through
npm. Where that cannot be, everything else installs, and one line says so. An sdist carries the
built page, and what is made from it needs no Node.
"""

import runpy
import shutil
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PAGE = "src/meshreel/viewer/page/index.html"
SOURCES = ("web/src", "web/build.mjs", "web/index.html", "web/package-lock.json", "web/style.css")
COMMANDS = (("ci", "--no-audit", "--no-fund", "--fetch-retries=1"), ("run", "build"))
TIME_LIMIT_S = 600
COMPILE_CORE = "core/compile.py"
COMPILER = "ziglang>=0.13"


class BuildHook(BuildHookInterface):
    """Has the core and, as far as possible, the page there before files are collected."""

    def dependencies(self) -> list[str]:
        """What building needs beside hatchling: a compiler, where the machine has none."""
        if self.target_name != "wheel":
            return []
        compiler = runpy.run_path(str(Path(self.root) / COMPILE_CORE))["compiler"]()
        return [] if compiler else [COMPILER]

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
        if self.target_name == "wheel":
            core = runpy.run_path(str(root / COMPILE_CORE))
            if not core["is_current"]():
                core["build"]()
            build_data["artifacts"].append(f"/{core['TARGET'].relative_to(root).as_posix()}")
            build_data["pure_python"] = False
            platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
            build_data["tag"] = f"py3-none-{platform}"
        if not is_current(root):
            problem = build(root)
            if problem:
                kept = "is older than its sources" if (root / PAGE).exists() else "is left out"
                self.app.display_warning(f"the page of `meshreel view` {kept}: {problem}")
        build_data["artifacts"].append(f"/{PAGE}")


def is_current(root: Path) -> bool:
    """Whether the page is there and no source is newer; that of an sdist is as it should be."""
    page = root / PAGE
    if not page.exists():
        return False
    if (root / "PKG-INFO").exists():
        return True
    built = page.stat().st_mtime
    return all(source.stat().st_mtime <= built for source in sources(root))


def sources(root: Path) -> list[Path]:
    """The files that the page is made of."""
    named = [root / name for name in SOURCES]
    return [file for path in named for file in [path, *path.rglob("*")] if file.is_file()]


def build(root: Path) -> str:
    """Run npm; what kept it from building the page, or nothing."""
    npm = shutil.which("npm")
    if npm is None:
        return "building it needs Node (npm), which is not here"
    for command in COMMANDS:
        try:
            subprocess.run(
                [npm, *command],
                cwd=root / "web",
                check=True,
                timeout=TIME_LIMIT_S,
                capture_output=True,
                text=True,
            )
        except (OSError, subprocess.SubprocessError) as error:
            return f"`npm {' '.join(command)}` failed: {complaint(error)}"
    return ""


def complaint(error: Exception) -> str:
    """The first line of what a failed program said that is no mere warning, or the failure."""
    said = getattr(error, "stderr", None) or str(error)
    text = said if isinstance(said, str) else said.decode(errors="replace")
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return next((line for line in lines if " warn " not in line), type(error).__name__)
