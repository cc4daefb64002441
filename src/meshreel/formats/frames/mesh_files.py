"""Frame files, one mesh each, checked for equal faces and for changes between reads."""

import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import ConnectivityChangeError, FormatError
from meshreel.formats.file_errors import errors_naming, os_errors_naming
from meshreel.formats.frames.field_tracks import NORMALS, Field, Fields, Key, field_tracks
from meshreel.formats.frames.stored_frames import StoredTrack, changed_error
from meshreel.formats.kinds import FrameFormat
from meshreel.formats.notes import NORMALS_FAR, NORMALS_LEFT_OUT, note_frozen
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.sequence import Vertices
from meshreel.model.surface import PLAIN, Domain, Surface
from meshreel.model.surface_selection import differing_names
from meshreel.model.validation import validate_finite
from meshreel.runtime.progress import Count, Progress

COMPARED_BYTES, MIN_COMPARED = 1 << 24, 3
"""Attributes are compared in as many frames as fit these bytes, and in at least three."""


class MeshFiles:
    """The meshes of frame files, read one at a time and as often as necessary.

    Parameters
    ----------
    paths : sequence of Path
        One file per frame, in order.
    format : FrameFormat
        Format of all files.
    """

    def __init__(self, paths: Sequence[Path], format: FrameFormat) -> None:
        self.paths: tuple[Path, ...] = tuple(paths)
        self.format = format
        self._checksums: dict[int, int] = {}
        self._last_fields: tuple[int, Fields] | None = None
        self._faces: tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]] | None = None
        self._positions: Callable[[bytes], Vertices | None] = lambda data: None

    def __len__(self) -> int:
        return len(self.paths)

    def meshes(self, progress: Progress, stage: str) -> Iterator[PolygonMesh]:
        """Yield each frame, checked to be finite and to have the vertices and faces of the first.

        Raises
        ------
        FormatError
            If a file cannot be read.
        InvalidInputError
            If a frame differs, is not finite, or its file has changed. Errors name the file.
        """
        first = self.mesh(0)
        for index, path in enumerate(self.paths):
            mesh = self.mesh(index) if index else first
            self.require_same_faces(index, mesh, first)
            with errors_naming(path):
                validate_finite(mesh.vertices[np.newaxis], first_frame=index)
            yield mesh
            progress(stage, Count(index + 1, len(self), "frames"))

    def require_same_faces(self, index: int, mesh: PolygonMesh, first: PolygonMesh) -> None:
        """Raise ConnectivityChangeError if a frame has not the vertices and faces of the first."""
        if difference := mesh.difference(first):
            raise ConnectivityChangeError(
                f"{self.paths[index]} (frame {index}) has {difference} in frame 0 "
                f"({self.paths[0].name})"
            )

    def mesh(self, index: int) -> PolygonMesh:
        """Return a frame, checked to be the same as when it was first read.

        Raises
        ------
        FormatError
            If the file is damaged.
        InvalidInputError
            If the file does not exist or has changed. Errors name the file.
        """
        with self._contents(index) as data:
            if self._faces is None:
                return self._parse_first(data)
            if (vertices := self._positions(data)) is None:
                return self.format.parse(data)
            return PolygonMesh(vertices, *self._faces)

    def surface(self, notes: list[str]) -> Surface:
        """Return the attributes and groups of the first frame; raises as `mesh`.

        Parameters
        ----------
        notes : list of str
            Receives a sentence for each thing that is left out, such as changes in later frames.
        """
        first_notes: list[str] = []
        first, changing = self._surface(0, first_notes), self._changing_fields
        fields = self._field_descriptions[0].items()
        if any(key in changing and field.role == NORMALS for key, (field, _) in fields):
            first_notes = [
                one for one in first_notes if not one.startswith((NORMALS_LEFT_OUT, NORMALS_FAR))
            ]
        notes += [note for note in first_notes if note not in notes]
        differing: list[str] = []
        for index in self._compared_frames():
            differing += differing_names(first, self._surface(index, []))
        names = {name for _, name in changing}
        note_frozen(notes, (name for name in differing if name not in names))
        constant = [one for one in first.attributes if (one.domain, one.name) not in changing]
        return replace(first, attributes=tuple(constant))

    def tracks(self, notes: list[str]) -> dict[str, StoredTrack]:
        """Return the vertex, face and corner data that change over time; raises as `mesh`.

        If the format supports fields, all files are read now, and again for the values.

        Parameters
        ----------
        notes : list of str
            Receives a sentence for each array that only some frames have.
        """
        if self.format.parse_fields is None:
            return {}
        first, changing = self.mesh(0), self._changing_fields
        frames = [
            {key: field for key, (field, _) in fields.items() if key in changing}
            for fields in self._field_descriptions
        ]

        def read(index: int, key: Key) -> npt.NDArray[Any]:
            return self._fields(index)[key][0]

        counts = len(first.vertices), len(first.counts), len(first.corners)
        sizes = dict(zip(Domain, counts, strict=True))
        return field_tracks(frames, sizes, read, notes)

    @cached_property
    def _field_descriptions(self) -> list[dict[Key, tuple[Field, int]]]:
        """Descriptions of the arrays of each frame, with a checksum of their values."""
        if self.format.parse_fields is None:
            return [{} for _ in self.paths]
        has_same_fields = self._fields_checker
        descriptions: list[dict[Key, tuple[Field, int]]] = []
        for index in range(len(self)):
            if index and has_same_fields is not None:
                with self._contents(index) as data:
                    if has_same_fields(data):
                        descriptions.append(descriptions[0])
                        continue
            fields = self._fields(index).items()
            descriptions.append(
                {key: (field, _checksum(values)) for key, (values, field) in fields}
            )
        return descriptions

    @cached_property
    def _fields_checker(self) -> Callable[[bytes], bool] | None:
        """Function that tells whether a file has the fields of the first; None if unsupported."""
        if self.format.fields_checker is None or len(self) < 2:
            return None
        with self._contents(0) as data:
            return self.format.fields_checker(data)

    @cached_property
    def _changing_fields(self) -> set[Key]:
        """Arrays that change over time, are missing in some frames, or are declared tracks."""
        frames = self._field_descriptions
        keys = {key for fields in frames for key in fields}
        sums = {
            key: {fields[key][1] if key in fields else None for fields in frames} for key in keys
        }
        first_notes = {
            key for fields in frames for key, (field, _) in fields.items() if field.is_track
        }
        return first_notes | {key for key in keys if len(sums[key]) > 1}

    @property
    def frame_bytes(self) -> int:
        """Bytes of the positions and tracks of the first frame in memory."""
        changing = self._changing_fields
        field_bytes = sum(
            one.nbytes for key, (one, _) in self._fields(0).items() if key in changing
        )
        return self.mesh(0).vertices.nbytes + field_bytes

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

    def _compared_frames(self) -> list[int]:
        """Frames whose attributes are compared with those of the first: all, if files are small.

        Reading the attributes of a frame takes about as long as reading its positions; of large
        files, a few from the first to the last are enough to detect changes.
        """
        carries_nothing = self.format.parse_surface is None or self.format.has_unshared_vertices
        if carries_nothing or len(self) == 1:
            return []
        n_fitting = COMPARED_BYTES // max(1, self.paths[0].stat().st_size)
        n_compared = min(len(self) - 1, max(MIN_COMPARED, n_fitting))
        return sorted({*np.linspace(1, len(self) - 1, n_compared).round().astype(int).tolist()})

    def _parse_first(self, data: bytes) -> PolygonMesh:
        """Parse the file that is read first, and prepare faster reading of files with its faces."""
        mesh = self.format.parse(data)
        self._faces = mesh.counts, mesh.corners
        if len(self) > 1 and self.format.positions_reader is not None:
            self._positions = self.format.positions_reader(data, mesh)
        return mesh

    @contextmanager
    def _contents(self, index: int) -> Iterator[bytes]:
        """Context manager for the bytes of a frame's file; errors inside it name the file."""
        path = self.paths[index]
        with os_errors_naming(path):
            data = path.read_bytes()
        if self._checksums.setdefault(index, checksum := zlib.crc32(data)) != checksum:
            raise changed_error(f"{path} (frame {index})")
        with errors_naming(path):
            if not data:
                raise FormatError(f"is empty; expected a mesh in {self.format.extension} format")
            yield data


def _checksum(values: npt.NDArray[Any]) -> int:
    """Checksum of the values of an array."""
    return zlib.crc32(np.ascontiguousarray(values).data)
