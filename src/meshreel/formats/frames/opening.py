"""Opening of the frames of mesh files as a sequence: loaded, or read on demand."""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from meshreel.formats.frames.mesh_files import MeshFiles
from meshreel.formats.frames.stored_frames import FrameSurvey, StoredFrames
from meshreel.formats.options import ReadOptions
from meshreel.formats.surfaces.welding import Weld, weld_corners
from meshreel.model.geometry.polygons import triangulate_fans
from meshreel.model.sequence import Faces, FrameSource, MeshSequence, Vertices
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import read_tracks
from meshreel.model.validation import validate_fps
from meshreel.runtime.progress import Progress


def open_mesh_files(
    files: MeshFiles, name: str, options: ReadOptions, *, start_s: float = 0.0
) -> FrameSource:
    """Open the sequence of frame files, loaded if it is small enough."""
    max_bytes = options.max_loaded_bytes
    loads = max_bytes is None or len(files) == 1 or len(files) * files.frame_bytes <= max_bytes
    read: Callable[..., FrameSource] = read_frames if loads else open_frames
    return read(
        files,
        fps=validate_fps(options.fps or 0.0),
        name=name,
        start_s=start_s,
        progress=options.progress,
        notes=options.notes,
    )


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
        faces, surface, frames = _survey_frames(files, survey, progress, notes)
    vertices = _stack(frames, len(files)).astype(survey.dtype, copy=False)
    tracks = read_tracks(files.tracks(notes))
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
        faces, surface, frames = _survey_frames(files, survey, progress, notes)
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


def _survey_frames(
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
