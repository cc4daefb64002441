"""A sheet that moves by its frame number, and videos that contain frame numbers."""

import subprocess

import numpy as np
import pytest

from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Kind, Surface

CELL = 16
BITS = 12
SIZE = 256
FPS = 30.0
STEP = 1 / 64
"""Motion of the sheet per frame; its width is 1."""


def moving_sheet(n_frames=90, *, has_uv=True):
    """Return a square in the plane z = 0 from (0, 0) to (1, 1), which moves to the right."""
    n = 5
    y, x = (index.ravel() / (n - 1) for index in np.indices((n, n)))
    still = np.stack([x, y, np.zeros_like(x)], axis=1)
    shift = np.arange(n_frames)[:, None, None] * np.array([STEP, 0, 0])
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    lower = np.stack([corner, corner + 1, corner + n], axis=1)
    upper = np.stack([corner + 1, corner + n + 1, corner + n], axis=1)
    uv = Attribute("st", Kind.UV, Domain.VERTEX, still[:, :2].astype(np.float32))
    return MeshSequence(
        (still + shift).astype(np.float32),
        np.concatenate([lower, upper]).astype(np.int32),
        FPS,
        "sheet",
        surface=Surface(attributes=(uv,) if has_uv else ()),
    )


def numbering():
    """Return an ffmpeg filter that draws the number of each frame as a row of cells, white for 1.

    The most significant bit comes first; a last cell makes the number of white cells odd.
    """
    bits = [rf"gt(bitand(n\,{2**bit})\,0)" for bit in reversed(range(BITS))]
    is_white = [*bits, rf"not(mod({'+'.join(bits)}\,2))"]
    boxes = [f"drawbox=x=0:y=0:w={(BITS + 1) * CELL}:h={CELL}:color=black:t=fill"]
    for i, when in enumerate(is_white):
        box = f"drawbox=x={i * CELL}:y=0:w={CELL}:h={CELL}:color=white:t=fill"
        boxes.append(f"{box}:enable='{when}'")
    return ",".join(boxes)


def numbered_video(path, n_frames=90, *, fps=FPS, has_sound=True):
    """Write a numbered film as .webm, or as .mp4 with the same codecs, which all Chromiums have."""
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs imageio-ffmpeg")
    seconds = n_frames / fps
    picture = f"gradients=s={SIZE}x{SIZE}:r={fps}:d={seconds}:c0=0xd06030:c1=0x3060d0:speed=0.01"
    sound = f"sine=frequency=440:duration={seconds}"
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", "-f", "lavfi", "-i", picture]
    if has_sound:
        command += ["-f", "lavfi", "-i", sound, "-c:a", "libopus"]
    codec = "libvpx" if path.suffix == ".webm" else "libvpx-vp9"
    command += ["-vf", numbering(), "-c:v", codec, "-b:v", "2M", "-g", "15"]
    command += ["-movflags", "+faststart"] if path.suffix == ".mp4" else []
    command += ["-deadline", "realtime", "-cpu-used", "8", "-threads", "1"]  # a fourth of the work
    command += ["-pix_fmt", "yuv420p", "-frames:v", str(n_frames), str(path)]
    subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
    return path.read_bytes()
