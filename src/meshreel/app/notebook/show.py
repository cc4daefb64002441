"""Play a sequence or a file in the notebook or in the browser."""

import sys
import threading
import webbrowser
from contextlib import suppress
from functools import partial
from importlib import import_module
from io import BytesIO
from typing import Any

from meshreel.app.figures import player_rows
from meshreel.app.notebook.html import html_of, player_html
from meshreel.app.viewer.measuring import Comparison
from meshreel.app.viewer.original import Original
from meshreel.app.viewer.player_data import PlayerData
from meshreel.app.viewer.server import ViewerServer
from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.model.sequence import MeshSequence

__all__ = ["html_of", "serve", "show"]

MAX_HTML_BYTES = 64_000_000
"""Limit of a player that `show` puts into a notebook."""


def show(animation: MeshSequence | ReelFile, *, block: bool | None = None) -> None:
    """Play a sequence or a file; see `meshreel.model.showing.show`."""
    if _is_notebook():
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


def _is_notebook() -> bool:
    """Whether the output is a notebook, which shows HTML, and not a terminal."""
    return hasattr(_shell(), "kernel")


def _is_prompt() -> bool:
    """Whether Python runs interactively."""
    return hasattr(sys, "ps1") or bool(sys.flags.interactive) or _shell() is not None


def _shell() -> Any:
    """The current IPython shell, if any."""
    ipython = sys.modules.get("IPython")
    return None if ipython is None else ipython.get_ipython()
