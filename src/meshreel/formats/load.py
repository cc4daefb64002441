"""Files of other programs to a `MeshSequence`, or to frames that are read when asked for."""

import os
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.codec.memory import DEFAULT_MEMORY, bytes_of
from meshreel.formats.frames.mesh_files import MeshFiles
from meshreel.formats.frames.selection import select_attributes
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.frames.survey import FrameSurvey
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import ReadOptions
from meshreel.formats.remote import at_hand
from meshreel.formats.sources import Source, SourceFiles, find_files
from meshreel.formats.supported_options import check_read_options
from meshreel.formats.surfaces.welding import Weld, weld_corners
from meshreel.model.geometry.fans import triangulate_fans
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, Vertices, validate_fps
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.surface_selection import ALL, Names
from meshreel.model.tracks import copied_together
from meshreel.runtime.profiling import staged
from meshreel.runtime.progress import Progress, silent

MAX_LOADED_BYTES = 1 << 30

LOADED_SHARE = 1 / 10
"""Positions that are loaded to be encoded: up to so many bytes, or this share of the memory."""


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
    memory: float | str | None = None,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> MeshSequence:
    """The sequence that a file, a folder, a pattern or a list of frame files holds.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        Files of this machine, or addresses such as ``s3://bucket/walk.abc`` (extra ``[remote]``),
        which are downloaded. A file that holds a whole animation, such as ``.npz .reel .abc .usd
        .glb`` (`meshreel formats` lists them all); one static mesh (``.obj .ply .off .stl``),
        which gives one frame; a folder of frames of one ending; a pattern such as ``dir/*.obj``;
        or frame files in their order. Folders and patterns are read in natural order (frame_2
        before frame_10).
    fps : float, optional
        Frames per second, in place of what the file says; frame files say nothing, which is 0.
        Of a glTF file, or a USD file with keyed transforms or skins, how often its motion is
        sampled.
    object : str, optional
        Of a file that holds several meshes, the path of one, or the last part of it.
    merge : bool, default False
        Take all meshes of a file as one, whose parts are told apart by ``surface.parts``.
    topology : path, optional
        A mesh file with the faces of a point cache (``.pc2 .mdd``), which has none.
    dataset : str, optional
        Of a file of named datasets, the one that holds the positions.
    attributes : str or sequence of str, default "all"
        Which attributes and groups to take: "all", "none", or names, as a list or as "uv,color";
        a kind such as "uv" or "color" names all of it. Polygons and parts are always taken.
    skip_bad : bool, default False
        Leave out meshes of a file that cannot be read, and take the others; a note names them.
    allow_outside : bool, default False
        Read files that a file names outside of its folder: layers, buffers, frames.
    animation : str or int, optional
        Of a glTF file with several animations, the name of one, or its number from 0. Default: the
        first that moves a mesh; a note names the others.
    memory : float or str, optional
        Of a ``.reel``, the most that decoding it may take, as in `meshreel.decode`.
    progress : Progress, default silent
        Told the share of frames read.
    notes : list of str, optional
        Gains one sentence for each thing that was changed while reading, to be shown to a user:
        polygons cut into triangles, corners of an STL file welded.

    Returns
    -------
    MeshSequence
        Vertices in file order. The type of the file is kept; decimal text (OBJ, OFF,
        ASCII STL) gives float32 unless the model is so far from the origin that this would move
        a vertex by more than a millionth of the model's size. Its name is that of the mesh in
        the file if it has one, of the file or, for several files, of their folder.

    Raises
    ------
    InvalidInputError
        If nothing is there, frames differ in vertex count or faces, a position is not finite, the
        file holds several meshes and none is chosen, or an attribute or animation is asked for that
        it lacks.
    FormatError
        If a file is of an unknown kind, is not what its ending says, or needs a library that is
        not installed.
    StoreError
        If a remote file is not there or cannot be reached.
    """
    options = ReadOptions(
        fps, object, merge, _path(topology), dataset, None, progress,
        notes if notes is not None else [], attributes, skip_bad, allow_outside, animation, memory,
    )  # fmt: skip
    return load_with(source, options)


def load_with(source: Source, options: ReadOptions) -> MeshSequence:
    """The sequence that `load` gives, with options that limit no loaded bytes."""
    with at_hand(source, options.notes) as files:
        sequence = open_found(find_files(files), options)
    if not isinstance(sequence, MeshSequence):
        raise TypeError(f"a {type(sequence).__name__} was opened where all was to be loaded")
    return sequence


def open_for_inspection(found: SourceFiles, options: ReadOptions) -> FrameSource:
    """The sequence of files that were found; positions stay in them where they can."""
    return open_found(found, replace(options, max_loaded_bytes=0))


def open_for_encoding(source: Source, memory: float | None, options: ReadOptions) -> FrameSource:
    """`open_found`, loading what takes a small part of the memory that encoding may take.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As in `load`.
    memory : float or None
        Bytes that encoding may take; None is what `meshreel.encode` takes by default.
    options : ReadOptions
        But for how much is loaded.
    """
    return open_found(find_files(source), loading_for(memory, options))


def loading_for(memory: float | None, options: ReadOptions) -> ReadOptions:
    """The options, loading what takes a small part of the memory that encoding may take."""
    most = MAX_LOADED_BYTES if memory is None else int(LOADED_SHARE * memory)
    if memory is not None:
        # Less memory for encoding is no reason to refuse a `.reel` that is read.
        options = replace(options, memory=max(memory, bytes_of(DEFAULT_MEMORY, "memory")))
    return replace(options, max_loaded_bytes=most)


@staged("reading")
def open_found(found: SourceFiles, options: ReadOptions) -> FrameSource:
    """The sequence that `load` gives, but of frames that may stay in their files.

    Frame files, files of scenes and an ``.npz`` that is not compressed are read once now, a frame
    at a time, for what must be known of all frames; then frames are read whenever they are asked
    for. They must not change meanwhile. A compressed ``.npz``, a ``.reel`` and a single static
    mesh are loaded.

    Raises
    ------
    InvalidInputError, FormatError
        As `load`; reading frames later, InvalidInputError if a file has changed.
    """
    check_read_options(found.format, options)
    if isinstance(found.format, SequenceFormat):
        opened = found.format.open(found.paths[0], options)
    else:
        opened = open_mesh_files(MeshFiles(found.paths, found.format), found.name, options)
    return select_attributes(opened, options.attributes, found.paths[0])


def open_mesh_files(
    files: MeshFiles, name: str, options: ReadOptions, *, start_s: float = 0.0
) -> FrameSource:
    """The sequence whose frames are in files of their own, loaded if it is small enough."""
    most = options.max_loaded_bytes
    loads = most is None or len(files) == 1 or len(files) * files.frame_bytes <= most
    read: Callable[..., FrameSource] = read_frames if loads else open_frames
    return read(
        files,
        fps=validate_fps(options.fps or 0.0),
        name=name,
        start_s=start_s,
        progress=options.progress,
        notes=options.notes,
    )


def _path(given: str | os.PathLike[str] | None) -> Path | None:
    return None if given is None else Path(given)


def read_frames(
    files: MeshFiles,
    *,
    fps: float,
    name: str,
    start_s: float,
    progress: Progress,
    notes: list[str],
) -> MeshSequence:
    """Load the frames of all files.

    Needs memory for the result and one frame. Files without shared vertices are read twice: first
    to find the corners that coincide in every frame, then to keep one of each.

    Parameters
    ----------
    fps, name, start_s
        As in `MeshSequence`.
    progress : Progress
        Called after every frame.
    notes : list of str
        Receives a sentence for each thing that reading changes or leaves out.

    Raises
    ------
    FormatError, InvalidInputError
        As `MeshFiles.meshes`.
    """
    survey = FrameSurvey(is_decimal=files.format.is_decimal)
    if files.format.has_unshared_vertices:
        weld = _weld(files, survey, progress, notes)
        meshes = files.meshes(progress, "reading")
        frames: Iterator[Vertices] = (mesh.vertices[weld.representatives] for mesh in meshes)
        faces, surface = weld.faces, PLAIN
    else:
        faces, surface, frames = _surveyed(files, survey, progress, notes)
    vertices = _stack(frames, len(files)).astype(survey.dtype, copy=False)
    tracks = copied_together(files.tracks(notes))
    return MeshSequence(vertices, faces, fps, name, start_s, surface, tracks)


def open_frames(
    files: MeshFiles,
    *,
    fps: float,
    name: str,
    start_s: float,
    progress: Progress,
    notes: list[str],
) -> StoredFrames:
    """Return the frames of all files as a sequence that reads each frame on demand.

    Every file is read once now, to validate it and to find the extent; needs memory for one frame.

    Parameters
    ----------
    files, fps, name, start_s, progress, notes
        As in `read_frames`.

    Raises
    ------
    FormatError, InvalidInputError
        As `MeshFiles.meshes`; also when frames are read, if a file has changed.
    """
    survey = FrameSurvey(is_decimal=files.format.is_decimal)
    kept: slice | npt.NDArray[np.int64] = slice(None)
    if files.format.has_unshared_vertices:
        weld = _weld(files, survey, progress, notes)
        faces, kept, n_verts = weld.faces, weld.representatives, len(weld.representatives)
        surface = PLAIN
    else:
        faces, surface, frames = _surveyed(files, survey, progress, notes)
        n_verts = len(deque(frames, maxlen=1).pop())
    dtype = survey.dtype

    def read_range(start: int, stop: int) -> Vertices:
        vertices: Vertices = np.empty((stop - start, n_verts, 3), dtype)
        for row, index in enumerate(range(start, stop)):
            vertices[row] = files.mesh(index).vertices[kept]
        return vertices

    return StoredFrames(
        n_frames=len(files),
        n_verts=n_verts,
        faces=faces,
        fps=fps,
        name=name,
        dtype=dtype,
        extent=survey.extent,
        read_range=read_range,
        start_s=start_s,
        surface=surface,
        files=files.paths,
        tracks=files.tracks(notes),
    )


def _weld(files: MeshFiles, survey: FrameSurvey, progress: Progress, notes: list[str]) -> Weld:
    """Return the weld of all frames, and add the frames to the survey."""
    # Surveying corners is enough: every vertex is one of the corners.
    meshes = files.meshes(progress, "welding")
    weld = weld_corners(survey.watch(mesh.vertices for mesh in meshes))
    notes.append(weld.description)
    files.surface(notes)
    return weld


def _surveyed(
    files: MeshFiles, survey: FrameSurvey, progress: Progress, notes: list[str]
) -> tuple[Faces, Surface, Iterator[Vertices]]:
    """Return triangles, surface, and an iterator over positions that also feeds the survey."""
    meshes = files.meshes(progress, "reading")
    first = next(meshes)
    faces = triangulate_fans(first.counts, first.corners)
    surface = replace(files.surface(notes), face_sizes=first.counts.astype(np.int32))
    return faces, surface, survey.watch(mesh.vertices for mesh in chain([first], meshes))


def _stack(frames: Iterator[Vertices], n_frames: int) -> Vertices:
    """Stack the frames into one array of their widest float type."""
    first = next(frames)
    stack = np.empty((n_frames, *first.shape), dtype=first.dtype)
    for index, frame in enumerate(chain([first], frames)):
        if frame.dtype.itemsize > stack.dtype.itemsize:
            stack = stack.astype(frame.dtype)
        stack[index] = frame
    return stack
