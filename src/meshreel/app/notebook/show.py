"""Play a sequence or a file in the notebook, as HTML with its figures, or in the browser."""

import sys
import threading
import webbrowser
from collections.abc import Mapping
from contextlib import nullcontext, suppress
from functools import partial
from html import escape
from importlib import import_module
from io import BytesIO
from typing import Any

from meshreel.app.figures import player_rows
from meshreel.app.viewer.measuring import Comparison
from meshreel.app.viewer.original import Original
from meshreel.app.viewer.page import base64_of, built_page
from meshreel.app.viewer.player_data import PlayerData
from meshreel.app.viewer.server import ViewerServer
from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.counting import size_text

__all__ = ["html_of", "serve", "show"]

MAX_HTML_BYTES = 64_000_000
"""Limit of a player that `show` puts into a notebook."""

MAX_PLAYED, MAX_ENCODED = 2_500_000, 300_000
"""Limits of positions in all frames of a file, or of a sequence, which must be encoded first, to
play it automatically: loading takes a second or two."""

MAX_AUTOMATIC_BYTES = 4_000_000
"""Limit of an automatic player, because a notebook stores its output."""

DEFLATE_LEVEL = 6
"""Compression level of the player; level 9 doubles the time for a few percent."""

HEIGHT_PX = 440


def show(animation: MeshSequence | ReelFile, *, block: bool | None = None) -> None:
    """Play a sequence or a file; see `meshreel.model.showing.show`."""
    if hasattr(_shell(), "kernel"):  # a notebook, which shows HTML, and not a terminal
        display = import_module("IPython.display")
        html = player_html(animation, MAX_HTML_BYTES) or html_of(animation)
        display.display(display.HTML(html))
        return
    server = serve(animation)
    print(f"{animation.name or 'the animation'} plays at {server.url}")
    threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    if _is_prompt() if block is None else not block:
        return
    print("ctrl-C stops it")
    with suppress(KeyboardInterrupt):
        threading.Event().wait()
    server.shutdown()
    server.server_close()


def serve(animation: MeshSequence | ReelFile) -> ViewerServer:
    """Start a server in a thread; it compares a sequence of one segment with its encoding.

    Raises
    ------
    InvalidInputError
        If the page of the player is not built, or the model is too large or too small to draw.
    """
    comparison = None
    if isinstance(animation, ReelFile):
        reel = animation
    else:
        reel = ReelFile(BytesIO(encode(animation)), memory=OWN_STREAM)
        if animation.n_segments == 1:
            comparison = Comparison(reel, Original(animation, reel))
    server = ViewerServer(PlayerData(reel, animation.name, player_rows, comparison))
    if server.data.measuring is not None:
        server.data.measuring.start()
    serve = partial(server.serve_forever, poll_interval=0.1)  # seconds until `shutdown` is noticed
    threading.Thread(target=serve, name="meshreel-show", daemon=True).start()
    return server


def _is_prompt() -> bool:
    """Whether Python runs interactively."""
    return hasattr(sys, "ps1") or bool(sys.flags.interactive) or _shell() is not None


def _shell() -> Any:
    """The current IPython shell, if any."""
    ipython = sys.modules.get("IPython")
    return None if ipython is None else ipython.get_ipython()


def html_of(animation: MeshSequence | ReelFile) -> str:
    """HTML of a sequence or a file: figures, and a player of small ones.

    The limits of the player are `MAX_PLAYED`, `MAX_ENCODED` and `MAX_AUTOMATIC_BYTES`.
    """
    max_positions = MAX_PLAYED if isinstance(animation, ReelFile) else MAX_ENCODED
    player = None
    n_positions = sum(segment.n_frames * segment.n_verts for segment in animation.segments)
    if n_positions <= max_positions:
        player = player_html(animation, MAX_AUTOMATIC_BYTES)
    return player or heading_and_rows(
        animation.name, {**rows_of(animation), "to play it": "show()"}
    )


def player_html(animation: MeshSequence | ReelFile, max_bytes: float = float("inf")) -> str | None:
    """HTML of the player in a frame; None if it is not built, too large, or cannot draw the mesh.

    A sequence is encoded with default options; a line says so.
    """
    is_sequence = isinstance(animation, MeshSequence)
    try:
        page = built_page()
        reel = (
            ReelFile(BytesIO(encode(animation)), memory=OWN_STREAM)
            if isinstance(animation, MeshSequence)
            else animation
        )
        with reel if is_sequence else nullcontext():
            shown = PlayerData(reel, animation.name, player_rows)
            stream = {"base64": base64_of(shown.file.stored(0, shown.file.size_bytes))}
            data = {"facts": shown.facts(), "stream": stream}
            text = page.whole(data, level=DEFLATE_LEVEL)
    except InvalidInputError:  # the page is not built, or the model too large or small to draw
        return None
    if len(text) > max_bytes:
        return None
    rows = rows_of(animation)
    if is_sequence:
        rows["shown"] = f"encoded with default options, {shown.file.size_bytes:,} bytes"
    frame = (
        f'<iframe srcdoc="{escape(text)}" sandbox="allow-scripts allow-downloads" '
        f'allow="fullscreen" style="width: 100%; height: {HEIGHT_PX}px; border: 0"></iframe>'
    )
    return heading_and_rows(animation.name, rows) + frame


def rows_of(animation: MeshSequence | ReelFile) -> dict[str, str]:
    """Figures of a sequence or a file."""
    if isinstance(animation, ReelFile):
        return player_rows(animation.info())
    rate = f" at {animation.fps:g} fps" if animation.fps else ""
    return {
        "frames": f"{animation.n_frames:,}{rate}",
        "vertices": f"{max(segment.n_verts for segment in animation.segments):,}",
        "faces": f"{max(len(segment.faces) for segment in animation.segments):,}",
        "positions": f"{animation.dtype}, {size_text(animation.raw_size_bytes)} with faces",
    }


def heading_and_rows(name: str, rows: Mapping[str, str]) -> str:
    """HTML of a name and a line of figures."""
    items = " · ".join(f"<b>{escape(row)}</b> {escape(text)}" for row, text in rows.items())
    heading = f"<b>{escape(name)}</b><br>" if name else ""
    return f'<div style="font: 13px/1.5 sans-serif; margin: 2px 0 6px">{heading}{items}</div>'
