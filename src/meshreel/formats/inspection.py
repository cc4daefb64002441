"""Inspection of files of any format without loading a sequence."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from meshreel.errors import MeshReelError, Message
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.kinds import AnimationInfo, SequenceFormat
from meshreel.formats.options import Reading
from meshreel.formats.remote import local_copy
from meshreel.formats.scenes.scene_source import open_mesh, selected_meshes
from meshreel.formats.segments import open_any
from meshreel.formats.sources import Source, SourceFiles, find_files
from meshreel.formats.supported_options import check_read_options
from meshreel.model.notes import Note, NoteKind
from meshreel.model.sequence import FrameSource, MeshSequence, positions_size_bytes
from meshreel.model.surface_description import SURFACE_TEXTS, describe_surface
from meshreel.model.timing import duration_s
from meshreel.model.tracks import describe_track, size_bytes
from meshreel.runtime.progress import Progress


@dataclass(frozen=True)
class MeshInfo:
    """One animated mesh of a file."""

    name: str
    """Its path in the file; for frame files, the name of their folder."""
    n_frames: int
    n_verts: int
    n_faces: int
    """Faces are triangles, after triangulation."""
    n_polygons: int
    """Faces in the file."""
    fps: float
    """0 = unknown."""
    start_s: float
    vertex_type: str
    """"float32" or "float64"."""
    low: tuple[float, ...] | None = None
    high: tuple[float, ...] | None = None
    """Corners of the bounding box of all frames, in model units; None if it has a problem."""
    cells: tuple[str, ...] = ()
    """As in `meshreel.codec.inspect.StreamInfo`."""
    attributes: tuple[str, ...] = ()
    """Attributes and groups, such as "uv 'st' of corners"."""
    parts: tuple[str, ...] = ()
    """Names of the merged meshes."""
    materials: tuple[str, ...] = ()
    images: tuple[str, ...] = ()
    """As in `meshreel.codec.inspect.StreamInfo`."""
    tracks: tuple[str, ...] = ()
    """Tracks, such as "heat: scalar of each vertex, float32 in K"."""
    problem: str | None = None
    """Why it cannot be encoded; None if it can."""
    n_segments: int = 1
    """Ranges of frames with the same faces; counts of vertices and faces are the largest of them.
    """
    n_meshes: int = 1
    """Distinct meshes among the segments."""
    raw_size_bytes: int = 0
    """Uncompressed bytes of the positions and tracks of all frames, and of the triangles and
    surfaces of all segments; streams count the same.
    """
    times: tuple[float, ...] | None = None
    """Time of each frame in seconds, if they are not evenly spaced."""

    @property
    def duration_s(self) -> float | None:
        """Duration in seconds, as `meshreel.model.timing.duration_s`."""
        return duration_s(self.n_frames, self.fps, self.times)

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types, for JSON."""
        return {**asdict(self), "duration_s": self.duration_s}


@dataclass(frozen=True)
class SourceInfo:
    """A file, or a set of frame files."""

    format: str
    size_bytes: int
    """Of all its files."""
    n_files: int
    meshes: tuple[MeshInfo, ...]
    """At least one."""
    notes: tuple[Note, ...]
    """What reading changes or leaves out."""
    animations: tuple[AnimationInfo, ...] = ()
    """All animations of the file, if its format supports several."""

    @property
    def left_out(self) -> tuple[str, ...]:
        """Contents of the file that no output would have."""
        return tuple(note.contents for note in self.notes if note.kind is NoteKind.LEFT_OUT)

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types, for JSON."""
        meshes = [mesh.as_dict() for mesh in self.meshes]
        return {
            "format": self.format, "size_bytes": self.size_bytes, "n_files": self.n_files,
            "meshes": meshes, "animations": [asdict(animation) for animation in self.animations],
            "left_out": list(self.left_out), "notes": list(self.notes),
        }  # fmt: skip


def inspect_source(source: Source, reading: Reading) -> SourceInfo:
    """Return the contents of a file, a folder of frames or a list of them; reads every frame once.

    All meshes of a file are described, unless the options select or merge them.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As in `meshreel.load`.

    Raises
    ------
    InvalidInputError, FormatError
        As `meshreel.load`, but an unreadable mesh among several only has a `problem`.
    """
    with local_copy(source, reading.notes, reading.memory) as files:
        source_files = find_files(files)
        check_read_options(source_files.format, reading)
        meshes = tuple(_mesh_infos(source_files, reading))
        return SourceInfo(
            source_files.format.title,
            sum(path.stat().st_size for path in (*source_files.paths, *source_files.other_files)),
            len(source_files.paths) + len(source_files.other_files),
            meshes,
            tuple(dict.fromkeys(reading.notes)),
            animations_of(source_files, reading),
        )


def animations_of(files: SourceFiles, reading: Reading) -> tuple[AnimationInfo, ...]:
    """Return the animations of a file; empty if its format supports only one.

    Raises
    ------
    FormatError
        If the file is damaged outside its animations.
    """
    if not isinstance(files.format, SequenceFormat) or files.format.list_animations is None:
        return ()
    with errors_naming(files.paths[0]):
        return tuple(files.format.list_animations(files.paths[0], reading))


def _mesh_infos(files: SourceFiles, reading: Reading) -> Iterator[MeshInfo]:
    path, entry = files.paths[0], files.format
    if not isinstance(entry, SequenceFormat) or entry.read_meshes is None or len(files.paths) > 1:
        yield _sequence_info(open_any(files, replace(reading, max_loaded_bytes=0)))
        return
    with errors_naming(path):
        meshes = selected_meshes(entry.read_meshes, path, reading)
    for number, mesh in enumerate(meshes):
        progress = _with_mesh_number(reading.progress, number, len(meshes))
        mesh_options = replace(reading, progress=progress, max_loaded_bytes=0)
        try:
            runs = list(open_mesh(mesh, path, mesh_options))
        except MeshReelError as error:
            if len(meshes) == 1:
                raise
            n_frames = len(mesh.times_s)
            start_s = float(mesh.times_s[0]) if n_frames else 0.0
            info = MeshInfo(mesh.name, n_frames, 0, 0, 0, mesh.fps or 0.0, start_s, "float32")
            yield replace(info, problem=str(Message(*error.args)))
        else:
            sequence = MeshSequence.of_segments(runs)
            yield replace(_sequence_info(sequence), name=mesh.name)


def _sequence_info(sequence: MeshSequence) -> MeshInfo:
    """Describe a sequence; counts of vertices and faces are the largest of its segments."""
    infos, extent = list(map(_segment_info, sequence.segments)), sequence.extent
    contents: dict[str, Any] = {
        name: tuple(dict.fromkeys(text for info in infos for text in getattr(info, name)))
        for name in (*SURFACE_TEXTS, "tracks")
    }
    largest = {
        name: max(getattr(info, name) for info in infos)
        for name in ("n_verts", "n_faces", "n_polygons")
    }
    return replace(
        infos[0],
        name=sequence.name,
        fps=sequence.fps,
        times=sequence.timing.uneven_times,
        n_frames=sequence.n_frames,
        n_segments=sequence.n_segments,
        n_meshes=sequence.n_meshes,
        raw_size_bytes=sum(info.raw_size_bytes for info in infos),
        low=tuple(extent.low.tolist()),
        high=tuple(extent.high.tolist()),
        **largest,
        **contents,
    )


def _segment_info(segment: FrameSource) -> MeshInfo:
    """Describe a segment, except for properties of the whole sequence: bounding box and times."""
    n_faces = len(segment.faces)
    texts: dict[str, Any] = describe_surface(segment.surface)
    return MeshInfo(
        segment.name,
        segment.n_frames,
        segment.n_verts,
        n_faces,
        segment.surface.n_faces(n_faces),
        segment.timing.fps,
        segment.timing.start_s,
        str(np.dtype(segment.dtype)),
        **texts,
        tracks=tuple(f"{name}: {describe_track(track)}" for name, track in segment.tracks.items()),
        raw_size_bytes=(
            positions_size_bytes(segment)
            + segment.faces.nbytes
            + segment.surface.size_bytes
            + sum(map(size_bytes, segment.tracks.values()))
        ),
    )


def _with_mesh_number(progress: Progress, number: int, n_meshes: int) -> Progress:
    """Return a progress callback that adds the number of the mesh to the stage."""
    if n_meshes == 1:
        return progress
    return lambda stage, share: progress(f"{stage}, mesh {number + 1} of {n_meshes}", share)
