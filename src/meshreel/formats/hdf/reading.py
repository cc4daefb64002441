"""Safe reading of untrusted HDF5 files: no external files, no allocation beyond the file size."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, MeshReelError
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import HDF

MAX_RATIO = 1100  # deflate compresses by at most 1032:1
MAX_LINKS = 64
SMALL_BYTES = 1 << 20  # chunk size that is allowed for any file

Node = Any  # a group or a dataset of h5py, which has no types
Dataset = Any


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
        return h5py.File(path, "r")["/"]


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


def find_dataset(group: Node, name: str) -> Dataset | None:
    """Return the dataset at a path below a group, checked to be in the file; None if none.

    Raises
    ------
    FormatError
        As `find_node`; or if its data is in other files, or larger than the file can contain.
    """
    node = find_node(group, name)
    if not isinstance(node, HDF.load().Dataset):
        return None
    _check_stored(node)
    return node


def require_dataset(group: Node, name: str) -> Dataset:
    """Return the dataset at a path below a group; as `find_dataset`, but it must exist.

    Raises
    ------
    FormatError
        As `find_dataset`, or if there is none.
    """
    if (found := find_dataset(group, name)) is None:
        raise FormatError(f"has no dataset {group.name.rstrip('/')}/{name}")
    return found


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
    return _native(dataset[start : start + count])


def read_all(dataset: Dataset) -> npt.NDArray[Any]:
    """Read a whole dataset, in native byte order; text as a numpy string array."""
    if HDF.load().check_string_dtype(dataset.dtype) is not None:
        return np.asarray(dataset.asstr(errors="replace")[()]).astype(np.str_)
    return _native(np.asarray(dataset[()]))


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


def _native(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return array.astype(array.dtype.newbyteorder("="), copy=False)


def _check_stored(dataset: Dataset) -> None:
    where = f"dataset {dataset.name}"
    if dataset.external or dataset.is_virtual:
        raise FormatError(f"{where} is in other files, which are not read")
    if dataset.dtype.kind not in "iufSO" or dataset.shape is None:
        raise FormatError(f"{where} has type {dataset.dtype}; numbers and text are supported")
    if dataset.dtype.kind == "O" and HDF.load().check_string_dtype(dataset.dtype) is None:
        raise FormatError(f"{where} contains lists; numbers and text are supported")
    file_bytes = Path(dataset.file.filename).stat().st_size
    size = math.prod(dataset.shape) * dataset.dtype.itemsize
    if size > MAX_RATIO * min(dataset.id.get_storage_size(), file_bytes):
        raise FormatError(
            f"{where} declares {size} bytes of shape {dataset.shape}, more than the file contains"
        )
    chunk = math.prod(dataset.chunks or (0,)) * dataset.dtype.itemsize
    if chunk > max(MAX_RATIO * file_bytes, SMALL_BYTES):
        raise FormatError(f"{where} has chunks of {chunk} bytes, more than the file contains")
