"""Objects and properties of an Alembic file, read from its Ogawa container."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.headers import (
    Metadata,
    ObjectHeader,
    PropertyHeader,
    read_object_headers,
    read_property_headers,
    read_samplings,
    read_shared_metadata,
)
from meshreel.formats.alembic.ogawa import OgawaFile, References, damage_error
from meshreel.formats.alembic.time_sampling import Times, TimeSampling

KEY_BYTES = 16  # checksum at the start of each sample
N_SECTIONS, OBJECTS, SAMPLINGS, METADATA = 6, 2, 4, 5
"""Number of references in the root group, and the indices of those that are read."""


class Archive:
    """An Alembic file opened for reading.

    Attributes
    ----------
    file : OgawaFile
    top : AbcObject
        Unnamed root object of the hierarchy.

    Raises
    ------
    InvalidInputError
        If the file cannot be read.
    FormatError
        If the file is not an Alembic file, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.file: OgawaFile = OgawaFile(path)
        root = [int(reference) for reference in self.file.group(self.file.root)]
        if len(root) < N_SECTIONS:
            raise damage_error(
                f"the root group has {len(root)} entries; an Alembic file has {N_SECTIONS}"
            )
        self.samplings: list[TimeSampling] = read_samplings(self.file.data(root[SAMPLINGS]))
        self.metadata: list[Metadata] = read_shared_metadata(self.file.data(root[METADATA]))
        self.top: AbcObject = AbcObject(ObjectHeader("", "", False), self, root[OBJECTS])

    def properties(self, reference: int) -> dict[str, "Property"]:
        """Return the properties in a group, by name."""
        group = self.file.group(reference)
        if len(group) < 2:  # at least one property and the headers
            return {}
        headers = list(read_property_headers(self.file.data(int(group[-1])), self.metadata))
        _check_count(headers, len(group) - 1, "properties")
        return {
            header.name: Property(header, self, int(child))
            for header, child in zip(headers, group[:-1], strict=True)
        }


@dataclass(frozen=True, eq=False)
class AbcObject:
    """An object of the hierarchy: a transform, a mesh, a camera or a face set.

    Attributes
    ----------
    reference : int
        Reference to its Ogawa group.
    """

    header: ObjectHeader
    archive: Archive
    reference: int

    @cached_property
    def properties(self) -> dict[str, "Property"]:
        """The properties of the object, by name."""
        return self.archive.properties(int(self._group[0])) if len(self._group) else {}

    @cached_property
    def children(self) -> list["AbcObject"]:
        """The child objects, in file order."""
        if len(self._group) < 3:  # properties, at least one child, and the headers
            return []
        names = self.archive.file.data(int(self._group[-1]))
        headers = list(read_object_headers(names, self.archive.metadata))
        _check_count(headers, len(self._group) - 2, "objects")
        return [
            AbcObject(header, self.archive, int(child))
            for header, child in zip(headers, self._group[1:-1], strict=True)
        ]

    @cached_property
    def _group(self) -> References:
        return self.archive.file.group(self.reference)


@dataclass(frozen=True, eq=False)
class Property:
    """A named property of an object: samples of values, or a compound of other properties.

    Attributes
    ----------
    reference : int
        Reference to its Ogawa group.
    """

    header: PropertyHeader
    archive: Archive
    reference: int

    @cached_property
    def properties(self) -> dict[str, "Property"]:
        """The children of a compound property, by name; empty for any other property."""
        return self.archive.properties(self.reference) if self.header.is_compound else {}

    @property
    def is_constant(self) -> bool:
        """Whether all samples are the same."""
        return self.header.n_stored <= 1

    @property
    def sampling(self) -> TimeSampling:
        """The time sampling of its samples."""
        if self.header.sampling >= len(self.archive.samplings):
            raise damage_error(f"there is no time sampling {self.header.sampling}")
        return self.archive.samplings[self.header.sampling]

    @cached_property
    def times_s(self) -> Times:
        """Times of the samples in seconds; only the first if all samples are the same."""
        return self.sampling.times(1 if self.is_constant else self.header.n_samples)

    def stored_index(self, index: int) -> int:
        """Return the index of a sample among those stored, where repeated samples are omitted."""
        last = self.header.n_stored - 1
        return min(max(0, index - self.header.first_changed + 1), last)

    def numbers(self, index: int = 0) -> npt.NDArray[Any]:
        """Return a numeric sample, read-only, of shape (number of values, extent).

        Raises
        ------
        FormatError
            If there is no such sample, or its size is not a multiple of the value size.
        """
        dtype, contents = self.header.dtype, self._contents(index)
        if dtype is None or self.header.extent == 0:
            raise damage_error(f"{self.header.name} is not numeric")
        width = self.header.extent * dtype.itemsize
        if len(contents) % width:
            raise damage_error(
                f"{self.header.name} has {len(contents)} bytes, not a multiple of {width}"
            )
        return np.frombuffer(contents, dtype).reshape(-1, self.header.extent)

    def integers(self, index: int = 0) -> npt.NDArray[np.int64]:
        """Return an integer sample as a flat array, of shape (N,).

        Raises
        ------
        FormatError
            As `numbers`, and if the numbers are not integers.
        """
        numbers = self.numbers(index)
        if numbers.dtype.kind not in "iu":
            raise damage_error(f"{self.header.name} is {numbers.dtype}; expected integers")
        return numbers.ravel().astype(np.int64)

    def texts(self, index: int = 0) -> list[str]:
        """Return a sample of zero-terminated strings; raises as `numbers`."""
        if not self.header.is_text:
            raise damage_error(f"{self.header.name} is not text")
        texts = self._contents(index).decode(errors="replace").split("\0")
        return texts if texts[-1] else texts[:-1]

    def _contents(self, index: int) -> bytes:
        # Array samples alternate between data and dimensions.
        place = self.stored_index(index) * (2 if self.header.is_array else 1)
        if not 0 <= place < len(self._samples):
            raise damage_error(f"{self.header.name} has no sample {index}")
        return self.archive.file.data(int(self._samples[place]))[KEY_BYTES:]

    @cached_property
    def _samples(self) -> References:
        return self.archive.file.group(self.reference)


def _check_count(headers: list[Any], n_found: int, what: str) -> None:
    if len(headers) != n_found:
        raise damage_error(f"its headers list {len(headers)} {what}, but it has {n_found}")
