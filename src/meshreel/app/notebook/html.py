"""HTML of a sequence or a file for a notebook: the player in a frame, or a picture."""

from base64 import b64encode
from contextlib import nullcontext
from html import escape
from io import BytesIO

import numpy as np

from meshreel.app.notebook.figures import heading_and_rows, rows_of, stream_rows
from meshreel.app.viewer.api import Api
from meshreel.app.viewer.page import Page, base64_of, built_page
from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.framing import framing_of
from meshreel.rendering.picture import side_by_side
from meshreel.rendering.scenes import ChosenFrames, Scene
from meshreel.rendering.shots import spread_frames
from meshreel.rendering.views import View, guess_up

MOST_PLAYED, MOST_ENCODED = 2_500_000, 300_000
"""Positions in all frames of a file, and of a sequence, which is encoded first, that are played
where nobody has asked: so many take a second or two."""

MOST_HTML_BYTES = 4_000_000
"""Of a player in a notebook, which keeps all its output."""

QUICK = 6
"""How hard the player is deflated: the hardest takes twice the time for a few percent."""

HEIGHT_PX = 440

POSES, MOST_FACES = 4, 400_000
"""So many poses are drawn; of a mesh of more faces only one."""

MOST_DRAWN_FACES = 4_000_000
"""A mesh of more is not drawn: it would take long."""

PICTURE_HEIGHT_PX, PICTURE_WIDTHS_PX = 280, (120, 420)


def html_of(shown: MeshSequence | ReelFile) -> str:
    """HTML of a sequence or a file: figures over its player, or over a picture of it.

    It plays where that is quick and small: `MOST_PLAYED`, `MOST_ENCODED`, `MOST_HTML_BYTES`.
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
        page = built_page()
        opened = (
            ReelFile(BytesIO(encode(shown)), memory=OWN_STREAM)
            if isinstance(shown, MeshSequence)
            else shown
        )
        with opened if encoded else nullcontext():
            api = Api(opened, shown.name, stream_rows)
            text = _page_text(api, page)
    except InvalidInputError:  # not built, or of a size that nobody can draw
        return None
    if len(text) > most_bytes:
        return None
    rows = rows_of(shown)
    if encoded:
        rows["shown"] = f"as encode() makes it by default, of {api.reel.size_bytes:,} bytes"
    frame = (
        f'<iframe srcdoc="{escape(text)}" sandbox="allow-scripts allow-downloads" '
        f'allow="fullscreen" style="width: 100%; height: {HEIGHT_PX}px; border: 0"></iframe>'
    )
    return heading_and_rows(shown.name, rows) + frame


def _page_text(api: Api, page: Page) -> str:
    stream = {"base64": base64_of(api.reel.stored(0, api.reel.size_bytes))}
    return page.whole({"facts": api.facts(), "stream": stream}, level=QUICK)


def _picture_and_figures(shown: MeshSequence | ReelFile) -> str:
    rows = rows_of(shown)
    picture = _picture_html(shown)
    if not picture:
        rows["picture"] = "none, for so many faces"
    rows["to play it"] = "show()"
    return heading_and_rows(shown.name, rows) + picture


def _picture_html(shown: MeshSequence | ReelFile) -> str:
    """HTML of a picture of some poses; empty for a mesh that takes too long to draw."""
    if shown.n_faces > MOST_DRAWN_FACES:
        return ""
    n_poses = POSES if shown.n_faces <= MOST_FACES else 1
    numbers = spread_frames(range(shown.n_frames), n_poses)
    frames = np.stack([shown.read(number, number + 1)[0] for number in numbers])
    poses = MeshSequence(frames, shown.faces, surface=shown.surface)
    picture = BytesIO()
    titles = [f"frame {number}" for number in numbers]
    side_by_side(_panels(poses), titles).save(picture, "PNG", optimize=True)
    data = b64encode(picture.getvalue()).decode()
    words = ", ".join(titles)
    return f'<img alt="{words}" style="max-width: 100%" src="data:image/png;base64,{data}">'


def _panels(poses: MeshSequence) -> list[np.ndarray]:
    scene = Scene(poses)
    frames = ChosenFrames(poses, range(poses.n_frames))
    framing = framing_of(View(guess_up(poses.extent)), frames)
    width = int(np.clip(PICTURE_HEIGHT_PX * framing.aspect(frames), *PICTURE_WIDTHS_PX))
    cameras = framing.cameras(frames, width, PICTURE_HEIGHT_PX)
    return [scene.draw(scene.read(number), camera)[0] for number, camera in enumerate(cameras)]
