"""Decoding of a stream to a mesh sequence."""

from itertools import pairwise

import numpy as np

from meshreel.codec.memory import memory_limit
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.reel_track import tracks_of_stream
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.model.frame_choice import frame_range, start_of
from meshreel.model.sequence import MeshSequence
from meshreel.model.tracks import Track
from meshreel.runtime.progress import Count, Progress, silent

FRAMES_AT_ONCE = 256
"""Frames that are decoded between two reports of progress."""


def decode(
    data: bytes,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
    segment: int | None = None,
    memory: float | str | None = None,
    progress: Progress = silent,
) -> MeshSequence:
    """The sequence of a `.reel` stream.

    Parameters
    ----------
    data : bytes
        A whole stream, from `encode` or a file.
    frames : slice, optional
        Frames to give back, as Python slices count them, without a step; only the blocks that
        hold some of them are decoded. Default: all.
    n_modes : int, optional
        Number of leading modes of each block to use: a coarser animation. Default: all. In streams
        of `reel` further modes, up to the 16th at least, are held at their mean over the block, and
        corrections are omitted. The paper's methods leave further rows of coefficients out (the
        paper's k_l). Streams of `lossless` and `grid` have no modes.
    segment : int, optional
        Number of a segment, from 0; needed if the stream has several.
    memory : float or str, optional
        The most that frames and tracks together, the mesh, or a block may take while they are
        decoded, as in "2GiB", or bytes. Default: 8 GiB.
    progress : callable, optional
        Called with the stage and the share done, 0..1.

    Raises
    ------
    InvalidInputError
        If `frames` names no frame or has a step, `n_modes` is below 1 or not for this stream, or
        the stream has no such segment, or several and none is chosen.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the bytes are not a whole stream that this build reads.
    MemoryLimitError
        If more memory would be needed; nothing was allocated for it.
    """
    limit = memory_limit(memory)
    progress("decoding connectivity", 0.0)
    opened = whole_stream(bytes(data), limit, segment)
    wanted = frame_range(frames, opened.n_frames)
    opened.require_mesh()
    reader = opened.frames(n_modes)
    tracks_of = tracks_of_stream(opened, reader)
    opened.require_frames(wanted, sum(one.frame_bytes for one in tracks_of.values()) * len(wanted))
    vertices = np.empty((len(wanted), opened.n_verts, 3), opened.dtype)
    values = {
        name: np.empty((len(wanted), *track.shape[1:]), track.dtype)
        for name, track in tracks_of.items()
    }
    for block, (start, stop) in enumerate(pairwise(opened.starts)):
        first, last = max(start, wanted.start), min(stop, wanted.stop)
        if first < last:
            reader.load(block)
        for begin in range(first, last, FRAMES_AT_ONCE):
            progress("decoding", Count(begin - wanted.start, len(wanted), "frames"))
            piece = slice(begin - wanted.start, min(begin + FRAMES_AT_ONCE, last) - wanted.start)
            reader.fill(vertices[piece], begin)
        for number, name in enumerate(values, start=1):  # while the block is held
            if first < last:
                reader.fill(values[name][first - wanted.start : last - wanted.start], first, number)
    reader.close()
    progress("decoding", Count(len(wanted), len(wanted), "frames"))
    try:
        return MeshSequence(
            vertices,
            opened.faces,
            opened.fps,
            opened.name,
            start_of(wanted, opened.start_s, opened.fps),
            opened.surface,
            {
                name: Track(values[name], track.domain, track.kind, track.unit)
                for name, track in tracks_of.items()
            },
        )
    except InvalidInputError as error:
        raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from error
