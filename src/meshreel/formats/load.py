"""Loading of files as a `MeshSequence`, or opening with frames that are read on demand."""

import os
from dataclasses import fields, replace
from io import IOBase
from pathlib import Path
from typing import Any

from meshreel.codec.memory import DEFAULT_MEMORY, bytes_of
from meshreel.codec.option import takes_fields
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.options import LoadOptions, Reading
from meshreel.formats.remote import local_copy
from meshreel.formats.segments import open_any
from meshreel.formats.sources import Source, find_files
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence

MAX_LOADED_BYTES = 1 << 30

OF_ANY = {"memory", "progress", "notes"}
"""Options of sources that are not paths."""

LOADED_SHARE = 1 / 10
"""For encoding, positions up to this size are loaded, or up to this share of the memory limit."""


@takes_fields(LoadOptions)
def load(source: Source, options: LoadOptions) -> MeshSequence:
    """Load the sequence of a file, a folder, a pattern or a list of frame files.

    If the faces change, each range of frames with the same faces is a segment of the sequence.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        Local files, or addresses such as ``s3://bucket/walk.abc`` (extra ``[s3]``), which are
        downloaded. A file with a whole animation, such as ``.npz .reel .abc .usd .glb``
        (`meshreel formats` lists all); one static mesh (``.obj .ply .off .stl``), which gives one
        frame; a folder of frames with one file extension; a pattern such as ``dir/*.obj``; or a
        list of frame files. Folders and patterns are read in natural order (frame_2 before
        frame_10). Several files with a whole animation, such as ``dir/*.glb``, must have one frame
        each. Also the bytes or an open binary file of a `.reel` stream, or a `ReelFile`.
    options
        The fields of `LoadOptions`.
    progress : Progress, default silent
        Called with the share of frames read.
    notes : list of str, optional
        Receives a sentence for the user for each thing that reading changes or leaves out, such as
        welded corners of an STL file.

    Returns
    -------
    MeshSequence
        Vertices in file order and in the number type of the file. Decimal text (OBJ, OFF, ASCII
        STL) gives float32 unless that would move a vertex by more than a millionth of the model's
        size, as it can far from the origin. The name is that of the mesh in the file, else of the
        file or, for several files, of their folder.

    Raises
    ------
    InvalidInputError
        If the source does not exist, a position is not finite, the file has several meshes and none
        is selected, or a selected attribute or animation does not exist.
    FormatError
        If the format of a file is unknown, does not match its extension, or needs a library that
        is not installed.
    StoreError
        If a remote file does not exist or cannot be reached.
    """
    if not is_path(source):
        for option in fields(options):
            if option.name not in OF_ANY and getattr(options, option.name) != option.default:
                raise InvalidInputError(
                    Keyword(option.name), " has no effect on a source that is not a path; omit it"
                )
        return sequence_of(source, options.memory)
    topology = None if options.topology is None else Path(options.topology)
    notes = Notes()
    values = vars(options) | {"topology": topology, "notes": notes}
    sequence = load_any(source, Reading(**values))
    if options.notes is not None:
        options.notes.extend(notes)
    return sequence


def is_path(source: Any) -> bool:
    """Return whether a source is a path or a list of paths."""
    paths = source if isinstance(source, list | tuple) else [source]
    return all(isinstance(path, str | os.PathLike) for path in paths)


def sequence_of(source: Any, memory: float | str | None = None) -> MeshSequence:
    """Return the sequence of an input that is not a path.

    Parameters
    ----------
    source : MeshSequence, FrameSource, ReelFile, or bytes or binary file of a `.reel` stream
    memory : float or str, optional
        Memory limit for decoding bytes, as in `meshreel.decode`.

    Raises
    ------
    InvalidInputError
        If it is something else.
    """
    # Reading other files does not need the decoder.
    from meshreel.codec.decoder import decode
    from meshreel.codec.reel_file import ReelFile

    if isinstance(source, MeshSequence):
        return source
    if isinstance(source, ReelFile):
        return source[:]
    if isinstance(source, IOBase):
        source = source.read()
    if isinstance(source, bytes | bytearray | memoryview):
        return decode(bytes(source), memory=memory)
    if all(hasattr(source, name) for name in ("faces", "extent", "read")):
        return MeshSequence.of_segments([source])
    raise InvalidInputError(
        "a sequence is a MeshSequence, the path of a file or folder, a list of paths, or the bytes "
        f"of a .reel stream; got {type(source).__name__}; for arrays, pass "
        "meshreel.MeshSequence(vertices, faces)"
    )


def load_any(source: Source, reading: Reading) -> MeshSequence:
    """Load a sequence with options that do not limit the loaded bytes."""
    with local_copy(source, reading.notes, reading.memory) as files:
        return open_any(find_files(files), reading)


def open_for_encoding(source: Source, memory: float | None, reading: Reading) -> MeshSequence:
    """Open a source for encoding; loads it if it is small compared to the memory limit.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As in `load`.
    memory : float or None
        Memory limit for encoding in bytes; None is the default of `meshreel.encode`.
    reading : Reading
        `max_loaded_bytes` is ignored.
    """
    return open_any(find_files(source), loading_for(memory, reading))


def loading_for(memory: float | None, reading: Reading) -> Reading:
    """Return the options with `max_loaded_bytes` for a memory limit of encoding."""
    max_bytes = MAX_LOADED_BYTES if memory is None else int(LOADED_SHARE * memory)
    if memory is not None:
        # A small memory limit for encoding must not prevent reading a `.reel`.
        reading = replace(reading, memory=max(memory, bytes_of(DEFAULT_MEMORY, "memory")))
    return replace(reading, max_loaded_bytes=max_bytes)
