"""The player, as built from `web/`: a page, and its script."""

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
"""The places in the page of what it carries, and of its script."""

SCRIPT_NAME = "player.js"

POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src blob:; "
    "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; media-src blob:; "
    "connect-src 'self' blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What the page may do where it is served: run its script and decoder, and ask its own server."""

UNPACKING = (
    "(async()=>{"
    'const text=atob(document.getElementById("packed").textContent);'
    "const bytes=Uint8Array.from(text,(letter)=>letter.charCodeAt(0));"
    'const stream=new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));'
    'const script=document.createElement("script");'
    "script.textContent=await new Response(stream).text();"
    "document.body.append(script)"
    "})()"
)
"""Runs the script that is packed inside the page."""


@dataclass(frozen=True)
class Page:
    """The built player.

    Attributes
    ----------
    html : str
        With `DATA` and `SCRIPT` in it.
    """

    html: str
    script: str

    def __post_init__(self) -> None:
        if DATA not in self.html or SCRIPT not in self.html:
            raise InvalidInputError("the page of the player has no place for data; build it anew")

    @property
    def served(self) -> str:
        """HTML for a server that has the script under `SCRIPT_NAME`."""
        return self._filled("", f'<script src="{SCRIPT_NAME}"></script>')

    def split(self, carried: Mapping[str, Any]) -> str:
        """HTML that carries something and has the script beside it.

        Parameters
        ----------
        carried : mapping
            As the page reads it: see `web/src/data.ts`.
        """
        return self._filled(_data(carried), f'<script src="{SCRIPT_NAME}"></script>')

    def whole(self, carried: Mapping[str, Any], *, level: int = zlib.Z_BEST_COMPRESSION) -> str:
        """HTML that carries something and its script, and needs no other file.

        Parameters
        ----------
        carried : mapping
        level : int
            How hard the script is deflated, 1..9.
        """
        packing = zlib.compressobj(level, zlib.DEFLATED, -zlib.MAX_WBITS)
        packed = base64_of(packing.compress(self.script.encode()) + packing.flush())
        script = f'<script id="packed" type="text/plain">{packed}</script>'
        return self._filled(_data(carried), f"{script}<script>{UNPACKING}</script>")

    def _filled(self, data: str, script: str) -> str:
        before, behind = self.html.split(DATA)
        middle, end = behind.split(SCRIPT)
        return before + data + middle + script + end


def built_page(folder: Traversable | None = None) -> Page:
    """The player.

    Parameters
    ----------
    folder : Path or other traversable, optional
        Another folder than that of the package.

    Raises
    ------
    InvalidInputError
        If it is missing; says how to get it.
    """
    place = FOLDER if folder is None else folder
    try:
        html = (place / "index.html").read_text(encoding="utf-8")
        return Page(html, (place / SCRIPT_NAME).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InvalidInputError(
            "the page of the player is missing from this installation: reinstall meshreel, or in a "
            "checkout run 'git checkout src/meshreel/app/viewer/page' or build it (web/README.md)"
        ) from None


def json_text(value: Any) -> str:
    """A value as JSON; numbers that are not finite become null."""
    return json.dumps(_finite(value), allow_nan=False, separators=(",", ":"))


def base64_of(data: bytes) -> str:
    """Bytes as text."""
    return base64.b64encode(data).decode()


def _data(carried: Mapping[str, Any]) -> str:
    """A script that cannot be ended by what it carries."""
    text = json_text(carried).replace("<", "\\u003c")
    return f"<script>window.MESHREEL={text}</script>"


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
