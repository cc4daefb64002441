"""HTML of a sequence or a file for notebooks: its figures, and the player."""

from collections.abc import Mapping
from contextlib import nullcontext
from html import escape
from io import BytesIO

from meshreel.app.figures import player_rows
from meshreel.app.viewer.page import Page, base64_of, built_page
from meshreel.app.viewer.player_data import PlayerData
from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.counting import size_text

MAX_PLAYED, MAX_ENCODED = 2_500_000, 300_000
"""Limits of positions in all frames of a file, or of a sequence, which must be encoded first, to
play it automatically: loading takes a second or two."""

MAX_HTML_BYTES = 4_000_000
"""Limit of an automatic player, because a notebook stores its output."""

DEFLATE_LEVEL = 6
"""Compression level of the player; level 9 doubles the time for a few percent."""

HEIGHT_PX = 440


def html_of(animation: MeshSequence | ReelFile) -> str:
    """HTML of a sequence or a file: figures, and a player of small ones.

    The limits of the player are `MAX_PLAYED`, `MAX_ENCODED` and `MAX_HTML_BYTES`.
    """
    max_positions = MAX_PLAYED if isinstance(animation, ReelFile) else MAX_ENCODED
    player = None
    n_positions = sum(segment.n_frames * segment.n_verts for segment in animation.segments)
    if n_positions <= max_positions:
        player = player_html(animation, MAX_HTML_BYTES)
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
            text = _page_text(shown, page)
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


def _page_text(shown: PlayerData, page: Page) -> str:
    stream = {"base64": base64_of(shown.file.stored(0, shown.file.size_bytes))}
    return page.whole({"facts": shown.facts(), "stream": stream}, level=DEFLATE_LEVEL)


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
