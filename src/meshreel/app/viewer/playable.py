"""The stream that the player plays: that of the file, or a re-encoded one."""

from io import BytesIO

import numpy as np

from meshreel.codec.encoder import encode
from meshreel.codec.memory import OWN_STREAM
from meshreel.codec.reel_file import ReelFile
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import track_like
from meshreel.runtime.progress import Progress, silent

METHOD = "reel"
"""The method that the player is made for: it loads frames in any order."""

EXACT_METHODS = ("lossless", "grid")
"""Methods without modes, which pages decode block by block and more slowly."""

MAX_EXACT_POSITIONS = 1_000_000
"""Limit of positions in all frames; longer streams of `EXACT_METHODS` load too slowly."""

MODES_EFFORT = 5
"""Effort at which `encode` never selects the method grid to meet an error bound."""

MAX_ERROR_PERCENT = 1e-3
"""Error bound of re-encoded streams."""


def playable(reel: ReelFile, progress: Progress = silent) -> ReelFile:
    """The file, if the player supports its method; otherwise re-encoded in memory.

    Raises
    ------
    CorruptStreamError
        If the stream must be re-encoded and is damaged.
    """
    is_short = reel.n_frames * reel.n_verts <= MAX_EXACT_POSITIONS
    if reel.method == METHOD or (reel.method in EXACT_METHODS and is_short):
        return reel
    # As float64, because float32 is too coarse for the bound far from the origin.
    positions = reel.read(0, reel.n_frames).astype(np.float64)
    tracks = {
        name: track_like(track, track.read(0, reel.n_frames)) for name, track in reel.tracks.items()
    }
    sequence = MeshSequence(
        positions, reel.faces, name=reel.name, surface=reel.surface, tracks=tracks
    ).replace(timing=reel.timing)
    data = encode(
        sequence,
        max_error=MAX_ERROR_PERCENT,
        effort=MODES_EFFORT,
        tracks=dict.fromkeys(tracks, "exact"),
        progress=progress,
    )
    return ReelFile(BytesIO(data), memory=OWN_STREAM)


def reencoding_text(method: str) -> str:
    """How and why the player re-encodes a stream of a method."""
    reason = "the method that the player is made for"
    if method in EXACT_METHODS:
        reason = f"which loads faster above {MAX_EXACT_POSITIONS:,} positions"
    error = f"this adds an error of at most {MAX_ERROR_PERCENT:g} % of the diagonal"
    return f"re-encoded as {METHOD}, {reason}; {error}"
