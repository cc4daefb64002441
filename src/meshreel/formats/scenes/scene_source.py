"""Opening of one sequence from a file of several meshes: selected or merged, and checked."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.errors import ConnectivityChangeError, FormatError, InvalidInputError, MeshReelError
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.stored_frames import FrameSurvey, StoredFrames
from meshreel.formats.notes import listed, note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.merging import merge_meshes
from meshreel.formats.scenes.scene_mesh import ReadMeshes, SceneMesh
from meshreel.formats.scenes.timing import frame_times
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.geometry.polygons import triangulate_fans
from meshreel.model.sequence import FrameSource, MeshSequence, Vertices
from meshreel.model.tracks import read_tracks, size_bytes
from meshreel.model.validation import validate_finite
from meshreel.runtime.counting import counted
from meshreel.runtime.progress import Count, Progress

MAX_NAMED = 8

BLOCK_BYTES = 1 << 20
"""Size of the positions that are checked at once."""


def open_scene(read_meshes: ReadMeshes, path: Path, options: ReadOptions) -> FrameSource:
    """Open the selected or merged mesh of a file whose meshes `read_meshes` returns.

    Raises
    ------
    FormatError, InvalidInputError
        As `select_mesh` and `open_mesh`.
    """
    mesh = select_mesh(read_meshes, path, options, may_change=False)
    return open_mesh(mesh, path, options)


def select_mesh(
    read_meshes: ReadMeshes, path: Path, options: ReadOptions, *, may_change: bool = True
) -> SceneMesh:
    """Return the mesh that the options select, or all meshes merged.

    Parameters
    ----------
    may_change : bool, default True
        Whether `skip_bad` keeps meshes whose faces change.

    Raises
    ------
    FormatError
        As `read_meshes`.
    InvalidInputError
        If there are several meshes and none is selected, or none has the name; all are listed.
    """
    with errors_naming(path):
        meshes = selected_meshes(read_meshes, path, options, may_change=may_change)
        if len(meshes) > 1:
            raise InvalidInputError(
                f"holds {_listed(meshes)}; choose one with --object (object=), or merge all "
                "with --merge (merge=True)"
            )
        return meshes[0]


def selected_meshes(
    read_meshes: ReadMeshes, path: Path, options: ReadOptions, *, may_change: bool = True
) -> Sequence[SceneMesh]:
    """Return the mesh that the options name, all merged, or all separately by default.

    With `skip_bad`, unreadable meshes are left out; `may_change` says whether changing faces count.

    Raises
    ------
    FormatError
        As `read_meshes`.
    InvalidInputError
        If no mesh or several meshes have the name.
    """
    meshes = read_meshes(path, options)
    if options.object is not None:
        return [_named(meshes, options.object)]
    if options.skip_bad:
        meshes = readable_meshes(meshes, options, may_change=may_change)
    if options.merge and len(meshes) > 1:
        return [merge_meshes(meshes, path.stem, options.notes)]
    return meshes


def open_mesh(mesh: SceneMesh, path: Path, options: ReadOptions) -> FrameSource:
    """Open the frames of a mesh, loaded if they are small enough; all are read once now.

    Raises
    ------
    InvalidInputError
        If the faces of a frame differ from those of the first, or a position is not finite; the
        message names the frame.
    """
    blocks: list[Vertices] = []
    survey = FrameSurvey()
    n_frames = len(mesh.times_s)
    with errors_naming(path):
        first = mesh.frame(0)
        n_bytes = first.vertices.nbytes * n_frames
        is_loaded = options.max_loaded_bytes is None or n_bytes <= options.max_loaded_bytes
        for block in _checked_blocks(mesh, first, options.progress):
            survey.add(block)
            blocks += [block] if is_loaded else []
        timing = frame_times(mesh.times_s)
        if not timing.is_even:
            options.notes.append(
                f"frame times are uneven; read as {timing.fps:g} frames per second"
            )
        rate = options.fps or mesh.fps or timing.fps
        faces = triangulate_fans(first.counts, first.corners)
        surface = replace(mesh.surface(0), face_sizes=first.counts.astype(np.int32))
        name = mesh.name.rstrip("/").rpartition("/")[2]
        tracks = mesh.tracks(range(n_frames))
        n_bytes += sum(map(size_bytes, tracks.values()))
        if is_loaded and (options.max_loaded_bytes is None or n_bytes <= options.max_loaded_bytes):
            vertices = np.concatenate(blocks).astype(survey.dtype, copy=False)
            return MeshSequence(
                vertices, faces, rate, name, timing.start_s, surface, read_tracks(tracks)
            )
        return StoredFrames(
            n_frames=n_frames,
            n_verts=len(first.vertices),
            faces=faces,
            fps=rate,
            name=name,
            dtype=survey.dtype,
            extent=survey.extent,
            read_range=_reader(mesh, survey.dtype, first.vertices.shape),
            start_s=timing.start_s,
            surface=surface,
            files=(path,),
            tracks=tracks,
        )


def frame_range(mesh: SceneMesh, start: int, stop: int) -> SceneMesh:
    """Return a mesh of frames start..stop - 1."""
    return replace(
        mesh,
        times_s=mesh.times_s[start:stop],
        frame=lambda index: mesh.frame(start + index),
        surface=lambda index: mesh.surface(start + index),
        tracks=lambda frames: mesh.tracks(range(start + frames.start, start + frames.stop)),
        fps=mesh.fps or frame_times(mesh.times_s).fps,
    )


def _named(meshes: Sequence[SceneMesh], wanted: str) -> SceneMesh:
    matches = [mesh for mesh in meshes if mesh.name == wanted]
    matches = matches or [
        mesh for mesh in meshes if f"/{mesh.name.strip('/')}".endswith(f"/{wanted.strip('/')}")
    ]
    # The name of a parent node, such as a transform, selects the only mesh below it.
    matches = matches or [mesh for mesh in meshes if _is_below(mesh.name, wanted)]
    if len(matches) != 1:
        which = "no mesh" if not matches else f"{counted(len(matches), 'mesh')}"
        raise InvalidInputError(f"has {which} named {wanted!r}; it holds {_listed(meshes)}")
    return matches[0]


def _is_below(name: str, wanted: str) -> bool:
    """Whether a node above the mesh has this path, or a path that ends with it."""
    above, part = f"/{name.strip('/')}".rpartition("/")[0], wanted.strip("/")
    return not part or f"/{part}/" in f"{above}/"


def _listed(meshes: Sequence[SceneMesh], most: int = 20) -> str:
    names = [mesh.name for mesh in meshes]
    if len(names) == 1:
        return f"the mesh {names[0]}"
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{counted(len(names), 'mesh')}: {', '.join(names[:most])}{more}"


def _checked_blocks(mesh: SceneMesh, first: PolygonMesh, progress: Progress) -> Iterator[Vertices]:
    """Yield the positions of all frames in blocks of shape (T, V, 3).

    Raises
    ------
    ConnectivityChangeError, InvalidInputError
        If the faces of a frame differ from those of the first, or a position is not finite.
    """
    n_frames, n_each = len(mesh.times_s), 1 + BLOCK_BYTES // max(1, first.vertices.nbytes)
    for start in range(0, n_frames, n_each):
        frames: list[Any] = []
        difference = ""
        for index in range(start, min(start + n_each, n_frames)):
            frame = mesh.frame(index) if index else first
            if difference := frame.difference(first):
                break
            frames.append(frame.vertices)
        block: Vertices = np.stack(frames) if frames else first.vertices[np.newaxis]
        validate_finite(block, first_frame=start)
        if difference:
            raise ConnectivityChangeError(
                f"frame {index} of {mesh.name} has {difference} in frame 0"
            )
        yield block
        progress("reading", Count(start + len(frames), n_frames, "frames"))


def _reader(
    mesh: SceneMesh, dtype: np.dtype[np.floating], shape: tuple[int, ...]
) -> Callable[[int, int], Vertices]:
    def read_range(start: int, stop: int) -> Vertices:
        vertices: Vertices = np.empty((stop - start, *shape), dtype)
        for row, index in enumerate(range(start, stop)):
            vertices[row] = mesh.frame(index).vertices
        return vertices

    return read_range


def readable_meshes(
    meshes: Sequence[SceneMesh], options: ReadOptions, *, may_change: bool
) -> list[SceneMesh]:
    """Return the meshes whose frames can all be read; reads them all once now.

    Parameters
    ----------
    meshes : sequence of SceneMesh
    options : ReadOptions
        Its notes receive a sentence that lists the other meshes and their errors.
    may_change : bool
        Whether the faces of a mesh may change.

    Raises
    ------
    FormatError
        If no mesh can be read.
    """
    good, faults = [], []
    for number, mesh in enumerate(meshes):
        # Cache the surface, so that its notes are added only once.
        kept = replace(mesh, surface=cache(mesh.surface))
        if fault := _fault(kept, may_change=may_change):
            faults.append(f"{mesh.name} ({fault})")
        else:
            good.append(kept)
        options.progress("checking", Count(number + 1, len(meshes), "meshes"))
    if not good:
        raise FormatError(f"has no readable mesh: {listed(faults, MAX_NAMED)}")
    if faults:
        note_left_out(options.notes, f"meshes that cannot be read: {listed(faults, MAX_NAMED)}")
    return good


def _fault(mesh: SceneMesh, *, may_change: bool) -> str:
    """Describe why a mesh cannot be read; empty if it can."""
    try:
        first = mesh.frame(0)
        sizes = first.counts.astype(np.int32)
        surface = replace(mesh.surface(0), face_sizes=sizes)
        surface.validated(len(first.vertices), int((first.counts - 2).sum()))
        for index in range(len(mesh.times_s)):
            frame = mesh.frame(index) if index else first
            if not may_change and (difference := frame.difference(first)):
                return f"frame {index} has {difference} in frame 0"
            validate_finite(frame.vertices[np.newaxis], first_frame=index)
    except MeshReelError as error:
        return str(error)
    return ""
