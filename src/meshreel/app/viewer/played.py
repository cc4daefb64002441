"""The stream that a page plays: the file itself, or one that `reel` makes of it."""

from io import BytesIO

import numpy as np

from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from meshreel.runtime.progress import Progress, silent

METHOD = "reel"
"""The method that the player is made for: its modes can be left out, and come at once."""

EXACT_METHODS = ("lossless", "grid")
"""Methods without modes that pages decode as well, block by block, which takes longer."""

MOST_EXACT_POSITIONS = 1_000_000
"""Of all frames: longer streams of `EXACT_METHODS` keep whoever opens the page waiting."""

MODES_EFFORT = 5
"""Asked for, so that a largest error never chooses a grid."""

OFF_BY_PERCENT = 1e-3
"""What a stream is encoded anew to: the largest displacement of a vertex."""


def played(reel: ReelFile, progress: Progress = silent) -> ReelFile:
    """A file that the player plays well: the same one, or another whose stream is in memory.

    Parameters
    ----------
    progress : callable, optional

    Raises
    ------
    CorruptStreamError
        If the stream has to be encoded anew and is damaged.
    """
    is_short = reel.n_frames * reel.n_verts <= MOST_EXACT_POSITIONS
    if reel.method == METHOD or (reel.method in EXACT_METHODS and is_short):
        return reel
    # As float64, for the bound cannot be promised where float32 is coarse, far away.
    positions = reel[:].astype(np.float64)
    tracks = {
        name: Track(track.read(0, reel.n_frames), track.domain, track.kind, track.unit)
        for name, track in reel.tracks.items()
    }
    sequence = MeshSequence(
        positions, reel.faces, fps=reel.fps, name=reel.name, start_s=reel.start_s,
        surface=reel.surface, tracks=tracks,
    )  # fmt: skip
    data = encode(
        sequence,
        max_error=OFF_BY_PERCENT,
        effort=MODES_EFFORT,
        tracks=dict.fromkeys(tracks, "exact"),
        progress=progress,
    )
    return ReelFile(BytesIO(data), memory=OWN_STREAM)


def encoded_anew(method: str) -> str:
    """What the page plays instead of a stream of a method, in words."""
    why = "the method that the player is made for"
    if method in EXACT_METHODS:
        why = f"which opens sooner where there are more than {MOST_EXACT_POSITIONS:,} positions"
    off = f"off by up to {OFF_BY_PERCENT:g} % of the diagonal more"
    return f"encoded anew as {METHOD}, {why}: {off}"
