"""Files that hold a frame each, known to agree in their faces and to stay as they are."""

import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import errors_naming, os_errors_naming
from meshreel.formats.frames.field_tracks import NORMALS, Field, Fields, Key, field_tracks
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.formats.frames.stored_tracks import StoredTrack
from meshreel.formats.kinds import FrameFormat
from meshreel.formats.notes import NORMALS_FAR, NORMALS_LEFT_OUT, note_frozen
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.sequence import Vertices, validate_finite
from meshreel.model.surface import PLAIN, Domain, Surface
from meshreel.model.surface_selection import differing_names
from meshreel.runtime.progress import Count, Progress

COMPARED_BYTES, LEAST_COMPARED = 1 << 24, 3
"""Bytes of files, and least number of frames, in which attributes are compared."""


class MeshFiles:
    """The meshes of frame files, read one at a time and as often as needed.

    Parameters
    ----------
    paths : sequence of Path
        One file a frame, in order.
    found : FrameFormat
        The format of all of them.
    """

    def __init__(self, paths: Sequence[Path], found: FrameFormat) -> None:
        self.paths = tuple(paths)
        self.format = found
        self._checksums: dict[int, int] = {}
        self._last_fields: tuple[int, Fields] | None = None
        self._faces: tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]] | None = None
        self._positions: Callable[[bytes], Vertices | None] = lambda data: None

    def __len__(self) -> int:
        return len(self.paths)

    def meshes(self, progress: Progress, stage: str) -> Iterator[PolygonMesh]:
        """Each frame, known to be finite and to have the vertex count and faces of the first.

        Raises
        ------
        FormatError
            Naming the file that cannot be read.
        InvalidInputError
            Naming the file and the frame that differs, is not finite, or has changed.
        """
        first = self.mesh(0)
        for index, path in enumerate(self.paths):
            mesh = self.mesh(index) if index else first
            if difference := mesh.difference(first):
                raise InvalidInputError(
                    f"{path} (frame {index}) has {difference} in frame 0 "
                    f"({self.paths[0].name}); all frames of a sequence must have the same "
                    "vertices and faces; --split writes a file for each stretch that has"
                )
            with errors_naming(path):
                validate_finite(mesh.vertices[np.newaxis], first_frame=index)
            yield mesh
            progress(stage, Count(index + 1, len(self), "frames"))

    def mesh(self, index: int) -> PolygonMesh:
        """One frame, as it was when it was first read.

        Raises
        ------
        FormatError
            Naming the file that cannot be read.
        InvalidInputError
            Naming the file that is not there, or has changed.
        """
        with self._contents(index) as data:
            if self._faces is None:
                return self._learn(data)
            if (vertices := self._positions(data)) is None:
                return self.format.parse(data)
            return PolygonMesh(vertices, *self._faces)

    def surface(self, notes: list[str]) -> Surface:
        """Attributes and groups of the first frame; raises as `mesh`.

        Parameters
        ----------
        notes : list of str
            Gains a sentence on what is left out, such as what differs in other frames.
        """
        said: list[str] = []
        first, moving = self._surface(0, said), self._moving_fields
        fields = self._described_fields[0].items()
        if any(key in moving and field.role == NORMALS for key, (field, _) in fields):
            said = [one for one in said if not one.startswith((NORMALS_LEFT_OUT, NORMALS_FAR))]
        notes += [note for note in said if note not in notes]
        differing: list[str] = []
        for index in self._looked_at():
            differing += differing_names(first, self._surface(index, []))
        names = {name for _, name in moving}
        note_frozen(notes, (name for name in differing if name not in names))
        still = [one for one in first.attributes if (one.domain, one.name) not in moving]
        return replace(first, attributes=tuple(still))

    def tracks(self, notes: list[str]) -> dict[str, StoredTrack]:
        """What frames have at vertices, faces and corners that changes; raises as `mesh`.

        All files are read once now, if the format has such, and again when values are asked for.

        Parameters
        ----------
        notes : list of str
            Gains a sentence on what only some frames have.
        """
        if self.format.parse_fields is None:
            return {}
        first, moving = self.mesh(0), self._moving_fields
        frames = [
            {key: field for key, (field, _) in fields.items() if key in moving}
            for fields in self._described_fields
        ]

        def read(index: int, key: Key) -> npt.NDArray[Any]:
            return self._fields(index)[key][0]

        counts = len(first.vertices), len(first.counts), len(first.corners)
        sizes = dict(zip(Domain, counts, strict=True))
        return field_tracks(frames, sizes, read, notes)

    @cached_property
    def _described_fields(self) -> list[dict[Key, tuple[Field, int]]]:
        """What is known of the arrays of each frame, and a number that tells their values."""
        if self.format.parse_fields is None:
            return [{} for _ in self.paths]
        are_same = self._fields_checker
        found: list[dict[Key, tuple[Field, int]]] = []
        for index in range(len(self)):
            if index and are_same is not None:
                with self._contents(index) as data:
                    if are_same(data):
                        found.append(found[0])
                        continue
            fields = self._fields(index).items()
            found.append({key: (field, _sum(values)) for key, (values, field) in fields})
        return found

    @cached_property
    def _fields_checker(self) -> Callable[[bytes], bool] | None:
        """Whether the bytes of a file have the fields of the first, if that can be told."""
        if self.format.fields_checker is None or len(self) < 2:
            return None
        with self._contents(0) as data:
            return self.format.fields_checker(data)

    @cached_property
    def _moving_fields(self) -> set[Key]:
        """The arrays that change over time, that only some frames have, or that are said to."""
        frames = self._described_fields
        keys = {key for fields in frames for key in fields}
        sums = {
            key: {fields[key][1] if key in fields else None for fields in frames} for key in keys
        }
        said = {key for fields in frames for key, (field, _) in fields.items() if field.is_track}
        return said | {key for key in keys if len(sums[key]) > 1}

    @property
    def frame_bytes(self) -> int:
        """Size of the positions and the tracks of the first frame in memory."""
        moving = self._moving_fields
        of_fields = sum(one.nbytes for key, (one, _) in self._fields(0).items() if key in moving)
        return self.mesh(0).vertices.nbytes + of_fields

    def _fields(self, index: int) -> Fields:
        if self.format.parse_fields is None:
            return {}
        if self._last_fields is None or self._last_fields[0] != index:
            with self._contents(index) as data:
                self._last_fields = index, self.format.parse_fields(data)
        return self._last_fields[1]

    def _surface(self, index: int, notes: list[str]) -> Surface:
        if self.format.parse_surface is None:
            return PLAIN
        with self._contents(index) as data:
            return self.format.parse_surface(data, notes)

    def _looked_at(self) -> list[int]:
        """The frames whose attributes are compared with the first: all, if files are small.

        Reading what a frame carries takes about as long as reading its positions; of large files
        some, from the first to the last, are enough to see what moves.
        """
        carries_nothing = self.format.parse_surface is None or self.format.has_unshared_vertices
        if carries_nothing or len(self) == 1:
            return []
        n_fitting = COMPARED_BYTES // max(1, self.paths[0].stat().st_size)
        n_compared = min(len(self) - 1, max(LEAST_COMPARED, n_fitting))
        return sorted({*np.linspace(1, len(self) - 1, n_compared).round().astype(int).tolist()})

    def _learn(self, data: bytes) -> PolygonMesh:
        """The mesh of the file that is read first, whose faces the others most likely have."""
        mesh = self.format.parse(data)
        self._faces = mesh.counts, mesh.corners
        if len(self) > 1 and self.format.positions_reader is not None:
            self._positions = self.format.positions_reader(data, mesh)
        return mesh

    @contextmanager
    def _contents(self, index: int) -> Iterator[bytes]:
        """The bytes of a frame's file; errors within name it."""
        path = self.paths[index]
        with os_errors_naming(path):
            data = path.read_bytes()
        if self._checksums.setdefault(index, checksum := zlib.crc32(data)) != checksum:
            raise changed_error(f"{path} (frame {index})")
        with errors_naming(path):
            if not data:
                raise FormatError(f"is empty; expected a mesh in {self.format.ending} format")
            yield data


def _sum(values: npt.NDArray[Any]) -> int:
    """A number that tells values from others."""
    return zlib.crc32(np.ascontiguousarray(values).data)
