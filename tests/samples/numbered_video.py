"""A sheet that moves by its frame number, and videos whose pictures show theirs."""

import subprocess

import numpy as np
import pytest

from meshreel.sequence import MeshSequence
from meshreel.surface import Attribute, Domain, Kind, Surface

CELL = 16
BITS = 10
CODE = {"x": 0, "y": 0, "cell": CELL, "bits": BITS}
SIZE = 256
FPS = 30.0
STEP = 1 / 64
"""The sheet is 1 wide, and moves this far to the right in a frame."""


def moving_sheet(n_frames=90, *, has_uv=True):
    """A square in the plane z = 0 from (0, 0) to (1, 1), which moves to the right."""
    n = 5
    y, x = (one.ravel() / (n - 1) for one in np.indices((n, n)))
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


def baking(cell=CELL, bits=BITS):
    """The filter of ffmpeg that puts numbers into pictures, as docs/guides/web.md has it."""
    box = "drawbox=x={x}:y=0:w={w}:h={h}:color={color}:t=fill"
    ones = [rf"gt(bitand(n\,{2**bit})\,0)" for bit in reversed(range(bits))]
    white = [*ones, f"not(mod({'+'.join(ones)}\\,2))"]
    cells = [
        box.format(x=i * cell, w=cell, h=cell, color="white") + f":enable='{when}'"
        for i, when in enumerate(white)
    ]
    return ",".join([box.format(x=0, w=(bits + 1) * cell, h=cell, color="black"), *cells])


def numbered_video(path, n_frames=90, *, fps=FPS, has_sound=True, covered=()):
    """Writes a WebM film of numbered pictures; `covered`: frames whose numbers are hidden."""
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs imageio-ffmpeg")
    seconds = n_frames / fps
    picture = f"gradients=s={SIZE}x{SIZE}:r={fps}:d={seconds}:c0=0xd06030:c1=0x3060d0:speed=0.01"
    filters = [baking()]
    if covered:
        frames = "+".join(rf"eq(n\,{frame})" for frame in covered)
        hidden = f"x=0:y=0:w={CELL}:h={CELL}:color=gray:t=fill"
        filters.append(f"drawbox={hidden}:enable='{frames}'")
    sound = f"sine=frequency=440:duration={seconds}"
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", "-f", "lavfi", "-i", picture]
    if has_sound:
        command += ["-f", "lavfi", "-i", sound, "-c:a", "libopus"]
    command += ["-vf", ",".join(filters), "-c:v", "libvpx", "-b:v", "2M", "-g", "15"]
    command += ["-pix_fmt", "yuv420p", "-frames:v", str(n_frames), str(path)]
    subprocess.run(command, check=True, capture_output=True, text=True, timeout=60)
    return path.read_bytes()
