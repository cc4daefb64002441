"""The stream that a page plays: the file itself, or what `reel` makes of one of another method."""

from io import BytesIO

from meshreel.codec.encoder import encode
from meshreel.codec.reel_file import ReelFile
from meshreel.runtime.progress import Progress, silent
from meshreel.sequence import MeshSequence

METHOD = "reel"
"""The only method that pages decode."""

OFF_BY_PERCENT = 1e-3
"""What a stream of another method is encoded anew to: the largest displacement of a vertex."""


def played(reel: ReelFile, progress: Progress = silent) -> ReelFile:
    """A file that pages can play: the same one, or another whose stream is in memory.

    Parameters
    ----------
    reel : ReelFile
    progress : callable, optional

    Raises
    ------
    CorruptStreamError
        If the stream has to be encoded anew and is damaged.
    """
    if reel.method == METHOD:
        return reel
    sequence = MeshSequence(
        reel[:], reel.faces, fps=reel.fps, name=reel.name, start_s=reel.start_s,
        surface=reel.surface,
    )  # fmt: skip
    return ReelFile(BytesIO(encode(sequence, max_error=OFF_BY_PERCENT, progress=progress)))
