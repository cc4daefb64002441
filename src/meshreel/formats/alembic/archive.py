"""The Ogawa container of an Alembic file: groups of references, and blocks of data.

It is parsed here because the Alembic library aborts the process on some damaged files.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from io import SEEK_END
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.frames.stored_frames import changed_error

MAGIC, FINISHED = b"Ogawa", 0xFF
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
HEADER = struct.Struct("<5sB2sQ")  # magic, finished flag, version, root group offset
LENGTH = struct.Struct("<Q")
IS_DATA = 1 << 63
"""Flag of a reference to data; otherwise it refers to a group. The other bits are the offset."""

References = npt.NDArray[np.uint64]


class OgawaFile:
    """The groups and data of an Ogawa file, read on demand with bounds checks.

    Attributes
    ----------
    root : int
        Reference to the root group.

    Raises
    ------
    InvalidInputError
        If the file cannot be read.
    FormatError
        If it is not an Ogawa file, or was not completely written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._checksums: dict[int, int] = {}
        try:
            with path.open("rb") as stream:
                head = stream.read(HEADER.size)
        except OSError as error:
            raise InvalidInputError(f"cannot be read: {error.strerror}") from error
        if head.startswith(HDF5_MAGIC):
            raise FormatError(
                "is an Alembic file of the older HDF5 kind; convert it with "
                "`abcconvert -toOgawa` or export it again"
            )
        if len(head) < HEADER.size or not head.startswith(MAGIC):
            raise FormatError("is not an Alembic file; expected it to begin with 'Ogawa'")
        _, finished, version, self.root = HEADER.unpack(head)
        if finished != FINISHED:
            raise FormatError("is an Alembic file that was not completely written; export it again")
        if version != b"\x00\x01":
            raise FormatError(f"has Ogawa version {version.hex()}; only version 0001 is supported")

    def group(self, reference: int) -> References:
        """Return the references in a group; an empty array if the group is empty.

        Raises
        ------
        FormatError
            If the reference is not to a group, or the group ends after the end of the file.
        """
        if reference & IS_DATA:
            raise damage_error("found data where a group was expected")
        return np.frombuffer(self._length_prefixed(reference, 8), np.uint64)

    def data(self, reference: int) -> bytes:
        """Return a block of data, which must not have changed since it was first read.

        Raises
        ------
        FormatError
            If the reference is not to data, or the data end after the end of the file.
        InvalidInputError
            If the data have changed.
        """
        if not reference & IS_DATA:
            raise damage_error("found a group where data were expected")
        offset = reference ^ IS_DATA
        try:
            contents = self._length_prefixed(offset, 1)
        except FormatError:
            if offset in self._checksums:
                raise changed_error(str(self.path)) from None
            raise
        if self._checksums.setdefault(offset, checksum := zlib.crc32(contents)) != checksum:
            raise changed_error(str(self.path))
        return contents

    def _length_prefixed(self, offset: int, item_bytes: int) -> bytes:
        """Return the bytes after a length, which counts items of `item_bytes` each."""
        if offset == 0:
            return b""
        # Opened for each read, so that others may rename or replace the file.
        with os_errors_naming(self.path), self.path.open("rb") as stream:
            # Check against the file size first: offset and length may be damaged.
            remaining = stream.seek(0, SEEK_END) - offset - LENGTH.size
            if remaining >= 0:
                stream.seek(offset)
                size = LENGTH.unpack(stream.read(LENGTH.size))[0] * item_bytes
                if size <= remaining and len(contents := stream.read(size)) == size:
                    return contents
        raise damage_error(f"the block at byte {offset} ends after the end of the file")


def damage_error(what: str) -> FormatError:
    """Return the error for a file that contradicts itself."""
    return FormatError(f"is damaged: {what}; export it again")


class Records:
    """Sequential reader of the numbers and strings in a block of data.

    Every method raises `FormatError` if the data end too early.
    """

    def __init__(self, contents: bytes) -> None:
        self._contents = contents
        self._offset = 0

    @property
    def is_at_end(self) -> bool:
        """Whether everything has been read."""
        return self._offset >= len(self._contents)

    def number(self, size_bytes: int) -> int:
        """Return the next unsigned integer."""
        return int.from_bytes(self._read(size_bytes), "little")

    def seconds(self) -> float:
        """Return the next float64."""
        (value,) = struct.unpack("<d", self._read(8))
        return float(value)

    def times(self, count: int) -> npt.NDArray[np.float64]:
        """Return the next `count` float64 values."""
        return np.frombuffer(self._read(8 * count), "<f8").astype(np.float64)

    def text(self, size_bytes: int) -> str:
        """Return the next string; bytes that are not UTF-8 are replaced."""
        return self._read(size_bytes).decode(errors="replace")

    def metadata(self, size_bytes: int) -> dict[str, str]:
        """Return the next metadata, stored as "key=value;key=value"."""
        pairs = (pair.partition("=") for pair in self.text(size_bytes).split(";"))
        return {key: value for key, _, value in pairs}

    def _read(self, size_bytes: int) -> bytes:
        start, self._offset = self._offset, self._offset + size_bytes
        if self._offset > len(self._contents):
            raise damage_error("a list ends in the middle of an entry")
        return self._contents[start : self._offset]


Times = npt.NDArray[np.float64]

MAX_TIME_S, MIN_INTERVAL_S = 1e12, 1e-9
"""Limits of times and of mean sample intervals; values beyond them mean a damaged file."""
SNAP_TOLERANCE = 1e-3
"""Fraction of an interval within which a time snaps to a sample."""


@dataclass(frozen=True, eq=False)
class TimeSampling:
    """The times of samples: uniform, cyclic or acyclic.

    Parameters
    ----------
    stored_s : float64 array of shape (N,)
        Times of the first cycle, or of all samples if acyclic, in seconds.
    cycle_s : float, optional
        Length of a cycle; None if acyclic.
    """

    stored_s: Times
    cycle_s: float | None

    @property
    def is_uniform(self) -> bool:
        """Whether all samples are evenly spaced."""
        return self.cycle_s is not None and len(self.stored_s) == 1

    def times(self, n_samples: int) -> Times:
        """Return the times of the first samples, ascending, of shape (n_samples,).

        Raises
        ------
        FormatError
            If fewer times are stored, or they do not ascend.
        """
        if self.cycle_s is not None:
            cycles, phases = np.divmod(np.arange(n_samples), len(self.stored_s))
            with np.errstate(all="ignore"):
                times = self.stored_s[phases] + cycles * self.cycle_s
        elif n_samples <= len(self.stored_s):
            times = self.stored_s[:n_samples]
        else:
            raise damage_error(f"it lists {len(self.stored_s)} times for {n_samples} samples")
        if not (np.abs(times) < MAX_TIME_S).all() or (np.diff(times) < 0).any():
            raise damage_error("sample times do not ascend")
        if 0 < times[-1] - times[0] < MIN_INTERVAL_S * (n_samples - 1):
            raise damage_error(
                f"{n_samples} samples span only {times[-1] - times[0]:.2g} s; "
                f"expected at least {MIN_INTERVAL_S:g} s per interval"
            )
        return times


def bracketing_samples(times_s: Times, time_s: float) -> tuple[int, int, float]:
    """Return the samples before and after a time, and the interpolation weight of the latter.

    Outside the sampled range, both are the nearest sample.
    """
    after = int(np.searchsorted(times_s, time_s))
    if after == 0 or after == len(times_s):
        nearest = min(after, len(times_s) - 1)
        return nearest, nearest, 0.0
    before = after - 1
    weight = float((time_s - times_s[before]) / (times_s[after] - times_s[before]))
    if weight > 1 - SNAP_TOLERANCE:
        return after, after, 0.0
    if weight < SNAP_TOLERANCE:
        return before, before, 0.0
    return before, after, weight


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
