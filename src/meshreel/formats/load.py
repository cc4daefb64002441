"""Loading of files as a `MeshSequence`, or opening with frames that are read on demand."""

import os
from dataclasses import replace
from pathlib import Path

from meshreel.codec.memory import DEFAULT_MEMORY, bytes_of
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.options import ReadOptions
from meshreel.formats.remote import local_copy
from meshreel.formats.segments import open_any
from meshreel.formats.sources import Source, find_files
from meshreel.model.sequence import FrameSource, MeshSequence, single_segment
from meshreel.model.surface_selection import ALL, Names
from meshreel.runtime.progress import Progress, silent

MAX_LOADED_BYTES = 1 << 30

LOADED_SHARE = 1 / 10
"""For encoding, positions up to this size are loaded, or up to this share of the memory limit."""


def load(
    source: Source,
    *,
    fps: float | None = None,
    object: str | None = None,
    merge: bool = False,
    topology: str | os.PathLike[str] | None = None,
    dataset: str | None = None,
    attributes: Names = ALL,
    skip_bad: bool = False,
    allow_outside: bool = False,
    animation: str | int | None = None,
    displace: str | None = None,
    resample: float | None = None,
    keep_deleted: bool = False,
    memory: float | str | None = None,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> MeshSequence:
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
        each.
    fps : float, optional
        Frames per second, overriding the file; frame files have none, which is 0. For a glTF file,
        or a USD file with keyed transforms or skins, the sampling rate of its motion.
    object : str, optional
        Path, or last part of the path, of one mesh of a file with several meshes.
    merge : bool, default False
        Merge all meshes of a file into one, whose parts are in ``surface.parts``.
    topology : path, optional
        A mesh file with the faces of a point cache (``.pc2 .mdd``).
    dataset : str, optional
        Name of the dataset with the positions, for files of named datasets.
    attributes : str or sequence of str, default "all"
        Attributes and groups to load: "all", "none", or names, as a list or as "uv,color"; a kind
        such as "uv" or "color" selects all of that kind. Polygons and parts are always loaded.
    skip_bad : bool, default False
        Leave out meshes of a file that cannot be read, and steps of a ``.pvd`` without faces; a
        note lists them.
    allow_outside : bool, default False
        Allow references to files outside the folder of a file: layers, buffers, frames.
    animation : str or int, optional
        Name, or number from 0, of one animation of a glTF file. Default: the first that moves a
        mesh; a note lists the others.
    displace : str, optional
        Name of a track of three numbers per vertex, such as the displacement of a simulation, that
        is added to the positions and not kept; ``"name:10"`` adds ten times its values.
    resample : float, optional
        Frames per second of new, evenly spaced frames, from the time of the first one on. Positions
        and values of floats are interpolated linearly; integers are those of the frame before.
    keep_deleted : bool, default False
        Keep elements that a simulation deletes in the mesh, with a track "alive" of cells or faces
        that is 1 while they exist. Default: the mesh changes when elements are deleted.
    memory : float or str, optional
        Memory limit for decoding a ``.reel``, as in `meshreel.decode`.
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
    mesh_path = None if topology is None else Path(topology)
    options = ReadOptions(
        fps, object, merge, mesh_path, dataset, None, progress,
        notes if notes is not None else [], attributes, skip_bad, allow_outside, animation, memory,
        displace=displace, resample=resample, keep_deleted=keep_deleted,
    )  # fmt: skip
    return load_any(source, options)


def load_any(source: Source, options: ReadOptions) -> MeshSequence:
    """Load a sequence with options that do not limit the loaded bytes."""
    with local_copy(source, options.notes) as files:
        return open_any(find_files(files), options)


def open_for_encoding(source: Source, memory: float | None, options: ReadOptions) -> MeshSequence:
    """Open a source for encoding; loads it if it is small compared to the memory limit.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As in `load`.
    memory : float or None
        Memory limit for encoding in bytes; None is the default of `meshreel.encode`.
    options : ReadOptions
        `max_loaded_bytes` is ignored.
    """
    return open_any(find_files(source), loading_for(memory, options))


def open_for_purpose(source: Source, options: ReadOptions, purpose: str) -> FrameSource:
    """Open a source as `open_for_encoding`, whose faces must not change.

    Raises
    ------
    ConnectivityChangeError
        If they do; the message names the purpose.
    """
    found = find_files(source)
    opened = open_any(found, loading_for(None, options))
    with errors_naming(found.paths[0]):
        return single_segment(opened, purpose)


def loading_for(memory: float | None, options: ReadOptions) -> ReadOptions:
    """Return the options with `max_loaded_bytes` for a memory limit of encoding."""
    max_bytes = MAX_LOADED_BYTES if memory is None else int(LOADED_SHARE * memory)
    if memory is not None:
        # A small memory limit for encoding must not prevent reading a `.reel`.
        options = replace(options, memory=max(memory, bytes_of(DEFAULT_MEMORY, "memory")))
    return replace(options, max_loaded_bytes=max_bytes)
