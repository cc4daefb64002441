"""Names, types and arrays of the Alembic library."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.scenes.parts import unique_name
from meshreel.model.surface import Domain
from meshreel.runtime.extras import ALEMBIC, IMATH

UNNAMED = "mesh"

NOT_IN_NAMES, NOT_IN_METADATA, NOT_IN_TEXTS = "/\0", ";=\0", "\0"
"""Reserved characters of path components, of metadata, and of strings.

The Alembic library aborts the process if the name of texture coordinates contains a reserved
character of metadata.
"""

SCOPES = {
    Domain.VERTEX: "kVertexScope",
    Domain.FACE: "kUniformScope",
    Domain.CORNER: "kFacevaryingScope",
}
NUMBER_TYPES = {
    "u1": ("Uchar", "Uchar"), "i1": ("Int32", "Int32"), "i2": ("Int32", "Int32"),
    "u2": ("Int32", "Int32"), "i4": ("Int32", "Int32"), "u4": ("UInt32", "Uint32"),
    "i8": ("Int64", "Int32"), "u8": ("UInt64", "Int32"), "f4": ("Float", "Float"),
    "f8": ("Double", "Double"),
}  # fmt: skip
"""The library's names of scalar property types and their array types, by NumPy type."""

PropertyType = tuple[str, str, int]
"""The library's names of a property type and of its array type, and the array extent."""


def clean(text: str, reserved: str) -> str:
    """Return the text with ``_`` in place of reserved characters and lone surrogates."""
    return "".join(
        "_" if char in reserved or "\ud800" <= char <= "\udfff" else char for char in text
    )


def clean_unique_name(name: str, used: set[str]) -> str:
    """Return the name without slashes, made unique, and add it to `used`."""
    return unique_name(clean(name, NOT_IN_NAMES) or UNNAMED, used)


def param_sample(
    kind: str, array: str, domain: Domain, values: Any, indices: npt.NDArray[Any] | None = None
) -> Any:
    """Return a sample of a geometry parameter: values of a domain, and indices if any."""
    sample = getattr(ALEMBIC.load("AbcGeom"), f"O{kind}GeomParamSample")()
    sample.setVals(library_array(array, values))
    if indices is not None:
        sample.setIndices(library_array("Uint32", indices))
    sample.setScope(scope_of(domain))
    return sample


def scope_of(domain: Domain) -> Any:
    """Return the library's geometry scope of a domain."""
    return getattr(ALEMBIC.load("AbcGeom").GeometryScope, SCOPES[domain])


def library_array(kind: str, values: Any) -> Any:
    """Return a copy of values as an array of the Alembic library.

    Parameters
    ----------
    kind : str
        The library's name of the type: "V3f", "V2f", "C3f", "C4f", "Int32", "Uint32", "Float",
        "Double", "Uchar" or "String".
    values : array of shape (N,) or (N, C), or sequence of str
        Of a NumPy type that the kind can hold.
    """
    imath = load_imath()
    if kind == "String":
        texts = imath.StringArray(len(values))
        for number, text in enumerate(values):
            texts[number] = text
        return texts
    if kind in ("C3f", "C4f"):
        colors = getattr(imath, f"{kind}Array")(len(values))
        for channel, column in zip("rgba", values.T, strict=False):
            np.asarray(getattr(colors, channel))[:] = column  # writes through a view
        return colors
    values = values if kind[0] == "V" else values.ravel()
    if kind == "Uint32":  # has no buffer interface; float64 is exact
        return imath.UnsignedIntArray(library_array("Double", values.astype(np.float64)))
    if kind == "Uchar":
        bytes_array = imath.UnsignedCharArray(len(values))
        np.asarray(bytes_array)[:] = values
        return bytes_array
    if kind == "Int32":  # 64-bit tracks have small values here
        kind, values = "Int", values.astype(np.int32, copy=False)
    return getattr(imath, f"{kind}ArrayFromBuffer")(np.ascontiguousarray(values))


def load_imath() -> Any:
    """Return the library's module of vectors and arrays.

    Raises
    ------
    FormatError
        If it is not installed, or another package has the same name.
    """
    imath = IMATH.load()
    if not hasattr(imath, "V3fArrayFromBuffer"):
        raise FormatError(
            "another package shadows the module imath of alembic3d; remove it with: "
            "pip uninstall imath; then: pip install --force-reinstall alembic3d"
        )
    return imath
