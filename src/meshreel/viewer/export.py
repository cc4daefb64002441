"""The player as one file that needs no server: the page with its data inside."""

import base64
import json
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from meshreel.errors import InvalidInputError
from meshreel.metrics.heat import HEATS
from meshreel.runtime.outputs.atomic import replace_when_done
from meshreel.runtime.progress import Progress, silent
from meshreel.viewer.api import Api, finite
from meshreel.viewer.page import MARKER, page_text

ALLOWED_ERROR = 9e-5
"""How far rounding may move a vertex of an exported page, in diagonals."""

MOST_ORIGINAL_BYTES = 1 << 30
"""Of positions and heat maps of the original, before they are deflated."""


def export_page(
    api: Api,
    path: Path,
    *,
    page: str | None = None,
    overwrite: bool = False,
    progress: Progress = silent,
) -> dict[str, int]:
    """Write the player of a file as one HTML file; gives the sizes of its parts.

    Parameters
    ----------
    api : Api
        If it has an original, positions and heat maps of that are written too, frame by frame.
    path : Path
        Appears when all is written.
    page : str, optional
        HTML of the player; default that of the package.
    overwrite : bool, default False
    progress : callable, optional

    Returns
    -------
    dict of str to int
        Bytes of the "player", of the "animation", and of the "original" if there is one.

    Raises
    ------
    InvalidInputError
        If the page is not built or has no place for data, the file exists, or the original is too
        large for a page.
    CorruptStreamError
        If a block is damaged.
    """
    pieces = page_pieces(api, page_text() if page is None else page, progress=progress)
    sizes = {"player": 0, "animation": 0}
    with (
        replace_when_done(path, overwrite=overwrite) as temporary,
        temporary.open("w", encoding="utf-8", newline="\n") as file,
    ):
        for part, text in pieces:
            file.write(text)
            sizes[part] = sizes.get(part, 0) + len(text.encode())
    return sizes


def page_pieces(
    api: Api, page: str, *, level: int = zlib.Z_BEST_COMPRESSION, progress: Progress = silent
) -> Iterator[tuple[str, str]]:
    """The page with its data inside, in pieces: which part each is of, and its text.

    Parameters
    ----------
    api : Api
    page : str
        HTML of the player.
    level : int
        How hard data are deflated, 1..9.
    progress : callable, optional

    Raises
    ------
    InvalidInputError, CorruptStreamError
        As `export_page`.
    """
    before, marker, behind = page.partition(MARKER)
    if not marker:
        raise InvalidInputError("the page of the player has no place for data; build it anew")
    _check_size(api)
    yield "player", before
    yield "animation", "<script>window.MESHREEL={"
    for number, (part, name, value) in enumerate(_entries(api, level, progress)):
        yield part, f"{',' if number else ''}{_script_text(name)}:{_script_text(value)}"
    yield "animation", "}</script>"
    yield "player", behind


def _check_size(api: Api) -> None:
    if api.comparison is None:
        return
    size = api.reel.n_frames * api.reel.n_verts * 4 * (3 + len(HEATS))
    if size > MOST_ORIGINAL_BYTES:
        raise InvalidInputError(
            f"the original would add {size / 1e9:.1f} GB to the page before compression; "
            "leave --original out, or use meshreel view"
        )


def _entries(api: Api, level: int, progress: Progress) -> Iterator[tuple[str, str, Any]]:
    """Every request of the page: which part of the file it belongs to, its path, and its answer."""
    if api.measuring is not None:
        api.measuring.run(progress)
        yield "original", "api/plots", api.plots()
    yield "animation", "api/reel", api.described()
    yield "animation", "api/faces", _deflated(api.faces(), level)
    n_blocks = len(api.reel.starts) - 1
    for number in range(n_blocks):
        yield "animation", f"api/block/{number}", _deflated(api.block(number), level)
        progress("blocks", (number + 1) / n_blocks)
    n_frames = api.reel.n_frames if api.comparison else 0
    for frame in range(n_frames):
        yield "original", f"api/original/{frame}", _deflated(api.original(frame), level)
        for kind in HEATS:
            yield "original", f"api/heat/{kind}/{frame}", _deflated(api.heat(kind, frame), level)
        progress("original", (frame + 1) / n_frames)


def _deflated(packet: bytes, level: int) -> str:
    """A packet as text: deflated without a header, then base64."""
    packing = zlib.compressobj(level, zlib.DEFLATED, -zlib.MAX_WBITS)
    return base64.b64encode(packing.compress(packet) + packing.flush()).decode()


def _script_text(value: Any) -> str:
    """A value as JavaScript that cannot end the script it stands in."""
    text = json.dumps(finite(value), allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c")
