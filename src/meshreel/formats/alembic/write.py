"""Writing a sequence to an Alembic file, frame by frame."""

import math
import os
import shutil
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.alembic.library_arrays import library_array, library_vector
from meshreel.formats.alembic.names import IN_METADATA, IN_TEXTS, clean, object_paths, unique_name
from meshreel.formats.alembic.winding import reversed_corners
from meshreel.formats.alembic.write_attributes import (
    AttributeWriter,
    is_texture,
    mark_attributes,
    texture_sample,
)
from meshreel.formats.alembic.write_tracks import (
    TrackWriter,
    mark_computed,
    normal_sample,
    unwritable_tracks,
)
from meshreel.formats.frames.segmented_stream import SegmentedStream, SegmentMesh
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.notes import note_name
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import PartMesh, split_parts
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.sequence import Vertices
from meshreel.model.tracks import TrackKind, TrackSource
from meshreel.runtime.extras import ALEMBIC

ASSUMED_FPS = 24.0

SAMPLE_OVERHEAD_BYTES = 256
"""Bound on the overhead of a part in a frame, in addition to its positions; 124 bytes measured."""
PART_OVERHEAD_BYTES = 1 << 14
"""Bound on headers and names of a part; about 1.5 kB measured."""


class Rounding:
    """Rounds positions to float32 relative to a translation, and tracks the largest error.

    The translation is zero, unless float64 positions are so far from the origin that float32
    would move a vertex by more than a millionth of the model size: then it is the center of the
    first frame. Positions that are float32 stay exact.

    Parameters
    ----------
    first : float array of shape (V, 3)
        Positions of the first frame.

    Attributes
    ----------
    shift : float64 array of shape (3,)
        The translation, which the transform above the mesh must add.
    max_error : float
        Largest rounding error of a coordinate so far.
    """

    def __init__(self, first: Vertices) -> None:
        narrowing = Narrowing()
        narrowing.add(first)
        low, high = first.min(axis=0), first.max(axis=0)
        middle = (low / 2 + high / 2).astype(np.float64)  # halved first, to avoid overflow
        self.shift = np.zeros(3) if narrowing.is_harmless else middle
        self.max_error = 0.0

    def add(self, frame: Vertices) -> npt.NDArray[np.float32]:
        """Return the next frame rounded to float32, of shape (V, 3).

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
                f"Alembic stores positions as float32, up to {np.finfo(np.float32).max:.3g}; "
                f"got {np.abs(frame).max():.3g}; scale the model"
            )
        error = float(np.abs(frame - (rounded + self.shift)).max())
        self.max_error = max(self.max_error, error)
        return rounded

    def describe(self) -> str:
        """Return a sentence on the rounding error; empty if there was none."""
        if self.max_error == 0:
            return ""
        relative = ", relative to the center of the first frame" if self.shift.any() else ""
        return (
            f"Alembic stores positions as float32{relative}: "
            f"coordinates change by up to {self.max_error:.2g}"
        )


def write_alembic(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write an Alembic file (Ogawa) with one polygon mesh per part.

    Float32 positions, polygons and attributes are lossless; notes name everything else. If the
    faces change, faces, attributes and groups are sampled in every frame. One frame is in memory
    at a time.

    Raises
    ------
    FormatError
        If the library is not installed, or cannot write the file.
    InvalidInputError
        If the disk is too small, or a position does not fit into float32.
    """
    shared = SharedData.of(stream.meshes())
    shared.note_others(".abc", stream.notes)
    stream = stream.changed(shared.only)
    check_free_space(path, stream)
    try:
        rounding = _write_archive(path, stream, shared)
    except RuntimeError as error:  # from the Alembic library
        raise FormatError(
            f"the Alembic library cannot write {path.name}: {' '.join(str(error).split())}"
        ) from None
    stream.notes.extend([note] if (note := rounding.describe()) else [])


def _write_archive(path: Path, stream: SegmentedStream, shared: SharedData) -> Rounding:
    """Write a file, which is complete once the library's objects are destroyed."""
    archive = ALEMBIC.load("Abc").OArchive(str(path))
    sampling = archive.addTimeSampling(_time_sampling(stream))
    left_out = unwritable_tracks(stream, shared)
    rounding: Rounding | None = None
    writers: list[_PartWriter] = []
    for segment in stream.segments():
        tracks = {name: one for name, one in segment.tracks.items() if name not in left_out}
        parts = list(split_parts(segment.faces, segment.surface, segment.n_verts, stream.name))
        if rounding is None:
            rounding = Rounding(segment.first)
            transforms = _Transforms(archive.getTop(), rounding.shift)
            for one in parts:
                note_name("part", one.name, clean(one.name, IN_TEXTS), ".abc", stream.notes)
            places = object_paths([one.name for one in parts])
            changing = shared if stream.n_segments > 1 else None
            writers = [
                _PartWriter(
                    part,
                    transforms.above(place),
                    place[-1],
                    sampling,
                    tracks,
                    segment.notes,
                    changing,
                )
                for part, place in zip(parts, places, strict=True)
            ]
        for writer, part in zip(writers, parts, strict=True):
            writer.begin(part)
        for index, frame in enumerate(segment.frames()):
            rounded = rounding.add(frame)
            values = {name: one.read(index, index + 1)[0] for name, one in tracks.items()}
            for writer in writers:
                writer.add(rounded, values)
    assert rounding is not None  # there is at least one segment
    return rounding


def _time_sampling(stream: SegmentedStream) -> Any:
    core = ALEMBIC.load("AbcCoreAbstract")
    if stream.n_frames == 1 and not stream.fps:
        times = core.TimeVector()
        times.append(stream.start_s)
        return core.TimeSampling(core.TimeSamplingType(core.AcyclicFlag.kAcyclic), times)
    if not stream.fps:
        stream.notes.append(
            f"the frame rate is unknown; written as {ASSUMED_FPS:g} frames per second"
        )
    return core.TimeSampling(1 / (stream.fps or ASSUMED_FPS), stream.start_s)


class _Transforms:
    """The transforms of a file, created on demand.

    Parameters
    ----------
    top : OObject
    shift : float64 array of shape (3,)
        Translation of the transforms at the top.
    """

    def __init__(self, top: Any, shift: npt.NDArray[np.float64]) -> None:
        self._shift = shift
        self._created: dict[tuple[str, ...], Any] = {(): top}

    def above(self, place: tuple[str, ...]) -> Any:
        """Return the parent transform of an object, given the path of the object."""
        path = place[:-1]
        if path not in self._created:
            geometry = ALEMBIC.load("AbcGeom")
            transform, sample = geometry.OXform(self.above(path), path[-1]), geometry.XformSample()
            if len(path) == 1 and self._shift.any():
                sample.setTranslation(library_vector(self._shift))
            transform.getSchema().set(sample)
            self._created[path] = transform
        return self._created[path]


class _PartWriter:
    """Writes the mesh of a part.

    Parameters
    ----------
    part : PartMesh
        The part in the first segment.
    parent : OXform
    sampling : int
        Index of the time sampling of its positions.
    tracks : mapping of str to TrackSource
    notes : list of str
        Gains a sentence for everything that the file cannot store exactly.
    changing : SharedData, optional
        Data of all segments, if there are several: then faces and attributes are sampled.
    """

    def __init__(
        self,
        part: PartMesh,
        parent: Any,
        name: str,
        sampling: int,
        tracks: Mapping[str, TrackSource],
        notes: list[str],
        changing: SharedData | None,
    ) -> None:
        self._notes = notes
        self._names = set[str]()
        self._tracks = TrackWriter(part, tracks, sampling, self._names, notes)
        self._schema = ALEMBIC.load("AbcGeom").OPolyMesh(parent, name, sampling).getSchema()
        has_track = any(one.kind is TrackKind.NORMAL for one in tracks.values())
        has_hard_edges = part.surface.hard_edges is not None
        if changing is not None:
            has_hard_edges = changing.has_hard_edges
        self._has_normals = has_hard_edges and not has_track
        labels = changing.labels.get(("material",), ()) if changing is not None else ()
        attribute_sampling = None if changing is None else sampling
        self._attributes = AttributeWriter(
            self._schema, attribute_sampling, labels, self._names, notes
        )
        self._n_samples = 0

    def begin(self, part: PartMesh) -> None:
        """Begin a segment with the part in it."""
        self._part, self._is_new = part, True
        self._tracks.use(part)
        self._shading = None
        if self._has_normals:
            n_verts = part.verts.stop - part.verts.start
            hard_edges = part.surface.hard_edges
            self._shading = RowNormals(part.counts, part.corners, hard_edges, n_verts)

    def add(self, frame: npt.NDArray[np.float32], values: Mapping[str, Values]) -> None:
        """Write the next frame, from positions of shape (V, 3) and track values of all parts."""
        sample = ALEMBIC.load("AbcGeom").OPolyMeshSchemaSample()
        sample.setPositions(library_array("V3f", frame[self._part.verts]))
        self._tracks.add_standard(sample, values)
        if self._shading is not None:
            normals = self._shading.of_frames(frame[np.newaxis, self._part.verts])[0]
            of_corner = self._shading.rows.of_corner[reversed_corners(self._part.counts)]
            sample.setNormals(normal_sample(normals, of_corner))
        if self._is_new:
            self._write_faces(sample)
        else:  # the library repeats the faces
            self._schema.set(sample)
            self._attributes.repeat()
        self._tracks.add_others(self._schema, values)
        self._is_new = False
        self._n_samples += 1

    def _write_faces(self, sample: Any) -> None:
        """Write the first sample of a segment, with its faces and attributes."""
        counts, attributes = self._part.counts, self._part.surface.attributes
        corners = self._part.corners[reversed_corners(counts)]
        sample.setFaceCounts(library_array("Int32", counts))
        sample.setFaceIndices(library_array("Int32", corners))
        is_first = self._n_samples == 0
        texture = next((one for one in attributes if is_texture(one)), None)
        others = [one for one in attributes if one is not texture]
        if texture is not None:
            if is_first:
                name = unique_name(clean(texture.name, IN_METADATA), {one.name for one in others})
                note_name("attribute", texture.name, name, ".abc", self._notes)
                self._schema.setUVSourceName(name)
            sample.setUVs(texture_sample(texture, counts, self._notes))
        if is_first:
            self._tracks.begin(self._schema)
            if self._shading is not None:
                mark_computed(self._schema)
        self._schema.set(sample)
        self._attributes.write(others, self._part.surface.groups, counts)
        if is_first and self._attributes.is_sampled:
            names = [*self._attributes.names, *([] if texture is None else ["uv"])]
            mark_attributes(self._schema, names)


def check_free_space(path: Path, stream: SegmentedStream) -> None:
    """Check that the disk has enough space: the library aborts the process on a full disk.

    The space is allocated once and freed, so that quotas and file size limits count too.

    Raises
    ------
    InvalidInputError
        If there is less space than the file may need.
    """
    needed = sum(map(_max_file_bytes, stream.meshes()))
    try:
        if hasattr(os, "posix_fallocate"):
            with tempfile.TemporaryFile(dir=path.parent) as trial:
                os.posix_fallocate(trial.fileno(), 0, needed)
        is_free, reason = shutil.disk_usage(path.parent).free >= needed, "the disk is too full"
    except OSError as error:
        is_free, reason = False, str(error.strerror)
    if not is_free:
        raise InvalidInputError(
            f"{path.name} needs up to {needed} bytes as an Alembic file, but there is not enough "
            f"space ({reason}); write it to another disk"
        )


def _max_file_bytes(mesh: SegmentMesh) -> int:
    """Return an upper bound on the size of a segment in an Alembic file."""
    surface = mesh.surface
    n_parts = max(1, len(surface.parts))
    n_corners = 3 * len(mesh.faces)
    once = 4 * (n_corners + len(mesh.faces)) + 4 * surface.size_bytes
    n_numbers = sum(math.prod(one.shape[1:]) for one in mesh.tracks.values())
    n_sampled = len(surface.attributes) + sum(1 + len(one.labels) for one in surface.groups)
    n_arrays = n_parts * (1 + len(mesh.tracks) + n_sampled)
    if surface.hard_edges is not None:
        n_numbers += 3 * n_corners
    per_frame = 12 * mesh.n_verts + 8 * n_numbers + SAMPLE_OVERHEAD_BYTES * n_arrays
    return int(once + per_frame * mesh.n_frames + PART_OVERHEAD_BYTES * n_arrays)
