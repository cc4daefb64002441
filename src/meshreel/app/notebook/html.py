"""HTML of a sequence or a file for notebooks: its figures, and the player or a picture."""

from base64 import b64encode
from collections.abc import Mapping
from contextlib import nullcontext
from html import escape
from io import BytesIO

import numpy as np

from meshreel.app.viewer.api import Api
from meshreel.app.viewer.page import Page, base64_of, built_page
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import StreamInfo
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.scenes import ChosenFrames, Scene
from meshreel.rendering.views import View, guess_up
from meshreel.runtime.extras import RENDER

MAX_PLAYED, MAX_ENCODED = 2_500_000, 300_000
"""Limits of positions in all frames of a file, or of a sequence, which must be encoded first, to
play it automatically: loading takes a second or two."""

MAX_HTML_BYTES = 4_000_000
"""Limit of an automatic player, because a notebook stores its output."""

DEFLATE_LEVEL = 6
"""Compression level of the player; level 9 doubles the time for a few percent."""

HEIGHT_PX = 440

N_POSES, MAX_FACES = 4, 400_000
"""Number of poses in the picture; a mesh with more faces has one pose."""

MAX_DRAWN_FACES = 4_000_000
"""Meshes with more faces are not drawn, because it takes too long."""

PICTURE_HEIGHT_PX, PICTURE_WIDTHS_PX = 280, (120, 420)

Rows = dict[str, str]


def html_of(animation: MeshSequence | ReelFile) -> str:
    """HTML of a sequence or a file: figures with a player, or with a picture.

    The player is used within `MAX_PLAYED`, `MAX_ENCODED` and `MAX_HTML_BYTES`.
    """
    max_positions = MAX_PLAYED if isinstance(animation, ReelFile) else MAX_ENCODED
    player = None
    n_positions = sum(segment.n_frames * segment.n_verts for segment in animation.segments)
    if n_positions <= max_positions:
        player = player_html(animation, MAX_HTML_BYTES)
    return player or _picture_and_figures(animation)


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
            api = Api(reel, animation.name, stream_rows)
            text = _page_text(api, page)
    except InvalidInputError:  # the page is not built, or the model too large or small to draw
        return None
    if len(text) > max_bytes:
        return None
    rows = rows_of(animation)
    if is_sequence:
        rows["shown"] = f"encoded with default options, {api.file.size_bytes:,} bytes"
    frame = (
        f'<iframe srcdoc="{escape(text)}" sandbox="allow-scripts allow-downloads" '
        f'allow="fullscreen" style="width: 100%; height: {HEIGHT_PX}px; border: 0"></iframe>'
    )
    return heading_and_rows(animation.name, rows) + frame


def _page_text(api: Api, page: Page) -> str:
    stream = {"base64": base64_of(api.file.stored(0, api.file.size_bytes))}
    return page.whole({"facts": api.facts(), "stream": stream}, level=DEFLATE_LEVEL)


def _picture_and_figures(animation: MeshSequence | ReelFile) -> str:
    rows, picture = rows_of(animation), ""
    if _most_faces(animation) > MAX_DRAWN_FACES:
        rows["picture"] = "omitted: too many faces"
    elif not RENDER.is_installed:
        rows["picture"] = f"needs {RENDER.library}: {RENDER.command}"
    else:
        picture = _picture_html(animation)
    rows["to play it"] = "show()"
    return heading_and_rows(animation.name, rows) + picture


def _picture_html(animation: MeshSequence | ReelFile) -> str:
    """HTML of a picture of some poses."""
    from meshreel.rendering.picture import side_by_side
    from meshreel.rendering.shots import spread_frames

    n_poses = N_POSES if _most_faces(animation) <= MAX_FACES else 1
    numbers = spread_frames(range(animation.n_frames), n_poses)
    poses = MeshSequence.of_segments(animation[number : number + 1] for number in numbers)
    picture = BytesIO()
    titles = [f"frame {number}" for number in numbers]
    side_by_side(_panels(poses), titles).save(picture, "PNG", optimize=True)
    data = b64encode(picture.getvalue()).decode()
    alt = ", ".join(titles)
    return f'<img alt="{alt}" style="max-width: 100%" src="data:image/png;base64,{data}">'


def _panels(poses: MeshSequence) -> list[np.ndarray]:
    from meshreel.rendering.shots import framing_of

    scene = Scene(poses)
    frames = ChosenFrames(poses, range(poses.n_frames))
    framing = framing_of(View(guess_up(poses.extent)), frames)
    width = int(np.clip(PICTURE_HEIGHT_PX * framing.aspect(frames), *PICTURE_WIDTHS_PX))
    cameras = framing.cameras(frames, width, PICTURE_HEIGHT_PX)
    return [scene.draw(scene.read(number), camera)[0] for number, camera in enumerate(cameras)]


def _most_faces(animation: MeshSequence | ReelFile) -> int:
    """Most triangles of a segment."""
    return max(len(segment.faces) for segment in animation.segments)


def sequence_rows(sequence: MeshSequence) -> Rows:
    """Figures of a sequence."""
    return {
        "frames": _frames(sequence.n_frames, sequence.fps),
        "vertices": f"{max(segment.n_verts for segment in sequence.segments):,}",
        "faces": f"{_most_faces(sequence):,}",
        "positions": f"{sequence.dtype}, {_size(sequence.raw_size_bytes)} with faces",
    }


def stream_rows(info: StreamInfo) -> Rows:
    """Figures of a stream."""
    raw = _size(info.raw_size_bytes)
    rows = {
        "frames": _frames(info.n_frames, info.fps),
        "vertices": f"{info.n_verts:,}",
        "faces": f"{info.n_faces:,}",
        "file": f"{_size(info.size_bytes)}, {info.ratio:.0f} x smaller than {raw}",
        "rate": f"{info.rate_bpvf:.3f} bits per vertex and frame",
    }
    if info.is_lossless:
        rows["error bound"] = "lossless: positions are equal bit for bit"
    elif info.error_bound_percent:
        rows["error bound"] = f"{info.error_bound_percent:g} % of the diagonal, at every vertex"
    if not info.is_whole:
        rows["end"] = "truncated; the figures describe the complete blocks"
    return rows


def rows_of(animation: MeshSequence | ReelFile) -> Rows:
    """Figures of a sequence or a file."""
    if isinstance(animation, ReelFile):
        return stream_rows(animation.info())
    return sequence_rows(animation)


def heading_and_rows(name: str, rows: Mapping[str, str]) -> str:
    """HTML of a name and a line of figures."""
    items = " · ".join(f"<b>{escape(row)}</b> {escape(text)}" for row, text in rows.items())
    heading = f"<b>{escape(name)}</b><br>" if name else ""
    return f'<div style="font: 13px/1.5 sans-serif; margin: 2px 0 6px">{heading}{items}</div>'


def _frames(n_frames: int, fps: float) -> str:
    return f"{n_frames:,} at {fps:g} fps" if fps else f"{n_frames:,}"


def _size(size_bytes: int) -> str:
    for unit, name in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if size_bytes >= unit:
            return f"{size_bytes / unit:.1f} {name}"
    return f"{size_bytes} bytes"
