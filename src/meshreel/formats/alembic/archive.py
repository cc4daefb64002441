"""Objects and properties of an Alembic file, read from its Ogawa container.

The container consists of groups of references, and of blocks of data. It is parsed here because the
Alembic library aborts the process on some damaged files.
"""

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from io import SEEK_END
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.frames.stored_frames import changed_error

MAGIC, FINISHED = b"Ogawa", 0xFF
HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
HEADER = struct.Struct("<5sB2sQ")  # magic, finished flag, version, root group offset
LENGTH = struct.Struct("<Q")
IS_DATA = 1 << 63
"""Flag of a reference to data; otherwise it refers to a group. The other bits are the offset."""

KEY_BYTES = 16  # checksum at the start of each sample
HASHES_BYTES = 32  # at the end of the object headers
N_SECTIONS, OBJECTS, INFO, SAMPLINGS, METADATA = 6, 2, 3, 4, 5
"""Number of references in the root group, and the indices of those that are read."""

NUMBER_TYPES: dict[int, np.dtype[Any]] = {
    0: np.dtype("u1"), 1: np.dtype("u1"), 2: np.dtype("i1"), 3: np.dtype("<u2"),
    4: np.dtype("<i2"), 5: np.dtype("<u4"), 6: np.dtype("<i4"), 7: np.dtype("<u8"),
    8: np.dtype("<i8"), 9: np.dtype("<f2"), 10: np.dtype("<f4"), 11: np.dtype("<f8"),
}  # fmt: skip
"""NumPy types by Alembic's number for plain old data types; 0 is a boolean of one byte."""
TEXT = 12

INLINE_METADATA = 0xFF
"""Index that marks metadata stored inline."""
ACYCLIC_S = np.finfo(np.float64).max / 32
"""Cycle length that marks acyclic sampling, where every time is listed."""
MAX_SAMPLES = 1_000_000
"""More than eleven hours at 24 frames per second; a damaged file may declare any number."""
MAX_TIME_S, MIN_INTERVAL_S = 1e12, 1e-9
"""Limits of times and of mean sample intervals; values beyond them mean a damaged file."""

Metadata = dict[str, str]
References = npt.NDArray[np.uint64]
Item = TypeVar("Item")


def damage_error(reason: str) -> FormatError:
    """Return the error for a file that contradicts itself."""
    return FormatError(f"is damaged: {reason}; export it again")


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

    def times(self, count: int) -> Floats:
        """Return the next `count` float64 values."""
        return np.frombuffer(self._read(8 * count), "<f8").astype(np.float64)

    def text(self, size_bytes: int) -> str:
        """Return the next string; bytes that are not UTF-8 are replaced."""
        return self._read(size_bytes).decode(errors="replace")

    def metadata(self, size_bytes: int) -> Metadata:
        """Return the next metadata, stored as "key=value;key=value"."""
        pairs = (pair.partition("=") for pair in self.text(size_bytes).split(";"))
        return {key: value for key, _, value in pairs}

    def read_all(self, read: Callable[[], Item]) -> list[Item]:
        """Call a function that reads one item until the end; return the items."""
        items = []
        while not self.is_at_end:
            items.append(read())
        return items

    def _read(self, size_bytes: int) -> bytes:
        start, self._offset = self._offset, self._offset + size_bytes
        if self._offset > len(self._contents):
            raise damage_error("a list ends in the middle of an entry")
        return self._contents[start : self._offset]


@dataclass(frozen=True, eq=False)
class TimeSampling:
    """The times of samples: uniform, cyclic or acyclic."""

    stored_times_s: Floats
    """float64 array of shape (N,). Times of the first cycle, or of all samples if acyclic, in
    seconds.
    """
    cycle_s: float | None
    """Length of a cycle; None if acyclic."""

    def times(self, n_samples: int) -> Floats:
        """Return the times of the first samples, ascending, of shape (n_samples,).

        Raises
        ------
        FormatError
            If fewer times are stored, or they do not ascend.
        """
        if self.cycle_s is not None:
            cycles, phases = np.divmod(np.arange(n_samples), len(self.stored_times_s))
            with np.errstate(all="ignore"):
                times = self.stored_times_s[phases] + cycles * self.cycle_s
        elif n_samples <= len(self.stored_times_s):
            times = self.stored_times_s[:n_samples]
        else:
            raise damage_error(f"it lists {len(self.stored_times_s)} times for {n_samples} samples")
        if not (np.abs(times) < MAX_TIME_S).all() or (np.diff(times) < 0).any():
            raise damage_error("sample times do not ascend")
        if 0 < times[-1] - times[0] < MIN_INTERVAL_S * (n_samples - 1):
            raise damage_error(
                f"{n_samples} samples span only {times[-1] - times[0]:.2g} s; "
                f"expected at least {MIN_INTERVAL_S:g} s per interval"
            )
        return times


class Archive:
    """An Alembic file opened for reading, whose groups and data are read on demand.

    Attributes
    ----------
    application : str
        Name and version of the program that wrote the file; may be empty.
    top : AbcObject
        Unnamed root object of the hierarchy.
    read, unfit : set of Property
        Properties of which a sample was read, and those whose values do not fit their mesh.

    Raises
    ------
    InvalidInputError
        If the file cannot be read.
    FormatError
        If it is not an Alembic file, was not completely written, or is damaged.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._checksums: dict[int, int] = {}
        self.read: set[Property] = set()
        self.unfit: set[Property] = set()
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
        _, finished, version, start = HEADER.unpack(head)
        if finished != FINISHED:
            raise FormatError("is an Alembic file that was not completely written; export it again")
        if version != b"\x00\x01":
            raise FormatError(f"has Ogawa version {version.hex()}; only version 0001 is supported")
        root = self.group(start).tolist()
        if len(root) < N_SECTIONS:
            raise damage_error(
                f"the root group has {len(root)} entries; an Alembic file has {N_SECTIONS}"
            )
        samplings, metadata = (
            Records(self.data(root[section])) for section in (SAMPLINGS, METADATA)
        )
        self.samplings: list[TimeSampling] = []
        while not samplings.is_at_end:
            samplings.number(4)  # maximum number of samples, unused here
            cycle_s = float(samplings.times(1)[0])
            times_s = samplings.times(samplings.number(4))
            if len(times_s) == 0:
                raise damage_error("a time sampling has no times")
            sampling = TimeSampling(times_s, None if cycle_s == ACYCLIC_S else cycle_s)
            self.samplings.append(sampling)
        # Headers refer to metadata by index; index 0 is empty.
        shared_metadata = metadata.read_all(lambda: metadata.metadata(metadata.number(1)))
        self._metadata: list[Metadata] = [{}, *shared_metadata]
        info = self.data(root[INFO])
        self.application: str = Records(info).metadata(len(info)).get("_ai_Application", "")
        self.top: AbcObject = AbcObject(self, root[OBJECTS], "", {})

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
                raise changed_error(str(self._path)) from None
            raise
        if self._checksums.setdefault(offset, checksum := zlib.crc32(contents)) != checksum:
            raise changed_error(str(self._path))
        return contents

    def objects(self, group: References) -> list["AbcObject"]:
        """Return the objects in the group of their parent, in file order."""
        if len(group) < 3:  # properties, at least one child, and the headers
            return []
        records = Records(self.data(int(group[-1]))[:-HASHES_BYTES])

        def header() -> tuple[str, Metadata]:
            name = records.text(records.number(4))
            return name, self._read_metadata(records, records.number(1), 4)

        headers = records.read_all(header)
        _check_count(headers, len(group) - 2, "objects")
        children = zip(group[1:-1].tolist(), headers, strict=True)
        return [AbcObject(self, child, *header) for child, header in children]

    def properties(self, reference: int) -> dict[str, "Property"]:
        """Return the properties in a group, by name."""
        group = self.group(reference)
        if len(group) < 2:  # at least one property and the headers
            return {}
        records = Records(self.data(int(group[-1])))
        headers = records.read_all(lambda: self._property_header(records))
        _check_count(headers, len(group) - 1, "properties")
        children = zip(group[:-1].tolist(), headers, strict=True)
        return {header["name"]: Property(self, child, **header) for child, header in children}

    def _property_header(self, records: Records) -> dict[str, Any]:
        """Read the fields of a `Property`."""
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
        return {
            "name": name, "is_compound": kind == 0, "is_array": kind > 1,
            "dtype": NUMBER_TYPES.get(pod), "is_text": pod == TEXT, "extent": flags >> 12 & 0xFF,
            "n_samples": n_samples, "first_changed": first, "last_changed": last,
            "sampling_index": sampling,
            "metadata": self._read_metadata(records, flags >> 20 & 0xFF, width),
        }  # fmt: skip

    def _read_metadata(self, records: Records, index: int, width: int) -> Metadata:
        if index == INLINE_METADATA:
            return records.metadata(records.number(width))
        if index >= len(self._metadata):
            raise damage_error(f"there is no metadata {index}")
        return self._metadata[index]

    def _length_prefixed(self, offset: int, item_bytes: int) -> bytes:
        """Return the bytes after a length, which counts items of `item_bytes` each."""
        if offset == 0:
            return b""
        # Opened for each read, so that others may rename or replace the file.
        with os_errors_naming(self._path), self._path.open("rb") as stream:
            # Check against the file size first: offset and length may be damaged.
            remaining = stream.seek(0, SEEK_END) - offset - LENGTH.size
            if remaining >= 0:
                stream.seek(offset)
                size = LENGTH.unpack(stream.read(LENGTH.size))[0] * item_bytes
                if size <= remaining and len(contents := stream.read(size)) == size:
                    return contents
        raise damage_error(f"the block at byte {offset} ends after the end of the file")


def _check_count(headers: list[Any], count: int, noun: str) -> None:
    if len(headers) != count:
        raise damage_error(f"its headers list {len(headers)} {noun}, but it has {count}")


@dataclass(frozen=True, eq=False)
class AbcObject:
    """An object of the hierarchy: a transform, a mesh, a camera or a face set."""

    archive: Archive
    reference: int
    """Reference to its Ogawa group."""
    name: str
    """Name without the path."""
    metadata: Metadata

    @property
    def schema(self) -> str:
        """Schema without version, such as "AbcGeom_PolyMesh"; empty if undeclared."""
        return self.metadata.get("schema", "").rpartition("_v")[0]

    @property
    def is_instance(self) -> bool:
        """Whether it is an instance of another object, including properties and children."""
        return self.metadata.get("isInstance") == "1"

    @cached_property
    def properties(self) -> dict[str, "Property"]:
        """The properties of the object, by name."""
        return self.archive.properties(int(self._group[0])) if len(self._group) else {}

    @cached_property
    def children(self) -> list["AbcObject"]:
        """The child objects, in file order."""
        return self.archive.objects(self._group)

    @cached_property
    def _group(self) -> References:
        return self.archive.group(self.reference)


@dataclass(frozen=True, eq=False)
class Property:
    """A named property of an object: samples of values, or a compound of other properties."""

    archive: Archive
    reference: int
    """Reference to its Ogawa group."""
    name: str
    is_compound: bool
    is_array: bool
    """Whether it contains other properties; whether a sample is an array, not a single value."""
    dtype: np.dtype[Any] | None
    """Type of the components of a value; None for text."""
    is_text: bool
    extent: int
    """Number of components of a value."""
    n_samples: int
    first_changed: int
    last_changed: int
    """The first sample that differs from sample 0, and the last from the one before it; both are 0
    if all samples are the same.
    """
    sampling_index: int
    """Index of its time sampling."""
    metadata: Metadata

    @cached_property
    def properties(self) -> dict[str, "Property"]:
        """The children of a compound property, by name; empty for any other property."""
        return self.archive.properties(self.reference) if self.is_compound else {}

    @property
    def is_constant(self) -> bool:
        """Whether all samples are the same."""
        return self.n_samples == 0 or self.last_changed == 0

    @property
    def sampling(self) -> TimeSampling:
        """The time sampling of its samples."""
        if self.sampling_index >= len(self.archive.samplings):
            raise damage_error(f"there is no time sampling {self.sampling_index}")
        return self.archive.samplings[self.sampling_index]

    @cached_property
    def times_s(self) -> Floats:
        """Times of the samples in seconds; only the first if all samples are the same."""
        return self.sampling.times(1 if self.is_constant else self.n_samples)

    def stored_index(self, index: int) -> int:
        """Return the index of a sample in storage, which omits repeated samples at both ends."""
        last = 0 if self.is_constant else self.last_changed - self.first_changed + 1
        return min(max(0, index - self.first_changed + 1), last)

    def numbers(self, index: int = 0) -> npt.NDArray[Any]:
        """Return a numeric sample, read-only, of shape (number of values, extent).

        Raises
        ------
        FormatError
            If there is no such sample, or its size is not a multiple of the value size.
        """
        contents = self._contents(index)
        if self.dtype is None or self.extent == 0:
            raise damage_error(f"{self.name} is not numeric")
        width = self.extent * self.dtype.itemsize
        if len(contents) % width:
            raise damage_error(f"{self.name} has {len(contents)} bytes, not a multiple of {width}")
        return np.frombuffer(contents, self.dtype).reshape(-1, self.extent)

    def integers(self, index: int = 0) -> Integers:
        """Return an integer sample as a flat array, of shape (N,).

        Raises
        ------
        FormatError
            As `numbers`, and if the numbers are not integers.
        """
        numbers = self.numbers(index)
        if numbers.dtype.kind not in "iu":
            raise damage_error(f"{self.name} is {numbers.dtype}; expected integers")
        return numbers.ravel().astype(np.int64)

    def texts(self, index: int = 0) -> list[str]:
        """Return a sample of zero-terminated strings; raises as `numbers`."""
        if not self.is_text:
            raise damage_error(f"{self.name} is not text")
        texts = self._contents(index).decode(errors="replace").split("\0")
        return texts if texts[-1] else texts[:-1]

    def reference_of(self, index: int) -> int:
        """Return the reference to the data of a sample; equal samples may share it."""
        # Array samples alternate between data and dimensions.
        reference_index = self.stored_index(index) * (2 if self.is_array else 1)
        if not self.n_samples or reference_index >= len(self._samples):
            raise damage_error(f"{self.name} has no sample {index}")
        return int(self._samples[reference_index])

    @property
    def is_empty(self) -> bool:
        """Whether it has no sample, or a single one without values."""
        return not self.n_samples or (self.n_samples == 1 and not self._bytes(0))

    def _contents(self, index: int) -> bytes:
        self.archive.read.add(self)
        return self._bytes(index)

    def _bytes(self, index: int) -> bytes:
        return self.archive.data(self.reference_of(index))[KEY_BYTES:]

    @cached_property
    def _samples(self) -> References:
        return self.archive.group(self.reference)
