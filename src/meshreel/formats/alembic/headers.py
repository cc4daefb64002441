"""Headers of an Alembic file, which describe its objects, properties and time samplings."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.alembic.ogawa import Records, damage_error
from meshreel.formats.alembic.time_sampling import TimeSampling

Metadata = dict[str, str]

NUMBER_TYPES: dict[int, np.dtype[Any]] = {
    0: np.dtype("u1"), 1: np.dtype("u1"), 2: np.dtype("i1"), 3: np.dtype("<u2"),
    4: np.dtype("<i2"), 5: np.dtype("<u4"), 6: np.dtype("<i4"), 7: np.dtype("<u8"),
    8: np.dtype("<i8"), 9: np.dtype("<f2"), 10: np.dtype("<f4"), 11: np.dtype("<f8"),
}  # fmt: skip
"""NumPy types by Alembic's number for plain old data types; 0 is a boolean of one byte."""
TEXT = 12

OWN_METADATA = 0xFF
"""Metadata index of metadata that follow inline."""
HASHES_BYTES = 32  # at the end of the object headers
ACYCLIC_S = np.finfo(np.float64).max / 32
"""Cycle length that marks acyclic sampling, where every time is listed."""
MAX_SAMPLES = 1_000_000
"""More than eleven hours at 24 frames per second; a damaged file may declare any number."""


@dataclass(frozen=True)
class PropertyHeader:
    """Header of a property.

    Attributes
    ----------
    is_compound, is_array : bool
        Whether it contains other properties; whether a sample is an array, not a single value.
    dtype : dtype, optional
        Type of the components of a value; None for text.
    extent : int
        Number of components of a value.
    first_changed, last_changed : int
        The first sample that differs from sample 0, and the last from the one before it; both
        are 0 if all samples are the same.
    sampling : int
        Index of its time sampling.
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
        """Number of samples in the file, which omits repeated samples at both ends."""
        if self.n_samples == 0:
            return 0
        return self.last_changed - self.first_changed + 2 if self.last_changed else 1


@dataclass(frozen=True)
class ObjectHeader:
    """Header of an object.

    Attributes
    ----------
    name : str
        Its own name, without the path.
    schema : str
        Schema with version, such as "AbcGeom_PolyMesh_v1"; empty if undeclared.
    is_instance : bool
        Whether it is an instance of another object, including properties and children.
    """

    name: str
    schema: str
    is_instance: bool


def read_shared_metadata(contents: bytes) -> list[Metadata]:
    """Return the metadata to which headers refer by index; index 0 is empty."""
    records, metadata = Records(contents), [Metadata()]
    while not records.is_at_end:
        metadata.append(records.metadata(records.number(1)))
    return metadata


def read_samplings(contents: bytes) -> list[TimeSampling]:
    """Return the time samplings to which properties refer by index."""
    records, samplings = Records(contents), []
    while not records.is_at_end:
        records.number(4)  # maximum number of samples, unused here
        cycle_s = records.seconds()
        times_s = records.times(records.number(4))
        if len(times_s) == 0:
            raise damage_error("a time sampling has no times")
        samplings.append(TimeSampling(times_s, None if cycle_s == ACYCLIC_S else cycle_s))
    return samplings


def read_object_headers(contents: bytes, shared: list[Metadata]) -> Iterator[ObjectHeader]:
    """Yield the headers of the children of an object, in file order."""
    records = Records(contents[:-HASHES_BYTES])
    while not records.is_at_end:
        name = records.text(records.number(4))
        metadata = _metadata(records, records.number(1), 4, shared)
        yield ObjectHeader(name, metadata.get("schema", ""), metadata.get("isInstance") == "1")


def read_property_headers(contents: bytes, shared: list[Metadata]) -> Iterator[PropertyHeader]:
    """Yield the property headers of an object or a compound property, in file order."""
    records = Records(contents)
    while not records.is_at_end:
        yield _property_header(records, shared)


def _property_header(records: Records, shared: list[Metadata]) -> PropertyHeader:
    # Bit fields, from the lowest: 2 property type, 2 width of the integers below, 4 data type,
    # 1 has a time sampling, 1 has first and last changed sample, 1 homogeneous (unused here),
    # 1 is constant, 8 extent, 8 metadata index.
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
            f"{name} declares {n_samples} samples that change from {first} to {last}; expected "
            f"at most {MAX_SAMPLES}, and changes among these; the file is damaged"
        )
    metadata = _metadata(records, flags >> 20 & 0xFF, width, shared)
    return PropertyHeader(
        name, kind == 0, kind > 1, NUMBER_TYPES.get(pod), pod == TEXT, flags >> 12 & 0xFF,
        n_samples, first, last, sampling, metadata,
    )  # fmt: skip


def _metadata(records: Records, index: int, width: int, shared: list[Metadata]) -> Metadata:
    if index == OWN_METADATA:
        return records.metadata(records.number(width))
    if index >= len(shared):
        raise damage_error(f"there is no metadata {index}")
    return shared[index]
