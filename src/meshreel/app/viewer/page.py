"""The player as built from `npm/src/page`: a page and its scripts."""

import base64
import json
import re
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
"""The script that starts the player; it loads other scripts of the page on demand."""

POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src blob:; "
    "style-src 'unsafe-inline'; img-src 'self' data: blob:; font-src data:; "
    "media-src 'self' blob:; connect-src 'self' blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""Content policy of served pages: run script and decoder, and request from the same server."""

UNPACKING = (
    "(async()=>{"
    "const urls={};"
    'for(const part of document.querySelectorAll("script[data-name]")){'
    "const bytes=Uint8Array.from(atob(part.textContent),(letter)=>letter.charCodeAt(0));"
    'const stream=new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));'
    "let text=await new Response(stream).text();"
    'for(const name in urls)text=text.replaceAll(`"./${name}"`,`"${urls[name]}"`);'
    'const script=new Blob([text],{type:"text/javascript"});'
    "urls[part.dataset.name]=URL.createObjectURL(script)"
    "}"
    f'await import(urls["{SCRIPT_NAME}"])'
    "})()"
)
"""Script that inflates the packed scripts, lets them import each other, and runs the player.

The browser parses only those that are imported.
"""


@dataclass(frozen=True)
class Page:
    """The built player.

    Attributes
    ----------
    html : str
        Contains `DATA` and `SCRIPT`.
    scripts : mapping of str to str
        ECMAScript modules by file name, which import each other as "./NAME"; `SCRIPT_NAME` starts
        the player.
    """

    html: str
    scripts: Mapping[str, str]

    def __post_init__(self) -> None:
        if SCRIPT_NAME not in self.scripts:
            raise InvalidInputError(f"the player page has no {SCRIPT_NAME}; rebuild it")
        if DATA not in self.html or SCRIPT not in self.html:
            raise InvalidInputError("the player page has no placeholder for data; rebuild it")

    @property
    def served(self) -> str:
        """HTML for a server that serves the scripts by their names."""
        return self._filled("", self._starting)

    def split(self, data: Mapping[str, Any]) -> str:
        """HTML with embedded data and separate scripts.

        Parameters
        ----------
        data : mapping
            As `npm/src/page/data.ts` reads it.
        """
        return self._filled(_data_script(data), self._starting)

    def whole(self, data: Mapping[str, Any], *, level: int = zlib.Z_BEST_COMPRESSION) -> str:
        """HTML with embedded data and scripts.

        Parameters
        ----------
        data : mapping
            As `npm/src/page/data.ts` reads it.
        level : int
            Compression level of the scripts, 1..9.
        """
        packed = [
            f'<script data-name="{name}" type="text/plain">{_packed(self.scripts[name], level)}'
            "</script>"
            for name in self._import_order()
        ]
        scripts = "".join(packed)
        return self._filled(_data_script(data), f"{scripts}<script>{UNPACKING}</script>")

    @property
    def _starting(self) -> str:
        """HTML that starts the player and, at the same time, requests the scripts that it needs."""
        needed = re.findall(r'(?:from|import)\s*"\./([^"]+)"', self.scripts[SCRIPT_NAME])
        links = [f'<link rel="modulepreload" href="{name}">' for name in needed]
        return "".join(links) + f'<script type="module" src="{SCRIPT_NAME}"></script>'

    def _import_order(self) -> list[str]:
        """Names of the scripts, each after those that it imports."""
        order: list[str] = []

        def add(name: str, importers: tuple[str, ...]) -> None:
            if name in importers:
                raise InvalidInputError(
                    f"scripts of the player page import each other: {importers}"
                )
            for other in self.scripts:
                if other not in order and f'"./{other}"' in self.scripts[name]:
                    add(other, (*importers, name))
            order.append(name)

        add(SCRIPT_NAME, ())
        return order

    def _filled(self, data: str, script: str) -> str:
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
        names = {
            SCRIPT_NAME,
            *(file.name for file in folder.iterdir() if file.name.endswith(".js")),
        }
        scripts = {name: (folder / name).read_text(encoding="utf-8") for name in sorted(names)}
        return Page(html, scripts)
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


def _packed(script: str, level: int) -> str:
    """Base64 text of a deflated script."""
    packing = zlib.compressobj(level, zlib.DEFLATED, -zlib.MAX_WBITS)
    return base64_of(packing.compress(script.encode()) + packing.flush())


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
