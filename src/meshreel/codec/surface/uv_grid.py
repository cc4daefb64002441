"""Quantisation of texture coordinates on a grid.

The quantisation step is the width of a texture divided by 2^bits, whatever the range of
coordinates: coordinates stay in their tile, borders of tiles and matching seams are preserved, and
quantising again changes nothing.
"""

import numpy as np

from meshreel.arrays import Integers
from meshreel.codec.entropy.multiples import LARGEST
from meshreel.errors import InvalidInputError
from meshreel.model.surface import Attribute, Kind, Surface


def is_quantized(attribute: Attribute) -> bool:
    """Whether an attribute is among the texture coordinates that are quantised."""
    return attribute.kind is Kind.UV and attribute.values.dtype.kind == "f"


def has_uvs(surface: Surface) -> bool:
    """Whether a surface has texture coordinates to quantise."""
    return any(map(is_quantized, surface.attributes))


def check_uvs(surface: Surface, bits: int) -> None:
    """Nothing if a surface has texture coordinates and all of them can be quantised.

    Raises
    ------
    InvalidInputError
        If it has none, or as `uv_integers`.
    """
    if not has_uvs(surface):
        raise InvalidInputError(
            "there are no texture coordinates for uv_bits= to quantise; leave it out"
        )
    for one in filter(is_quantized, surface.attributes):
        uv_integers(one, bits)


def uv_integers(attribute: Attribute, bits: int) -> Integers:
    """Integers of the nearest grid values, of shape (N, C).

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
            "which cannot be quantised; leave uv_bits= out, or choose others with attributes="
        )
    furthest = float(np.abs(values).max(initial=0))
    if furthest > LARGEST >> bits:
        raise InvalidInputError(
            f"texture coordinates {attribute.name!r} reach to {furthest:g}; {bits} bits reach to "
            f"{LARGEST >> bits}; use fewer bits"
        )
    return np.rint(np.ldexp(values, bits)).astype(np.int64)
