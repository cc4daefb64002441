"""Decoding of a stream to a mesh sequence."""

from itertools import pairwise
from threading import RLock

import numpy as np

from meshreel.bitstream.reader import read_stream
from meshreel.codec.memory import memory_limit
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.reel_track import tracks_of_stream
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.frame_choice import frame_range, start_of
from meshreel.runtime.progress import Count, Progress, silent
from meshreel.sequence import MeshSequence
from meshreel.tracks import Track, copied


def decode(
    data: bytes,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
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
    memory : float or str, optional
        The most that frames and tracks together, the mesh, or a block may take while they are
        decoded, as in "2GiB", or bytes. Default: 8 GiB.
    progress : callable, optional
        Called with the stage and the share done, 0..1.

    Raises
    ------
    InvalidInputError
        If `frames` names no frame or has a step, or `n_modes` is below 1 or not for this stream.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the bytes are not a whole stream that this build reads.
    MemoryLimitError
        If more memory would be needed; nothing was allocated for it.
    """
    limit = memory_limit(memory)
    progress("decoding connectivity", 0.0)
    stream = read_stream(bytes(data))
    header = stream.header
    wanted = frame_range(frames, stream.n_frames)
    opened = OpenStream(stream, limit)
    opened.require_mesh()
    opened.require_frames(wanted)
    tracks_of = tracks_of_stream(opened, RLock())
    opened.require_frames(wanted, sum(one.frame_bytes for one in tracks_of.values()) * len(wanted))
    blocks = opened.blocks(n_modes)
    vertices = np.empty((len(wanted), header.n_verts, 3), opened.dtype)
    for number, (start, stop) in enumerate(pairwise(stream.starts)):
        first, last = max(start, wanted.start), min(stop, wanted.stop)
        if first < last:
            before = first - wanted.start

            def report(done: int, before: int = before) -> None:
                progress("decoding", Count(before + done, len(wanted), "frames"))

            found = vertices[before : last - wanted.start]
            blocks.block(number).fill(found, first - start, report)
            if n_modes is None and last - first == stop - start:
                opened.keep_positions(number, found)
    progress("decoding", Count(len(wanted), len(wanted), "frames"))
    tracks: dict[str, Track] = {}
    for name, track in tracks_of.items():
        progress("decoding tracks", Count(len(tracks), len(opened.tracks), "tracks"))
        tracks[name] = copied(track, wanted)
    try:
        return MeshSequence(
            vertices,
            opened.faces,
            header.fps,
            header.name,
            start_of(wanted, opened.start_s, header.fps),
            opened.surface,
            tracks,
        )
    except InvalidInputError as error:
        raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from error
