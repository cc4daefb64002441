"""HDF5 files that may be damaged or hostile: nothing outside of them, nothing larger than them."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.extras import HDF
from meshreel.runtime.counting import counted

MAX_RATIO = 1100  # deflate cannot do better than 1032 : 1
MAX_LINKS = 64
SMALL_BYTES = 1 << 20  # a chunk may take so much however small the file is

Node = Any  # a group or a dataset of h5py, which has no types
Dataset = Any


@contextmanager
def hdf_errors() -> Iterator[None]:
    """Within it, whatever goes wrong in the HDF5 library is a `FormatError`."""
    try:
        yield
    except MeshReelError:
        raise
    # On damaged bytes the library raises nearly every type of exception there is.
    except Exception as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(f"is not an HDF5 file, or is damaged ({reason[:200]})") from error


def open_hdf(path: Path) -> Node:
    """The root group of a file; it is closed when nothing refers to it any more.

    Raises
    ------
    FormatError
        If it is no HDF5 file, or h5py is not installed.
    """
    h5py = HDF.load()
    with hdf_errors():
        return h5py.File(path, "r")["/"]


def find_node(group: Node, name: str, n_links: int = 0) -> Node | None:
    """A group or dataset at a path below a group; None if there is none.

    Raises
    ------
    FormatError
        If a link leads to another file, or links lead in circles.
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
            raise FormatError(f"{part!r} is in another file ({link.filename}), which is not read")
        if isinstance(link, h5py.SoftLink):
            if n_links >= MAX_LINKS:
                raise FormatError(f"links lead from {name!r} in circles")
            node = find_node(node, link.path, n_links + 1)
        else:
            node = node[part]
    return node


def find_group(group: Node, name: str) -> Node | None:
    """A group at a path below a group; None if there is none."""
    node = find_node(group, name)
    return node if isinstance(node, HDF.load().Group) else None


def find_dataset(group: Node, name: str) -> Dataset | None:
    """A dataset at a path below a group, known to be stored in the file; None if there is none.

    Raises
    ------
    FormatError
        As `find_node`; if its numbers are in other files, or more than the file can hold.
    """
    node = find_node(group, name)
    if not isinstance(node, HDF.load().Dataset):
        return None
    _check_stored(node)
    return node


def require_dataset(group: Node, name: str) -> Dataset:
    """As `find_dataset`, of one that must be there.

    Raises
    ------
    FormatError
        If it is not.
    """
    if (found := find_dataset(group, name)) is None:
        raise FormatError(f"has no dataset {group.name.rstrip('/')}/{name}")
    return found


def read_rows(dataset: Dataset, start: int, count: int) -> npt.NDArray[Any]:
    """So many rows of a dataset from a start on, in native byte order.

    Raises
    ------
    FormatError
        If it does not have them.
    """
    n_rows = dataset.shape[0] if dataset.shape else 0
    if not 0 <= start <= start + count <= n_rows:
        raise FormatError(
            f"dataset {dataset.name} has {counted(n_rows, 'row')}; {count} from row {start} on "
            "are spoken of"
        )
    return _native(dataset[start : start + count])


def read_all(dataset: Dataset) -> npt.NDArray[Any]:
    """All of a dataset, in native byte order; text as numpy text."""
    if HDF.load().check_string_dtype(dataset.dtype) is not None:
        return np.asarray(dataset.asstr(errors="replace")[()]).astype(np.str_)
    return _native(np.asarray(dataset[()]))


def write_array(group: Node, name: str, array: npt.NDArray[Any]) -> None:
    """Write an array as a dataset; text as UTF-8 of variable length."""
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
        raise FormatError(f"{where} holds {dataset.dtype}; numbers and text are read")
    if dataset.dtype.kind == "O" and HDF.load().check_string_dtype(dataset.dtype) is None:
        raise FormatError(f"{where} holds lists; numbers and text are read")
    file_bytes = Path(dataset.file.filename).stat().st_size
    size = math.prod(dataset.shape) * dataset.dtype.itemsize
    if size > MAX_RATIO * min(dataset.id.get_storage_size(), file_bytes):
        raise FormatError(
            f"{where} declares {size} bytes of shape {dataset.shape}, more than the file holds"
        )
    chunk = math.prod(dataset.chunks or (0,)) * dataset.dtype.itemsize
    if chunk > max(MAX_RATIO * file_bytes, SMALL_BYTES):
        raise FormatError(f"{where} is in chunks of {chunk} bytes, more than the file holds")
