"""Encoding of offsets as textures, in the smallest texel type that meets an error bound."""

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
    """How offsets are stored in texels."""

    texels: TexelType
    remap: Remap


def smallest_encoding(
    motion: Motion, layout: PlainLayout, grid: TexelGrid, types: Sequence[TexelType], bound: float
) -> Encoding:
    """Return the first encoding of the given types that meets the error bound.

    Parameters
    ----------
    types : sequence of TexelType
    bound : float
        Largest distance of a vertex from its position, in model units.

    Raises
    ------
    InvalidInputError
        If no type meets the bound.
    """
    min_error = np.inf
    for texel_type in types:
        encoding = Encoding(texel_type, layout.remap(motion, grid, texel_type))
        min_error = min(min_error, _largest_error(motion, encoding, bound))
        if min_error <= bound:
            return encoding
    advice = ", or choose textures 'exr'" if texel_type.is_integer else ""
    raise InvalidInputError(
        f"the error with {texel_type.title} is {min_error:.4g} model units; at most {bound:.4g} "
        f"are allowed; allow a larger error (max_error){advice}"
    )


def fill_textures(
    motion: Motion, layout: PlainLayout, grid: TexelGrid, encoding: Encoding, *, normals: bool
) -> list[Texels]:
    """Return the texture of offsets and, if the layout separates them, the texture of normals."""
    packed = normals and layout.normal_half > 0
    images = [grid.image(3, encoding.texels.dtype)]
    if normals and not packed:
        images.append(grid.image(layout.normal_channels, encoding.texels.dtype))
    for frame, offsets in enumerate(motion.offsets()):
        grid.write_frame(images[0], frame, encoding.texels.texels(encoding.remap.values(offsets)))
    if normals:
        for frame, units in enumerate(motion.normals()):
            values = layout.normal_values(units, encoding.texels)
            texels = encoding.texels.texels(values)
            grid.write_frame(images[-1], frame, texels, layout.normal_half)
    return images


def _largest_error(motion: Motion, encoding: Encoding, bound: float) -> float:
    """Return the largest error, or that of the frames up to the first one beyond the bound."""
    largest = 0.0
    low, high = encoding.texels.range
    for frame, offsets in enumerate(motion.offsets()):
        values = encoding.remap.values(offsets)
        if values.min() < low or values.max() > high:
            return np.inf
        sampled = encoding.texels.values(encoding.texels.texels(values))
        errors = motion.playback_errors(frame, encoding.remap.offsets(sampled))
        largest = max(largest, float(errors.max()))
        if largest > bound:
            break
    return largest
