"""The player as built from `npm/src/page`: a page and its script."""

import base64
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

import numpy as np

from meshreel.errors import InvalidInputError

FOLDER: Traversable = files("meshreel.app.viewer") / "page"
DATA, SCRIPT = "<!--meshreel-data-->", "<!--script-->"
"""Placeholders of data and script in the page."""

SCRIPT_NAME = "player.js"
"""File name of the script."""

SCRIPT_TAG = f'<script type="module" src="{SCRIPT_NAME}"></script>'
"""HTML that loads the script."""

POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src blob:; "
    "style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src data:; "
    "media-src 'self' blob:; connect-src 'self' blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""Content policy of served pages: run script and decoder, and request from the same server."""

UNPACK_SCRIPT = (
    "(async()=>{"
    'const text=document.getElementById("packed-script").textContent;'
    "const bytes=Uint8Array.from(atob(text),(letter)=>letter.charCodeAt(0));"
    'const stream=new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));'
    "const script=await new Response(stream).text();"
    'await import(URL.createObjectURL(new Blob([script],{type:"text/javascript"})))'
    "})()"
)
"""Script that inflates the packed script and runs it."""


@dataclass(frozen=True)
class Page:
    """The built player."""

    html: str
    """Contains `DATA` and `SCRIPT`."""
    script: str
    """ECMAScript module that starts the player."""

    def __post_init__(self) -> None:
        if DATA not in self.html or SCRIPT not in self.html:
            raise InvalidInputError("the player page has no placeholder for data; rebuild it")

    @property
    def served(self) -> str:
        """HTML for a server that serves the script as `SCRIPT_NAME`."""
        return self._fill("", SCRIPT_TAG)

    def split(self, data: Mapping[str, Any]) -> str:
        """HTML with embedded data and a separate script.

        Parameters
        ----------
        data : mapping
            As `npm/src/page/data.ts` reads it.
        """
        return self._fill(_data_script(data), SCRIPT_TAG)

    def whole(self, data: Mapping[str, Any], *, level: int = zlib.Z_BEST_COMPRESSION) -> str:
        """HTML with embedded data and script.

        Parameters
        ----------
        data : mapping
            As `npm/src/page/data.ts` reads it.
        level : int
            Compression level of the script, 1..9.
        """
        packing = zlib.compressobj(level, zlib.DEFLATED, -zlib.MAX_WBITS)
        packed = base64_of(packing.compress(self.script.encode()) + packing.flush())
        element = f'<script id="packed-script" type="text/plain">{packed}</script>'
        return self._fill(_data_script(data), f"{element}<script>{UNPACK_SCRIPT}</script>")

    def _fill(self, data: str, script: str) -> str:
        before, after = self.html.split(DATA)
        middle, end = after.split(SCRIPT)
        return before + data + middle + script + end


def built_page(folder: Traversable | None = None) -> Page:
    """The built player.

    Parameters
    ----------
    folder : Path or other traversable, optional
        Default: the folder of the package.

    Raises
    ------
    InvalidInputError
        If a file is missing.
    """
    folder = FOLDER if folder is None else folder
    try:
        html = (folder / "index.html").read_text(encoding="utf-8")
        return Page(html, (folder / SCRIPT_NAME).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InvalidInputError(
            "the page of the player is missing from this installation: reinstall meshreel, or in a "
            "checkout run 'git checkout src/meshreel/app/viewer/page' or build it (CONTRIBUTING.md)"
        ) from None


def json_text(value: Any) -> str:
    """JSON of a value; numbers that are not finite become null."""
    return json.dumps(_finite(value), allow_nan=False, separators=(",", ":"))


def base64_of(data: bytes) -> str:
    """Base64 text of bytes."""
    return base64.b64encode(data).decode()


def _data_script(data: Mapping[str, Any]) -> str:
    """A script element with data, which cannot close the element."""
    text = json_text(data).replace("<", "\\u003c")
    return f"<script>window.MESHREEL={text}</script>"


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
