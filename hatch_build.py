"""Builds the core, and the description on PyPI; hatchling calls this.

The core comes from `core/` by a C compiler: that of the machine, or the package `ziglang`, which is
requested only where there is none. Without it nothing installs. The page of the player is part of
the repository, so that an installation needs neither Node nor a compiler for WebAssembly; a test
proves that it is what `npm/` builds.
"""

import os
import re
import runpy
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

COMPILE_CORE = "core/compile.py"
HEADERS = ("meshreel.h", "meshreel_threads.hpp")
"""Files of `core/include`, for programs in C and C++."""
# This extra does not exist: if the package is unavailable, pip prints the requirement and with it
# the alternatives.
COMPILER = "ziglang[or-install-gcc-or-clang]>=0.13"

VERSION = re.compile(r'^__version__ = "(.+)"$', re.MULTILINE)
LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)#:\s]+)(#[^)\s]*)?\)")
"""A Markdown link or image with a relative target: mark, text, path, anchor."""


def with_absolute_links(text: str, repository: str, tag: str) -> str:
    """Return Markdown whose relative links lead to the files of a tag of the repository."""

    def absolute(match: re.Match[str]) -> str:
        mark, words, path, anchor = match.groups(default="")
        return f"{mark}[{words}]({repository}/{'raw' if mark else 'blob'}/{tag}/{path}{anchor})"

    return LINK.sub(absolute, text)


class ReadmeHook(MetadataHookInterface):
    """Sets the description: README.md, with links that work on PyPI."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the description to the metadata."""
        root = Path(self.root)
        source = root / "src/meshreel/runtime/version.py"
        [version] = VERSION.findall(source.read_text(encoding="utf-8"))
        text = (root / "README.md").read_text(encoding="utf-8")
        text = with_absolute_links(text, metadata["urls"]["Repository"], f"v{version}")
        metadata["readme"] = {"content-type": "text/markdown", "text": text}


class BuildHook(BuildHookInterface):
    """Compiles the core before the files of a wheel are collected."""

    def dependencies(self) -> list[str]:
        """Return what building needs besides hatchling: a compiler, where the machine has none."""
        core = runpy.run_path(str(Path(self.root) / COMPILE_CORE))
        return [COMPILER] if self.target_name == "wheel" and not core["compiler"]() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile the core for a wheel, unless that of the checkout is current.

        The headers for programs in C and C++ are packaged too; in a checkout they stay in place.

        Parameters
        ----------
        version : str
            "standard" or "editable"; both need it.
        build_data : dict
            What hatchling goes by; git ignores the library, so it is named here.
        """
        if self.target_name != "wheel":
            return
        root = Path(self.root)
        core = runpy.run_path(str(root / COMPILE_CORE))
        try:
            is_current = core["is_current"]() and not os.environ.get(core["RELEASE"])
            library = core["OUTPUT"] if is_current else core["build"]()
        except RuntimeError as error:
            self.app.abort(f"meshreel cannot be built: {error}")
        build_data["artifacts"].append(f"/{library.relative_to(root).as_posix()}")
        if version == "standard":
            for name in HEADERS:
                header = root / "core" / "include" / name
                build_data["force_include"][str(header)] = f"meshreel/kernel/{name}"
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{core['wheel_tag']()}"
