"""Quantization of texture coordinates on a grid.

The quantization step is the width of a texture divided by 2^bits, for any range of coordinates:
coordinates stay in their tile, borders of tiles and matching seams are preserved, and quantizing
again changes nothing.
"""

import numpy as np

from meshreel.arrays import Integers
from meshreel.codec.entropy.tables import MAX_INTEGER
from meshreel.errors import InvalidInputError, Keyword
from meshreel.model.surface import Attribute, Kind, Surface


def is_quantized(attribute: Attribute) -> bool:
    """Whether an attribute has texture coordinates as floats."""
    return attribute.kind is Kind.UV and attribute.values.dtype.kind == "f"


def has_uvs(surface: Surface) -> bool:
    """Whether a surface has texture coordinates to quantize."""
    return any(map(is_quantized, surface.attributes))


def check_uvs(surface: Surface, bits: int) -> None:
    """Check that a surface has texture coordinates and that all of them can be quantized.

    Raises
    ------
    InvalidInputError
        If it has none, or as in `uv_integers`.
    """
    if not has_uvs(surface):
        raise InvalidInputError(
            "there are no texture coordinates to quantize; omit ", Keyword("uv_bits")
        )
    for attribute in filter(is_quantized, surface.attributes):
        uv_integers(attribute, bits)


def uv_integers(attribute: Attribute, bits: int) -> Integers:
    """Round texture coordinates to integers of the grid, of shape (N, C).

    Raises
    ------
    InvalidInputError
        If a coordinate is not finite, or too large for this many bits.
    """
    values = attribute.values.astype(np.float64)
    if not np.isfinite(values).all():
        row = int(np.argmin(np.isfinite(values).all(axis=1)))
        raise InvalidInputError(
            f"texture coordinates {attribute.name!r} have {values[row].tolist()} in row {row}, "
            "which cannot be quantized; omit ",
            Keyword("uv_bits"),
            ", or select others with ",
            Keyword("attributes"),
        )
    largest = float(np.abs(values).max(initial=0))
    if largest > MAX_INTEGER >> bits:
        raise InvalidInputError(
            f"texture coordinates {attribute.name!r} reach to {largest:g}; {bits} bits reach to "
            f"{MAX_INTEGER >> bits}; use fewer bits"
        )
    return np.rint(np.ldexp(values, bits)).astype(np.int64)
