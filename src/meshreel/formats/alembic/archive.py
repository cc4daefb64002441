"""Objects and properties of an Alembic file, on top of its container."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.headers import (
    ObjectHeader,
    PropertyHeader,
    read_object_headers,
    read_property_headers,
    read_samplings,
    read_shared_metadata,
)
from meshreel.formats.alembic.ogawa import OgawaFile, References, damaged
from meshreel.formats.alembic.time_sampling import Times, TimeSampling

KEY_BYTES = 16  # a checksum that each sample begins with
N_SECTIONS, OBJECTS, SAMPLINGS, METADATA = 6, 2, 4, 5
"""How many references the root of the file holds, and which of them are read."""


class Archive:
    """An Alembic file.

    Attributes
    ----------
    file : OgawaFile
    top : AbcObject
        Without a name; the hierarchy is below it.

    Raises
    ------
    InvalidInputError
        If the file cannot be read.
    FormatError
        If it is no Alembic file, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.file = OgawaFile(path)
        root = [int(one) for one in self.file.group(self.file.root)]
        if len(root) < N_SECTIONS:
            raise damaged(f"it has {len(root)} sections; an Alembic file has {N_SECTIONS}")
        self.samplings = read_samplings(self.file.data(root[SAMPLINGS]))
        self.metadata = read_shared_metadata(self.file.data(root[METADATA]))
        self.top = AbcObject(ObjectHeader("", "", False), self, root[OBJECTS])

    def properties(self, reference: int) -> dict[str, "Property"]:
        """The properties that a group holds, by name."""
        group = self.file.group(reference)
        if len(group) < 2:  # a property, and the names
            return {}
        headers = list(read_property_headers(self.file.data(int(group[-1])), self.metadata))
        _check_count(headers, len(group) - 1, "properties")
        return {
            header.name: Property(header, self, int(own))
            for header, own in zip(headers, group[:-1], strict=True)
        }


@dataclass(frozen=True, eq=False)
class AbcObject:
    """A node of the hierarchy: a transform, a mesh, a camera, a set of faces.

    Attributes
    ----------
    header : ObjectHeader
    archive : Archive
    reference : int
        To its group.
    """

    header: ObjectHeader
    archive: Archive
    reference: int

    @cached_property
    def properties(self) -> dict[str, "Property"]:
        """Its properties, by name."""
        return self.archive.properties(int(self._group[0])) if len(self._group) else {}

    @cached_property
    def children(self) -> list["AbcObject"]:
        """The objects below it, in file order."""
        if len(self._group) < 3:  # its properties, a child, and the names
            return []
        names = self.archive.file.data(int(self._group[-1]))
        headers = list(read_object_headers(names, self.archive.metadata))
        _check_count(headers, len(self._group) - 2, "objects")
        return [
            AbcObject(header, self.archive, int(own))
            for header, own in zip(headers, self._group[1:-1], strict=True)
        ]

    @cached_property
    def _group(self) -> References:
        return self.archive.file.group(self.reference)


@dataclass(frozen=True, eq=False)
class Property:
    """Samples, or other properties, that an object has under a name.

    Attributes
    ----------
    header : PropertyHeader
    archive : Archive
    reference : int
        To its group.
    """

    header: PropertyHeader
    archive: Archive
    reference: int

    @cached_property
    def properties(self) -> dict[str, "Property"]:
        """The properties within a compound property, by name; none if it is not compound."""
        return self.archive.properties(self.reference) if self.header.is_compound else {}

    @property
    def is_constant(self) -> bool:
        """Whether all samples are the same."""
        return self.header.n_stored <= 1

    @property
    def sampling(self) -> TimeSampling:
        """When its samples are."""
        if self.header.sampling >= len(self.archive.samplings):
            raise damaged(f"time sampling {self.header.sampling} is not there")
        return self.archive.samplings[self.header.sampling]

    @cached_property
    def times_s(self) -> Times:
        """When its samples are, in seconds; only the first if all are the same."""
        return self.sampling.times(1 if self.is_constant else self.header.n_samples)

    def stored(self, index: int) -> int:
        """Number of a sample among those that the file holds."""
        last = self.header.n_stored - 1
        return min(max(0, index - self.header.first_changed + 1), last)

    def numbers(self, index: int = 0) -> npt.NDArray[Any]:
        """A sample of numbers, read-only, of shape (number of values, extent).

        Raises
        ------
        FormatError
            If there is no such sample, or it does not hold whole values.
        """
        dtype, contents = self.header.dtype, self._contents(index)
        if dtype is None or self.header.extent == 0:
            raise damaged(f"{self.header.name} holds no numbers")
        width = self.header.extent * dtype.itemsize
        if len(contents) % width:
            raise damaged(f"{self.header.name} has {len(contents)} bytes for values of {width}")
        return np.frombuffer(contents, dtype).reshape(-1, self.header.extent)

    def whole_numbers(self, index: int = 0) -> npt.NDArray[np.int64]:
        """A sample of whole numbers, of shape (N,); raises as `numbers`, and if they are none."""
        numbers = self.numbers(index)
        if numbers.dtype.kind not in "iu":
            raise damaged(f"{self.header.name} holds {numbers.dtype}; expected whole numbers")
        return numbers.ravel().astype(np.int64)

    def texts(self, index: int = 0) -> list[str]:
        """A sample of texts, of which each ends with a zero byte; raises as `numbers`."""
        if not self.header.is_text:
            raise damaged(f"{self.header.name} holds no text")
        texts = self._contents(index).decode(errors="replace").split("\0")
        return texts if texts[-1] else texts[:-1]

    def _contents(self, index: int) -> bytes:
        place = self.stored(index) * (2 if self.header.is_array else 1)  # lengths lie between
        if not 0 <= place < len(self._samples):
            raise damaged(f"{self.header.name} has no sample {index}")
        return self.archive.file.data(int(self._samples[place]))[KEY_BYTES:]

    @cached_property
    def _samples(self) -> References:
        return self.archive.file.group(self.reference)


def _check_count(headers: list[Any], n_there: int, what: str) -> None:
    if len(headers) != n_there:
        raise damaged(f"{len(headers)} {what} are named where {n_there} are")
