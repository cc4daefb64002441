"""A stub of the built page, contents of exported pages, and players of small streams."""

import base64
import json
import re
from contextlib import contextmanager
from io import BytesIO

from meshreel.app.viewer.measuring import Comparison
from meshreel.app.viewer.original import Original
from meshreel.app.viewer.page import Page
from meshreel.app.viewer.player_data import PlayerData
from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile

PAGE = Page(
    "<!doctype html><html><head><!--meshreel-data--><title>p</title></head>"
    "<body><!--script--></body></html>",
    '1 < 2 && "<\\/script>"',
)


def write_page(folder):
    """Create the page in a folder, like a build."""
    folder.mkdir()
    (folder / "index.html").write_text(PAGE.html)
    (folder / "player.js").write_text(PAGE.script)
    return folder


def carried(html):
    """Return the contents of an exported page; embedded files as bytes."""
    (script,) = re.findall(r"<script>window\.MESHREEL=(.*?)</script>", html, re.S)
    return {
        name: base64.b64decode(part["base64"]) if "base64" in part else part
        for name, part in json.loads(script).items()
    }


@contextmanager
def opened_api(sequence, original=None, data=None, **options):
    """Return the input of a player of a sequence, with an optional original."""
    made = encode(sequence, **options.pop("encoding", {})) if data is None else data
    with ReelFile(BytesIO(made)) as reel:
        comparison = Comparison(reel, Original(original, reel)) if original else None
        api = PlayerData(
            reel, "file", lambda info: {"size": f"{info.n_frames} kB"}, comparison, **options
        )
        yield api
        if api.measuring:
            api.measuring.close()
