"""Conversion of NumPy arrays to the array types of the Alembic library."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.runtime.extras import IMATH


def library_array(kind: str, values: npt.NDArray[Any]) -> Any:
    """Return a copy of an array of shape (N,) or (N, C) as an array of the Alembic library.

    Parameters
    ----------
    kind : str
        The library's name of the type: "V3f", "V2f", "C3f", "C4f", "Int32", "Uint32", "Float",
        "Double" or "Uchar".
    values : array
        Of the NumPy type that corresponds to the kind.
    """
    imath = _imath()
    if kind == "Uint32":  # has no buffer interface; float64 is exact
        return imath.UnsignedIntArray(library_array("Double", values.astype(np.float64)))
    if kind in ("C3f", "C4f"):
        return _colors(getattr(imath, f"{kind}Array")(len(values)), values)
    if kind == "Uchar":
        bytes_array = imath.UnsignedCharArray(len(values))
        np.asarray(bytes_array)[:] = values
        return bytes_array
    name = {"Int32": "Int"}.get(kind, kind)
    return getattr(imath, f"{name}ArrayFromBuffer")(np.ascontiguousarray(values))


def text_array(texts: Sequence[str]) -> Any:
    """Return strings as a string array of the library."""
    array = _imath().StringArray(len(texts))
    for number, text in enumerate(texts):
        array[number] = text
    return array


def library_vector(values: npt.NDArray[np.float64]) -> Any:
    """Return a vector of shape (3,) as a vector of the library."""
    return _imath().V3d(*values.tolist())


def _colors(array: Any, values: npt.NDArray[np.float32]) -> Any:
    for channel, column in zip("rgba", values.T, strict=False):
        np.asarray(getattr(array, channel))[:] = column  # writes through a view
    return array


def _imath() -> Any:
    imath = IMATH.load()
    if not hasattr(imath, "V3fArrayFromBuffer"):
        raise FormatError(
            "another package shadows the module imath of alembic3d; remove it with: "
            "pip uninstall imath; then: pip install --force-reinstall alembic3d"
        )
    return imath
