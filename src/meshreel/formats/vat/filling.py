"""Textures of a motion: the smallest texels that keep an error bound, and all of them in place."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from meshreel.errors import InvalidInputError
from meshreel.formats.vat.grid import TexelGrid
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.plain_layout import PlainLayout, Remap
from meshreel.formats.vat.textures import Texels, TexelType


@dataclass(frozen=True, eq=False)
class Encoding:
    """How offsets become texels.

    Attributes
    ----------
    texels : TexelType
    remap : Remap
    """

    texels: TexelType
    remap: Remap


def smallest_encoding(
    motion: Motion, layout: PlainLayout, grid: TexelGrid, types: Sequence[TexelType], bound: float
) -> Encoding:
    """The first of some types that brings all vertices within a bound.

    Parameters
    ----------
    motion : Motion
    layout : PlainLayout
    grid : TexelGrid
    types : sequence of TexelType
    bound : float
        In model units.

    Raises
    ------
    InvalidInputError
        If none does.
    """
    least = np.inf
    for found in types:
        encoding = Encoding(found, layout.remap(motion, grid, found))
        least = min(least, _largest_error(motion, encoding, bound))
        if least <= bound:
            return encoding
    advice = ", or take textures 'exr'" if found.is_integer else ""
    raise InvalidInputError(
        f"{found.title} is off by {least:.4g} model units, more than the {bound:.4g} that may be; "
        f"allow a larger error (max_error){advice}"
    )


def fill_textures(
    motion: Motion, layout: PlainLayout, grid: TexelGrid, encoding: Encoding, *, normals: bool
) -> list[Texels]:
    """The texture of offsets, and that of normals where they have their own."""
    packed = normals and layout.normal_half > 0
    images = [grid.image(3, encoding.texels.dtype)]
    if normals and not packed:
        images.append(grid.image(layout.normal_channels, encoding.texels.dtype))
    for frame, offsets in enumerate(motion.offsets()):
        grid.put(images[0], frame, encoding.texels.texels(encoding.remap.values(offsets)))
    if normals:
        for frame, units in enumerate(motion.normals()):
            values = layout.normal_values(units, encoding.texels)
            texels = encoding.texels.texels(values)
            grid.put(images[-1], frame, texels, layout.normal_half)
    return images


def _largest_error(motion: Motion, encoding: Encoding, enough: float) -> float:
    """The largest error of all frames; of the first ones only if it is above what is enough."""
    largest = 0.0
    low, high = encoding.texels.range
    for frame, offsets in enumerate(motion.offsets()):
        values = encoding.remap.values(offsets)
        if values.min() < low or values.max() > high:
            return np.inf
        sampled = encoding.texels.values(encoding.texels.texels(values))
        far = motion.distances(frame, encoding.remap.offsets(sampled))
        largest = max(largest, float(far.max()))
        if largest > enough:
            break
    return largest
