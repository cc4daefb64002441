"""Frame files to a sequence: all frames at once, or each when it is asked for."""

from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

import numpy as np
import numpy.typing as npt

from meshreel.formats.frames.mesh_files import MeshFiles
from meshreel.formats.frames.stored_frames import StoredFrames
from meshreel.formats.frames.survey import FrameSurvey
from meshreel.formats.surfaces.welding import Weld, weld_corners
from meshreel.model.geometry.fans import triangulate_fans
from meshreel.model.sequence import Faces, MeshSequence, Vertices
from meshreel.model.surface import PLAIN, Surface
from meshreel.model.tracks import copied_together
from meshreel.runtime.progress import Progress


def read_frames(
    files: MeshFiles,
    *,
    fps: float,
    name: str,
    start_s: float,
    progress: Progress,
    notes: list[str],
) -> MeshSequence:
    """The frames of all files, in memory.

    Memory holds the result and one frame. Files without shared vertices are read twice: first to
    find the corners that coincide in every frame, then to keep one of each.

    Parameters
    ----------
    files : MeshFiles
    fps, name, start_s
        As in `MeshSequence`.
    progress : Progress
        Told of every frame read.
    notes : list of str
        Gains a sentence for everything that was changed on the way.

    Raises
    ------
    FormatError, InvalidInputError
        As `MeshFiles.meshes`.
    """
    survey = FrameSurvey(is_decimal=files.format.is_decimal)
    if files.format.has_corners_only:
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
    """The frames that `read_frames` gives, each read when it is asked for.

    Every file is read once now, for what must be known of all; memory holds one frame.

    Parameters
    ----------
    files, fps, name, start_s, progress, notes
        As in `read_frames`.

    Raises
    ------
    FormatError, InvalidInputError
        As `MeshFiles.meshes`; when frames are read too, if a file has changed meanwhile.
    """
    survey = FrameSurvey(is_decimal=files.format.is_decimal)
    kept: slice | npt.NDArray[np.int64] = slice(None)
    if files.format.has_corners_only:
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
    """The weld of all frames, which the survey has seen when it is made."""
    # Every corner is a vertex of the same position: the survey of corners is that of vertices.
    meshes = files.meshes(progress, "welding")
    weld = weld_corners(survey.watch(mesh.vertices for mesh in meshes))
    notes.append(weld.description)
    files.surface(notes)
    return weld


def _surveyed(
    files: MeshFiles, survey: FrameSurvey, progress: Progress, notes: list[str]
) -> tuple[Faces, Surface, Iterator[Vertices]]:
    """Triangles, surface, and positions of each frame, which the survey sees as they pass."""
    meshes = files.meshes(progress, "reading")
    first = next(meshes)
    faces = triangulate_fans(first.counts, first.corners)
    surface = replace(files.surface(notes), face_sizes=first.counts.astype(np.int32))
    return faces, surface, survey.watch(mesh.vertices for mesh in chain([first], meshes))


def _stack(frames: Iterator[Vertices], n_frames: int) -> Vertices:
    """The frames as one array, in the widest float type of them, filled as they come."""
    first = next(frames)
    stack = np.empty((n_frames, *first.shape), dtype=first.dtype)
    for index, frame in enumerate(chain([first], frames)):
        if frame.dtype.itemsize > stack.dtype.itemsize:
            stack = stack.astype(frame.dtype)
        stack[index] = frame
    return stack
