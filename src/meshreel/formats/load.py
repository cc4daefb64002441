"""Files of other programs to a `MeshSequence`."""

from meshreel.errors import InvalidInputError
from meshreel.formats.frames import read_frames
from meshreel.formats.registry import SequenceFormat
from meshreel.formats.sources import Source, find_files
from meshreel.progress import Progress, silent
from meshreel.sequence import MeshSequence


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
    files = find_files(source)
    if isinstance(files.format, SequenceFormat):
        sequence = files.format.read(files.paths[0], fps=fps)
        progress("reading", 1.0)
        return sequence
    changes = notes if notes is not None else []
    vertices, faces = read_frames(files.paths, files.format, progress=progress, notes=changes)
    try:
        return MeshSequence(vertices, faces, fps or 0.0, files.name)
    except InvalidInputError as error:
        origin = files.paths[0] if len(files.paths) == 1 else files.paths[0].parent
        raise InvalidInputError(f"{origin}: {error}") from None
