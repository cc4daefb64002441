"""HDF5 files: safe reading of untrusted ones, writing that survives a full disk, track attributes.

Reading opens no external files and allocates no more than the file size. The HDF5 library never
returns from some damaged files, which are rejected here, and crashes if it cannot flush its
buffers: it gets a file object that accepts all writes. Data that the disk refuses stays in memory,
and the error is raised after the library has closed the file.
"""

import io
import math
import struct
from collections.abc import Container, Iterator
from contextlib import contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values, native
from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.model.sequence import Vertices
from meshreel.model.tracks import TrackSource, track_blocks
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import HDF

MAX_RATIO = 1100  # deflate compresses by at most 1032:1
MAX_LINKS = 64
SMALL_BYTES = 1 << 20  # chunk size that is allowed for any file

Node = Any  # a group or a dataset of h5py, which has no types
Dataset = Any

UNIT_NAMES = ("unit", "units")

TRACK_ATTRIBUTES = {"name", "domain", "kind", *UNIT_NAMES}
"""Attributes of a dataset that are read if it is a track."""

HEAP_START = b"GCOL\1\0\0\0"
"""Signature and version of a global heap, which stores text of any length (HDF5 format, III.E)."""

HEAP_OBJECT = struct.Struct("<HHIQ")
MAX_SCANNED_BYTES = 1 << 30
"""Larger files are not searched for heaps, because that would take seconds."""


@contextmanager
def hdf_errors() -> Iterator[None]:
    """Context manager that turns every error of the HDF5 library into a `FormatError`."""
    try:
        yield
    except MeshReelError:
        raise
    # On damaged files the library raises many types of exceptions.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(f"is not an HDF5 file, or is damaged ({reason[:200]})") from error


def open_hdf(path: Path) -> Node:
    """Open a file and return its root group; the file closes with the last reference to it.

    Raises
    ------
    FormatError
        If the file is not HDF5, or h5py is not installed.
    """
    h5py = HDF.load()
    with hdf_errors():
        file = h5py.File(path, "r")
        if file.id.get_create_plist().get_sizes()[1] == 8:
            _check_heaps(path)
        return file["/"]


def _check_heaps(path: Path) -> None:
    """Reject heaps with an object of no bytes, which the library reads again and again."""
    if not 0 < path.stat().st_size <= MAX_SCANNED_BYTES:
        return
    with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
        heap = data.find(HEAP_START)
        while 0 <= heap <= len(data) - 16:
            size = int.from_bytes(data[heap + 8 : heap + 16], "little")
            offset, end = heap + 16, min(heap + size, len(data))
            while offset + HEAP_OBJECT.size <= end:
                number, _, _, n_bytes = HEAP_OBJECT.unpack_from(data, offset)
                # Object 0 is free space, whose size includes its header.
                n_bytes = n_bytes if number == 0 else HEAP_OBJECT.size + (n_bytes + 7) // 8 * 8
                if n_bytes == 0:
                    raise FormatError(f"is damaged: the heap at byte {heap} has an empty object")
                offset += n_bytes
            heap = data.find(HEAP_START, heap + 8)


def find_node(group: Node, name: str, n_links: int = 0) -> Node | None:
    """Return the group or dataset at a path below a group; None if there is none.

    Raises
    ------
    FormatError
        If a link leads to another file, or links form a cycle.
    """
    h5py = HDF.load()
    node = group.file["/"] if name.startswith("/") else group
    for part in filter(None, name.split("/")):
        if not isinstance(node, h5py.Group):
            return None
        link = node.get(part, getlink=True)
        if link is None:
            return None
        if isinstance(link, h5py.ExternalLink):
            raise FormatError(
                f"{part!r} links to another file ({link.filename}), which is not read"
            )
        if isinstance(link, h5py.SoftLink):
            if n_links >= MAX_LINKS:
                raise FormatError(f"has circular links from {name!r}")
            node = find_node(node, link.path, n_links + 1)
        else:
            node = node[part]
    return node


def find_group(group: Node, name: str) -> Node | None:
    """Return the group at a path below a group; None if there is none."""
    node = find_node(group, name)
    return node if isinstance(node, HDF.load().Group) else None


def find_dataset(group: Node, name: str, taken: set[str] | None = None) -> Dataset | None:
    """Return the dataset at a path below a group, checked to be in the file; None if none.

    `taken` receives its path in the file, for `unread_datasets`.

    Raises
    ------
    FormatError
        As `find_node`; or if its data is in other files, or larger than the file can contain.
    """
    node = find_node(group, name)
    if not isinstance(node, HDF.load().Dataset):
        return None
    if taken is not None:
        taken.add(node.name)
    _check_storage(node)
    return node


def unread_datasets(group: Node, taken: Container[str]) -> list[str]:
    """Return the paths below a group of the datasets that are not among those taken."""
    nodes: list[tuple[str, Node]] = []
    group.visititems(lambda *named_node: nodes.append(named_node))
    dataset = HDF.load().Dataset
    return [name for name, node in nodes if isinstance(node, dataset) and node.name not in taken]


def require_dataset(group: Node, name: str, taken: set[str] | None = None) -> Dataset:
    """Return the dataset at a path below a group; as `find_dataset`, but it must exist.

    Raises
    ------
    FormatError
        As `find_dataset`, or if there is none.
    """
    if (dataset := find_dataset(group, name, taken)) is None:
        raise FormatError(f"has no dataset {group.name.rstrip('/')}/{name}")
    return dataset


def read_rows(dataset: Dataset, start: int, count: int) -> npt.NDArray[Any]:
    """Read `count` rows of a dataset from row `start` on, in native byte order.

    Raises
    ------
    FormatError
        If the dataset does not have them.
    """
    n_rows = dataset.shape[0] if dataset.shape else 0
    if not 0 <= start <= start + count <= n_rows:
        raise FormatError(
            f"dataset {dataset.name} has {counted(n_rows, 'row')}; {count} from row {start} on "
            "are needed"
        )
    return native(dataset[start : start + count])


def read_all(dataset: Dataset) -> npt.NDArray[Any]:
    """Read a whole dataset, in native byte order; text as a numpy string array."""
    if HDF.load().check_string_dtype(dataset.dtype) is not None:
        return np.asarray(dataset.asstr(errors="replace")[()]).astype(np.str_)
    return native(np.asarray(dataset[()]))


def write_array(group: Node, name: str, array: npt.NDArray[Any]) -> None:
    """Write an array as a dataset; text as variable-length UTF-8."""
    if array.dtype.kind == "U":
        encoded = np.array(
            [text.encode("utf-8", "replace") for text in array.ravel().tolist()], dtype=object
        )
        text_type = HDF.load().string_dtype()
        group.create_dataset(name, data=encoded.reshape(array.shape), dtype=text_type)
    else:
        group.create_dataset(name, data=array)


def _check_storage(dataset: Dataset) -> None:
    name = f"dataset {dataset.name}"
    if dataset.external or dataset.is_virtual:
        raise FormatError(f"{name} is in other files, which are not read")
    if dataset.dtype.kind not in "iufSO" or dataset.shape is None:
        raise FormatError(f"{name} has type {dataset.dtype}; numbers and text are supported")
    if dataset.dtype.kind == "O" and HDF.load().check_string_dtype(dataset.dtype) is None:
        raise FormatError(f"{name} contains lists; numbers and text are supported")
    file_bytes = Path(dataset.file.filename).stat().st_size
    n_bytes = math.prod(dataset.shape) * dataset.dtype.itemsize
    if n_bytes > MAX_RATIO * min(dataset.id.get_storage_size(), file_bytes):
        raise FormatError(
            f"{name} declares {n_bytes} bytes of shape {dataset.shape}, more than the file contains"
        )
    chunk_bytes = math.prod(dataset.chunks or (0,)) * dataset.dtype.itemsize
    if chunk_bytes > max(MAX_RATIO * file_bytes, SMALL_BYTES):
        raise FormatError(f"{name} has chunks of {chunk_bytes} bytes, more than the file contains")


def describe_track(dataset: Dataset, name: str, track: TrackSource) -> None:
    """Write name, domain, kind and unit of a track as attributes of its dataset."""
    texts = {"name": name, "domain": str(track.domain), "kind": str(track.kind)}
    texts |= {"unit": track.unit} if track.unit else {}
    for key, text in texts.items():
        dataset.attrs[key] = text.encode("utf-8", "replace").decode().replace("\0", "_")


def read_text_attribute(dataset: Dataset, name: str) -> str:
    """Return a text attribute of a dataset; empty if there is none."""
    value: Any = dataset.attrs.get(name, "")
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value if isinstance(value, str) else ""


def read_unit(dataset: Dataset) -> str:
    """Return the unit of a dataset; empty if there is none."""
    return next(filter(None, (read_text_attribute(dataset, name) for name in UNIT_NAMES)), "")


class DeferredErrorFile(io.RawIOBase):
    """A file that accepts all writes; `check` raises the first error of the disk.

    Parameters
    ----------
    file : io.FileIO
        Open for reading and writing.
    """

    def __init__(self, file: io.FileIO) -> None:
        self._file = file
        self._offset = 0
        self._refused_writes: list[tuple[int, bytes]] = []
        self._error: OSError | None = None

    def check(self) -> None:
        """Raise the error of the first failed write, if any.

        Raises
        ------
        OSError
        """
        if self._error is not None:
            raise self._error

    def write(self, data: memoryview) -> int:  # type: ignore[override]
        """Write bytes; keep those that the disk refuses."""
        remaining = memoryview(data).cast("B")
        n_bytes = len(remaining)
        try:
            self._file.seek(self._offset)
            while remaining:
                n_written = self._file.write(remaining) or 0
                remaining, self._offset = remaining[n_written:], self._offset + n_written
        except OSError as error:
            self._error = self._error or error
            self._refused_writes.append((self._offset, bytes(remaining)))
            self._offset += len(remaining)
        return n_bytes

    def readinto(self, buffer: memoryview) -> int:  # type: ignore[override]
        """Read back written bytes; zeros where nothing was written."""
        self._file.seek(self._offset)
        n_read = self._file.readinto(buffer) or 0
        buffer[n_read:] = bytes(len(buffer) - n_read)
        for start, data in self._refused_writes:
            stop = self._offset + len(buffer)
            first, last = max(start, self._offset), min(start + len(data), stop)
            if first < last:
                part = data[first - start : last - start]
                buffer[first - self._offset : last - self._offset] = part
        self._offset += len(buffer)
        return len(buffer)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move to an offset in the file."""
        ends = [start + len(data) for start, data in self._refused_writes]
        size = max([self._file.seek(0, io.SEEK_END), *ends])
        origins = {io.SEEK_SET: 0, io.SEEK_CUR: self._offset, io.SEEK_END: size}
        self._offset = offset + origins[whence]
        return self._offset

    def tell(self) -> int:
        """Return the offset in the file."""
        return self._offset

    def truncate(self, size: int | None = None) -> int:
        """Truncate the file, or extend it by zeros."""
        length = self._offset if size is None else size
        try:
            self._file.truncate(length)
        except OSError as error:
            self._error = self._error or error
        return length


class HdfOutput:
    """An HDF5 file that is being written.

    Attributes
    ----------
    root : Node
        Its root group.
    """

    def __init__(self, root: Node, file: DeferredErrorFile) -> None:
        self.root = root
        self._file = file

    def frames(self, stream: FrameStream) -> Iterator[tuple[int, Vertices]]:
        """Yield number and positions of each frame; raises when the disk is full."""
        for numbered_frame in enumerate(stream.frames()):
            self._file.check()
            yield numbered_frame

    def blocks(self, track: TrackSource) -> Iterator[tuple[int, Values]]:
        """Yield blocks of frames of a track's values, with the number of their first frame."""
        for block in track_blocks(track):
            self._file.check()
            yield block


@contextmanager
def hdf_output(path: Path) -> Iterator[HdfOutput]:
    """Create an HDF5 file that is complete when the block ends.

    Raises
    ------
    FormatError
        If h5py is not installed.
    OSError
        If writing fails, for example because the disk is full.
    """
    h5py = HDF.load()
    with path.open("w+b", buffering=0) as raw:
        file = DeferredErrorFile(raw)
        with h5py.File(file, "w") as root:
            yield HdfOutput(root, file)
        file.check()
