"""Files of other programs to a `MeshSequence`, or to frames that are read when asked for."""

from meshreel.formats.frames import open_frames, read_frames
from meshreel.formats.mesh_files import MeshFiles
from meshreel.formats.registry import SequenceFormat
from meshreel.formats.sources import Source, find_files
from meshreel.profiling import staged
from meshreel.progress import Progress, silent
from meshreel.sequence import FrameSource, MeshSequence, validate_fps

MAX_LOADED_BYTES = 1 << 30
LOADED_SHARE = 1 / 10
"""Positions that are loaded to be encoded: up to so many bytes, or this share of the memory."""


@staged("reading")
def load(
    source: Source,
    *,
    fps: float | None = None,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> MeshSequence:
    """The sequence that a file, a folder, a pattern or a list of frame files holds.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        An ``.npz`` or ``.reel`` file; one static mesh (``.obj .ply .off .stl``), which gives one
        frame; a folder of frames of one ending; a pattern such as ``dir/*.obj``; or frame files
        in their order. Folders and patterns are read in natural order (frame_2 before frame_10).
    fps : float, optional
        Frames per second, in place of what the file says; frame files say nothing, which is 0.
    progress : Progress, default silent
        Told the share of frames read.
    notes : list of str, optional
        Gains one sentence for each thing that was changed while reading, to be shown to a user:
        polygons cut into triangles, corners of an STL file welded.

    Returns
    -------
    MeshSequence
        Vertices in file order. PLY and npz keep the type of the file; decimal text (OBJ, OFF,
        ASCII STL) gives float32 unless the model is so far from the origin that this would move
        a vertex by more than a millionth of the model's size. Its name is that of the file or,
        for several files, of their folder.

    Raises
    ------
    InvalidInputError
        If nothing is there, frames differ in vertex count or faces, or a position is not finite.
    FormatError
        If a file is of an unknown kind, or is not what its ending says.
    """
    found = find_files(source)
    if isinstance(found.format, SequenceFormat):
        sequence = found.format.read(found.paths[0], fps=fps)
        progress("reading", 1.0)
        return sequence
    rate = validate_fps(fps or 0.0)
    changes = notes if notes is not None else []
    files = MeshFiles(found.paths, found.format)
    vertices, faces = read_frames(files, progress=progress, notes=changes)
    return MeshSequence(vertices, faces, rate, found.name)


@staged("reading")
def open_source(
    source: Source,
    *,
    fps: float | None = None,
    max_loaded_bytes: int = 0,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> FrameSource:
    """The sequence that `load` gives, but of frames that may stay in their files.

    Frame files and an ``.npz`` that is not compressed are read once now, a frame at a time, for
    what must be known of all frames; then frames are read whenever they are asked for. They must
    not change meanwhile. A compressed ``.npz``, a ``.reel`` and a single static mesh are loaded.

    Parameters
    ----------
    source, fps, progress, notes
        As in `load`.
    max_loaded_bytes : int, default 0
        What can be left in files is loaded all the same if its positions, in the type of the
        files, take at most so many bytes: that reads each file only once.

    Returns
    -------
    FrameSource
        `meshreel.sequence.positions_size_bytes` says what all its positions take in memory.

    Raises
    ------
    InvalidInputError, FormatError
        As `load`; reading frames later, InvalidInputError if a file has changed.
    """
    found = find_files(source)
    if isinstance(found.format, SequenceFormat):
        if found.format.open is None:
            return load(source, fps=fps, progress=progress)
        return found.format.open(
            found.paths[0], fps=fps, max_loaded_bytes=max_loaded_bytes, progress=progress
        )
    files = MeshFiles(found.paths, found.format)
    if len(files) == 1 or len(files) * files.mesh(0).vertices.nbytes <= max_loaded_bytes:
        return load(source, fps=fps, progress=progress, notes=notes)
    return open_frames(
        files,
        fps=validate_fps(fps or 0.0),
        name=found.name,
        progress=progress,
        notes=notes if notes is not None else [],
    )


def open_for_encoding(
    source: Source,
    memory: float | None,
    *,
    fps: float | None = None,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> FrameSource:
    """`open_source`, loading what takes a small part of the memory that encoding may take.

    Parameters
    ----------
    source, fps, progress, notes
        As in `load`.
    memory : float or None
        Bytes that encoding may take; None is what `meshreel.encode` takes by default.
    """
    max_loaded_bytes = MAX_LOADED_BYTES if memory is None else int(LOADED_SHARE * memory)
    return open_source(
        source, fps=fps, max_loaded_bytes=max_loaded_bytes, progress=progress, notes=notes
    )
