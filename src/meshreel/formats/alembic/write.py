"""A sequence into an Alembic file, frame by frame."""

import math
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.alembic.library_arrays import library_array, library_vector
from meshreel.formats.alembic.names import IN_METADATA, IN_TEXTS, clean, numbered
from meshreel.formats.alembic.object_paths import object_paths
from meshreel.formats.alembic.winding import turned_corners
from meshreel.formats.alembic.write_attributes import (
    is_texture,
    texture_sample,
    write_attributes,
    write_groups,
)
from meshreel.formats.alembic.write_tracks import (
    TrackWriter,
    held_tracks,
    mark_computed,
    normal_sample,
)
from meshreel.formats.extras import ALEMBIC
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.notes import note_name
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.sequence import Vertices
from meshreel.model.tracks import TrackKind, TrackSource, Values

ASSUMED_FPS = 24.0

BYTES_OF_SAMPLE = 256
"""Of a part in a frame, beside positions; 124 were found."""

BYTES_OF_PART = 1 << 14
"""Of headers and names; some 1.5 kB were found."""


class Rounding:
    """Positions beside a point, as float32, and how far that moved them.

    Float32 stays as it is. So does the place of float64, unless the model is so far from the
    origin that float32 would move a vertex by more than a millionth of its size: then the point
    is the middle of the first frame.

    Parameters
    ----------
    first : float array of shape (V, 3)
        Positions of the first frame.

    Attributes
    ----------
    shift : float64 array of shape (3,)
        The point; what is read must be put back by so much.
    largest : float
        How far a coordinate was moved at most, so far.
    """

    def __init__(self, first: Vertices) -> None:
        narrowing = Narrowing()
        narrowing.add(first)
        low, high = first.min(axis=0), first.max(axis=0)
        middle = (low / 2 + high / 2).astype(np.float64)  # halved, for a sum may be infinite
        self.shift = np.zeros(3) if narrowing.is_harmless else middle
        self.largest = 0.0

    def add(self, frame: Vertices) -> npt.NDArray[np.float32]:
        """The next frame, of shape (V, 3).

        Raises
        ------
        InvalidInputError
            If a position does not fit into float32.
        """
        if frame.dtype == np.float32:
            return frame.astype(np.float32, copy=False)
        with np.errstate(over="ignore"):
            rounded = (frame - self.shift).astype(np.float32)
        if not np.isfinite(rounded).all():
            raise InvalidInputError(
                f"positions in an Alembic file go up to {np.finfo(np.float32).max:.3g}; "
                f"got {np.abs(frame).max():.3g}; scale the model"
            )
        moved = float(np.abs(frame - (rounded + self.shift)).max())
        self.largest = max(self.largest, moved)
        return rounded

    def describe(self) -> str:
        """One sentence on what was moved; empty if nothing was."""
        if self.largest == 0:
            return ""
        beside = ", beside the middle of the first frame" if self.shift.any() else ""
        return (
            f"positions in an Alembic file are float32{beside}: "
            f"coordinates are off by up to {self.largest:.2g}"
        )


def write_alembic(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write an Alembic file (Ogawa) of a polygon mesh for each part.

    Float32 positions, polygons and attributes read back exactly as they are; what cannot is
    noted. Memory holds one frame.

    Raises
    ------
    FormatError
        If the library is not installed, or cannot write the file.
    InvalidInputError
        If the disk is too small, or a position does not fit into float32.
    """
    check_room(path, stream)
    rounding = Rounding(stream.first)
    try:
        _write_archive(path, stream, rounding)
    except RuntimeError as error:  # of the library
        raise FormatError(
            f"the Alembic library cannot write {path.name}: {' '.join(str(error).split())}"
        ) from None
    stream.notes.extend([note] if (note := rounding.describe()) else [])


def _write_archive(path: Path, stream: FrameStream, rounding: Rounding) -> None:
    """Write a file, which is complete once the library's objects are gone."""
    archive = ALEMBIC.load("Abc").OArchive(str(path))
    sampling = archive.addTimeSampling(_time_sampling(stream))
    parts = list(split_parts(stream.faces, stream.surface, stream.n_verts, stream.name))
    for one in parts:
        note_name("part", one.name, clean(one.name, IN_TEXTS), ".abc", stream.notes)
    transforms = _Transforms(archive.getTop(), rounding.shift)
    tracks = held_tracks(stream)
    writers = [
        _PartWriter(part, transforms.above(place), place[-1], sampling, tracks, stream.notes)
        for part, place in zip(parts, object_paths([one.name for one in parts]), strict=True)
    ]
    for index, frame in enumerate(stream.frames()):
        rounded = rounding.add(frame)
        values = {name: one.read(index, index + 1)[0] for name, one in tracks.items()}
        for writer in writers:
            writer.add(rounded, values)


def _time_sampling(stream: FrameStream) -> Any:
    core = ALEMBIC.load("AbcCoreAbstract")
    if stream.n_frames == 1 and not stream.fps:
        times = core.TimeVector()
        times.append(stream.start_s)
        return core.TimeSampling(core.TimeSamplingType(core.AcyclicFlag.kAcyclic), times)
    if not stream.fps:
        stream.notes.append(
            f"the frame rate is not known; written as {ASSUMED_FPS:g} frames per second"
        )
    return core.TimeSampling(1 / (stream.fps or ASSUMED_FPS), stream.start_s)


class _Transforms:
    """The transforms of a file, made when a part first lies below them.

    Parameters
    ----------
    top : OObject
    shift : float64 array of shape (3,)
        Where those at the top put what is below them.
    """

    def __init__(self, top: Any, shift: npt.NDArray[np.float64]) -> None:
        self._shift = shift
        self._made: dict[tuple[str, ...], Any] = {(): top}

    def above(self, place: tuple[str, ...]) -> Any:
        """The transform that an object lies in, by the path of the object."""
        path = place[:-1]
        if path not in self._made:
            geometry = ALEMBIC.load("AbcGeom")
            transform, sample = geometry.OXform(self.above(path), path[-1]), geometry.XformSample()
            if len(path) == 1 and self._shift.any():
                sample.setTranslation(library_vector(self._shift))
            transform.getSchema().set(sample)
            self._made[path] = transform
        return self._made[path]


class _PartWriter:
    """The mesh of a part.

    Parameters
    ----------
    part : PartMesh
    parent : OXform
    name : str
    sampling : int
        Number of the time sampling of its positions.
    tracks : mapping of str to TrackSource
    notes : list of str
        Gains a sentence for what the file cannot hold as it is.
    """

    def __init__(
        self,
        part: PartMesh,
        parent: Any,
        name: str,
        sampling: int,
        tracks: Mapping[str, TrackSource],
        notes: list[str],
    ) -> None:
        self._part, self._notes, self._has_faces = part, notes, False
        self._names = set[str]()
        self._tracks = TrackWriter(part, tracks, sampling, self._names, notes)
        self._schema = ALEMBIC.load("AbcGeom").OPolyMesh(parent, name, sampling).getSchema()
        self._shading = None
        has_track = any(one.kind is TrackKind.NORMAL for one in tracks.values())
        if part.surface.hard_edges is not None and not has_track:
            n_verts = part.verts.stop - part.verts.start
            hard_edges = part.surface.hard_edges
            self._shading = RowNormals(part.counts, part.corners, hard_edges, n_verts)

    def add(self, frame: npt.NDArray[np.float32], values: Mapping[str, Values]) -> None:
        """Write the next frame, given positions of shape (V, 3) and track values of the whole."""
        sample = ALEMBIC.load("AbcGeom").OPolyMeshSchemaSample()
        sample.setPositions(library_array("V3f", frame[self._part.verts]))
        self._tracks.add_to(sample, values)
        if self._shading is not None:
            normals = self._shading.of_frames(frame[np.newaxis, self._part.verts])[0]
            of_corner = self._shading.rows.of_corner[turned_corners(self._part.counts)]
            sample.setNormals(normal_sample(normals, of_corner))
        if self._has_faces:  # which repeat by themselves
            self._schema.set(sample)
        else:
            self._add_first(sample)
        self._tracks.add_others(self._schema, values)

    def _add_first(self, sample: Any) -> None:
        counts, attributes = self._part.counts, self._part.surface.attributes
        corners = self._part.corners[turned_corners(counts)]
        sample.setFaceCounts(library_array("Int32", counts))
        sample.setFaceIndices(library_array("Int32", corners))
        texture = next((one for one in attributes if is_texture(one)), None)
        if texture is not None:
            taken = {one.name for one in attributes} - {texture.name}
            name = numbered(clean(texture.name, IN_METADATA), taken)
            note_name("attribute", texture.name, name, ".abc", self._notes)
            self._schema.setUVSourceName(name)
            sample.setUVs(texture_sample(texture, counts, self._notes))
        self._tracks.begin(self._schema)
        if self._shading is not None:
            mark_computed(self._schema)
        self._schema.set(sample)
        others = [one for one in attributes if one is not texture]
        write_attributes(self._schema, others, counts, self._names, self._notes)
        write_groups(self._schema, self._part.surface.groups, self._names, self._notes)
        self._has_faces = True


def check_room(path: Path, stream: FrameStream) -> None:
    """Refuse a disk that is too small: when it is full, the library ends the process.

    The room is taken once and given back, so that quotas and limits on the size of files count.

    Raises
    ------
    InvalidInputError
        Naming the file, if there is less room than it may take.
    """
    needed = _most_bytes(stream)
    try:
        if hasattr(os, "posix_fallocate"):
            with tempfile.TemporaryFile(dir=path.parent) as trial:
                os.posix_fallocate(trial.fileno(), 0, needed)
        is_there, reason = shutil.disk_usage(path.parent).free >= needed, "the disk is too full"
    except OSError as error:
        is_there, reason = False, str(error.strerror)
    if not is_there:
        raise InvalidInputError(
            f"{path.name} takes up to {needed} bytes as an Alembic file, for which there is no "
            f"room ({reason}); write it to another disk"
        )


def _most_bytes(stream: FrameStream) -> int:
    """More than an Alembic file of the stream takes."""
    n_parts = max(1, len(stream.surface.parts))
    n_corners = 3 * len(stream.faces)
    once = 4 * (n_corners + len(stream.faces)) + 4 * stream.surface.size_bytes
    n_numbers = sum(math.prod(one.shape[1:]) for one in stream.tracks.values())
    n_arrays = n_parts * (1 + len(stream.tracks))
    if stream.surface.hard_edges is not None:
        n_numbers += 3 * n_corners
    each = 12 * stream.n_verts + 8 * n_numbers + BYTES_OF_SAMPLE * n_arrays
    return int(once + each * stream.n_frames + BYTES_OF_PART * n_arrays)
