"""The player of a sequence or a file: in the notebook, or in the browser."""

import sys
import threading
import webbrowser
from contextlib import suppress
from importlib import import_module
from io import BytesIO
from typing import Any

from meshreel.app.notebook.figures import stream_rows
from meshreel.app.notebook.html import html_of, player_html
from meshreel.app.viewer.api import Api
from meshreel.app.viewer.comparison import Comparison
from meshreel.app.viewer.original import Original
from meshreel.app.viewer.server import ViewerServer
from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.model.sequence import MeshSequence

MOST_HTML_BYTES = 64_000_000
"""Of a player in a notebook that was asked for."""


def show(shown: MeshSequence | ReelFile, *, block: bool | None = None) -> None:
    """Play a sequence or a file; parameters and errors are those of `showing.show`."""
    if _is_notebook():
        display = import_module("IPython.display")
        display.display(display.HTML(player_html(shown, MOST_HTML_BYTES) or html_of(shown)))
        return
    server = serve(shown)
    print(f"{shown.name or 'the animation'} plays at {server.url}")
    threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    if _is_prompt() if block is None else not block:
        return
    print("ctrl-C stops it")
    with suppress(KeyboardInterrupt):
        threading.Event().wait()
    server.shutdown()
    server.server_close()


def serve(shown: MeshSequence | ReelFile) -> ViewerServer:
    """A server that plays it in a thread of its own; a sequence stands beside what `encode` makes.

    Raises
    ------
    InvalidInputError
        As `show`.
    """
    comparison = None
    if isinstance(shown, ReelFile):
        reel = shown
    else:
        reel = ReelFile(BytesIO(encode(shown)), memory=OWN_STREAM)
        comparison = Comparison(reel, Original(shown, reel))
    server = ViewerServer(Api(reel, shown.name, stream_rows, comparison))
    if server.api.measuring is not None:
        server.api.measuring.start()
    threading.Thread(target=server.serve_forever, name="meshreel-show", daemon=True).start()
    return server


def _is_notebook() -> bool:
    """Whether output goes to a notebook, which shows HTML; a terminal does not."""
    return hasattr(_shell(), "kernel")


def _is_prompt() -> bool:
    """Whether somebody types the lines one by one."""
    return hasattr(sys, "ps1") or bool(sys.flags.interactive) or _shell() is not None


def _shell() -> Any:
    """The shell of IPython that this runs in, if any."""
    ipython = sys.modules.get("IPython")
    return None if ipython is None else ipython.get_ipython()
