"""A row of poses as a small picture."""

from base64 import b64encode
from io import BytesIO

import numpy as np

from meshreel.codec.reel_file import ReelFile
from meshreel.rendering.framing import framing_of
from meshreel.rendering.picture import side_by_side
from meshreel.rendering.scenes import ChosenFrames, Scene
from meshreel.rendering.shots import spread_frames
from meshreel.rendering.views import View, guess_up
from meshreel.sequence import MeshSequence

POSES, MOST_FACES = 4, 400_000
"""So many poses are drawn; of a mesh of more faces only one."""

MOST_DRAWN_FACES = 4_000_000
"""A mesh of more is not drawn: it would take long."""

HEIGHT_PX, WIDTHS_PX = 280, (120, 420)


def picture_html(shown: MeshSequence | ReelFile) -> str:
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
    width = int(np.clip(HEIGHT_PX * framing.aspect(frames), *WIDTHS_PX))
    cameras = framing.cameras(frames, width, HEIGHT_PX)
    return [scene.draw(scene.read(number), camera)[0] for number, camera in enumerate(cameras)]
