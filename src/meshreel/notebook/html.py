"""What a notebook shows of a sequence or a file: the player in a frame, or a picture."""

from contextlib import nullcontext
from html import escape
from io import BytesIO

from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.notebook.figures import heading_and_rows, rows_of, stream_rows
from meshreel.notebook.pictures import picture_html
from meshreel.sequence import MeshSequence
from meshreel.viewer.api import Api
from meshreel.viewer.export import page_pieces
from meshreel.viewer.page import page_text

MOST_PLAYED, MOST_ENCODED = 2_500_000, 300_000
"""Positions in all frames of a file, and of a sequence, which is encoded first, that are played
where nobody has asked: so many take a second or two."""

MOST_HTML_BYTES = 4_000_000
"""Of a player in a notebook, which keeps all that it shows."""

ALLOWED_ERROR = 1e-3
"""How far rounding may move a vertex of the player in a notebook, in diagonals."""

QUICK = 6
"""How hard data are deflated: the hardest takes twice the time for a few percent."""

HEIGHT_PX = 440


def html_of(shown: MeshSequence | ReelFile) -> str:
    """HTML of a sequence or a file: figures over its player, or over a picture of it.

    It plays where that is quick and small: `MOST_PLAYED`, `MOST_ENCODED`, `MOST_HTML_BYTES`.

    Parameters
    ----------
    shown : MeshSequence or ReelFile
    """
    most = MOST_PLAYED if isinstance(shown, ReelFile) else MOST_ENCODED
    frame = None
    if shown.n_frames * shown.n_verts <= most:
        frame = player_html(shown, MOST_HTML_BYTES)
    return frame or _picture_and_figures(shown)


def player_html(shown: MeshSequence | ReelFile, most_bytes: float = float("inf")) -> str | None:
    """HTML of the player in a frame; None if it is not built, cannot draw this, or is too large.

    A sequence is shown as `encode` makes it; a line says so.
    """
    encoded = isinstance(shown, MeshSequence)
    try:
        page = page_text()
        opened = ReelFile(BytesIO(encode(shown))) if isinstance(shown, MeshSequence) else shown
        with opened if encoded else nullcontext():
            api = Api(opened, shown.name, stream_rows, allowed_error=ALLOWED_ERROR)
            text = _joined(api, page, most_bytes)
    except InvalidInputError:  # not built, or of a size that nobody can draw
        return None
    if text is None:
        return None
    rows = rows_of(shown)
    if encoded:
        rows["shown"] = f"as encode() makes it by default, of {api.info.size_bytes:,} bytes"
    frame = (
        f'<iframe srcdoc="{escape(text)}" sandbox="allow-scripts allow-downloads" '
        f'allow="fullscreen" style="width: 100%; height: {HEIGHT_PX}px; border: 0"></iframe>'
    )
    return heading_and_rows(shown.name, rows) + frame


def _joined(api: Api, page: str, most_bytes: float) -> str | None:
    texts, size = [], 0
    for _, text in page_pieces(api, page, level=QUICK):
        texts.append(text)
        size += len(text)
        if size > most_bytes:
            return None
    return "".join(texts)


def _picture_and_figures(shown: MeshSequence | ReelFile) -> str:
    rows = rows_of(shown)
    picture = picture_html(shown)
    if not picture:
        rows["picture"] = "none, for so many faces"
    rows["to play it"] = "show()"
    return heading_and_rows(shown.name, rows) + picture
