"""Headers of an Alembic file: its objects, properties and times, before their samples."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.alembic.ogawa import Records, damaged
from meshreel.formats.alembic.time_sampling import TimeSampling

Metadata = dict[str, str]

NUMBER_TYPES: dict[int, np.dtype[Any]] = {
    0: np.dtype("u1"), 1: np.dtype("u1"), 2: np.dtype("i1"), 3: np.dtype("<u2"),
    4: np.dtype("<i2"), 5: np.dtype("<u4"), 6: np.dtype("<i4"), 7: np.dtype("<u8"),
    8: np.dtype("<i8"), 9: np.dtype("<f2"), 10: np.dtype("<f4"), 11: np.dtype("<f8"),
}  # fmt: skip
"""Number types by the file's numbers for them; 0 is truth values, of a byte."""
TEXT = 12

OWN_METADATA = 0xFF
"""In place of the number of shared metadata: they follow."""
HASHES_BYTES = 32  # at the end of a list of objects
ACYCLIC_S = np.finfo(np.float64).max / 32
"""Length of a cycle that says that times are listed one by one."""
MAX_SAMPLES = 1_000_000
"""More than eleven hours at 24 frames per second; a damaged file may declare any number."""


@dataclass(frozen=True)
class PropertyHeader:
    """The header of a property.

    Attributes
    ----------
    name : str
    is_compound, is_array : bool
        Whether it holds other properties; whether a sample has any number of values, not one.
    dtype : dtype, optional
        Of the numbers of a value; None for text.
    is_text : bool
    extent : int
        How many numbers a value has.
    n_samples : int
    first_changed, last_changed : int
        The first sample that differs from sample 0, and the last from the one before it; both
        are 0 if all samples are the same.
    sampling : int
        Number of its time sampling.
    metadata : dict
    """

    name: str
    is_compound: bool
    is_array: bool
    dtype: np.dtype[Any] | None
    is_text: bool
    extent: int
    n_samples: int
    first_changed: int
    last_changed: int
    sampling: int
    metadata: Metadata

    @property
    def n_stored(self) -> int:
        """How many samples the file holds: those that repeat at either end are left out."""
        if self.n_samples == 0:
            return 0
        return self.last_changed - self.first_changed + 2 if self.last_changed else 1


@dataclass(frozen=True)
class ObjectHeader:
    """The header of an object.

    Attributes
    ----------
    name : str
        Without those of its parents.
    schema : str
        What it is, such as "AbcGeom_PolyMesh_v1"; empty if it does not say.
    is_instance : bool
        Whether it stands for another object, properties, children and all.
    """

    name: str
    schema: str
    is_instance: bool


def read_shared_metadata(contents: bytes) -> list[Metadata]:
    """Metadata that headers refer to by number; number 0 has none."""
    records, found = Records(contents), [Metadata()]
    while not records.is_at_end:
        found.append(records.metadata(records.number(1)))
    return found


def read_samplings(contents: bytes) -> list[TimeSampling]:
    """Time samplings that properties refer to by number."""
    records, found = Records(contents), []
    while not records.is_at_end:
        records.number(4)  # the largest number of samples
        cycle_s = records.seconds()
        times_s = records.times(records.number(4))
        if len(times_s) == 0:
            raise damaged("a time sampling has no times")
        found.append(TimeSampling(times_s, None if cycle_s == ACYCLIC_S else cycle_s))
    return found


def read_object_headers(contents: bytes, shared: list[Metadata]) -> Iterator[ObjectHeader]:
    """The objects that an object has below it, in file order."""
    records = Records(contents[:-HASHES_BYTES])
    while not records.is_at_end:
        name = records.text(records.number(4))
        metadata = _metadata(records, records.number(1), 4, shared)
        yield ObjectHeader(name, metadata.get("schema", ""), metadata.get("isInstance") == "1")


def read_property_headers(contents: bytes, shared: list[Metadata]) -> Iterator[PropertyHeader]:
    """The properties of an object or of a compound property, in file order."""
    records = Records(contents)
    while not records.is_at_end:
        yield _property_header(records, shared)


def _property_header(records: Records, shared: list[Metadata]) -> PropertyHeader:
    # From the lowest bit: 2 of kind, 2 of how long numbers are, 4 of number type, whether there is
    # a time sampling, whether changes are given, 1 without use here, whether all samples are the
    # same, 8 of extent, 8 of metadata.
    flags = records.number(4)
    kind, width, pod = flags & 3, 1 << (flags >> 2 & 3), flags >> 4 & 15
    n_samples = first = last = sampling = 0
    if kind:
        n_samples = records.number(width)
        first, last = 1, n_samples - 1
        if flags >> 9 & 1:
            first, last = records.number(width), records.number(width)
        elif flags >> 11 & 1 or n_samples < 2:
            first, last = 0, 0
        sampling = records.number(width) if flags >> 8 & 1 else 0
    name = records.text(records.number(width))
    if (
        n_samples > MAX_SAMPLES
        or not first <= last <= max(0, n_samples - 1)
        or (last and not first)
    ):
        raise FormatError(
            f"{name} declares {n_samples} samples that change from {first} to {last}; "
            f"up to {MAX_SAMPLES} are read, which change within; the file is damaged"
        )
    metadata = _metadata(records, flags >> 20 & 0xFF, width, shared)
    return PropertyHeader(
        name, kind == 0, kind > 1, NUMBER_TYPES.get(pod), pod == TEXT, flags >> 12 & 0xFF,
        n_samples, first, last, sampling, metadata,
    )  # fmt: skip


def _metadata(records: Records, number: int, width: int, shared: list[Metadata]) -> Metadata:
    if number == OWN_METADATA:
        return records.metadata(records.number(width))
    if number >= len(shared):
        raise damaged(f"metadata {number} are not there")
    return shared[number]
