"""Textures as shaders read them: PNG of 8 and 16 bits, OpenEXR of half and full floats.

The first row of an array is the top row of the picture, as PNG and OpenEXR have it.
"""

import errno
import math
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.extras import OPEN_EXR, PNG
from meshreel.formats.notes import listed

Texels = npt.NDArray[Any]
"""Numbers as a texture holds them, of shape (height, width, channels)."""

CHANNELS = {3: "RGB", 4: "RGBA"}


class TexelType(Enum):
    """How a texture holds a number: its name, the type of an array of it, and the ending of files.

    Integers stand for 0 to 1, as shaders see them (UNORM); floats for themselves.
    """

    BITS_8 = ("8-bit PNG", "u1", ".png")
    BITS_16 = ("16-bit PNG", "u2", ".png")
    HALF = ("half-float EXR", "f2", ".exr")
    FLOAT = ("float EXR", "f4", ".exr")

    def __init__(self, title: str, dtype: str, ending: str) -> None:
        self.title, self.dtype, self.ending = title, np.dtype(dtype), ending

    @property
    def is_integer(self) -> bool:
        """Whether numbers from 0 to 1 are held in equal steps, and no others."""
        return self.dtype.kind == "u"

    @property
    def range(self) -> tuple[float, float]:
        """The least and the greatest number that is held."""
        return (0.0, 1.0) if self.is_integer else (-self._greatest, self._greatest)

    def texels(self, values: npt.NDArray[np.floating]) -> Texels:
        """The nearest texels to numbers of any shape.

        Raises
        ------
        InvalidInputError
            If a number is not finite, or out of the range of the type: 0 to 1 for integers, 65504
            on both sides of 0 for half floats.
        """
        given = np.asarray(values)
        if not np.isfinite(given).all():
            raise InvalidInputError("textures hold finite numbers; got others")
        low, high = self.range
        least, most = (float(given.min()), float(given.max())) if given.size else (low, high)
        if least < low or most > high:
            raise InvalidInputError(
                f"{self.title} holds numbers from {low:g} to {high:g}; got {least:g} to {most:g}"
            )
        if self.is_integer:
            return np.rint(given.astype(np.float64) * self._greatest).astype(self.dtype)
        return given.astype(self.dtype)

    def values(self, texels: Texels) -> npt.NDArray[np.float64]:
        """The numbers that a shader samples from texels of this type."""
        divisor = self._greatest if self.is_integer else 1.0
        return texels.astype(np.float64) / divisor

    def video_bytes(self, height: int, width: int) -> int:
        """What the texture takes on a GPU, in bytes: uncompressed, of four channels always.

        GPUs have no textures of three channels (but 8-bit ones in some drivers), and no mip maps
        are wanted here.
        """
        return height * width * 4 * self.dtype.itemsize

    @property
    def _greatest(self) -> float:
        info = np.iinfo(self.dtype) if self.is_integer else np.finfo(self.dtype)
        return float(info.max)


def texel_type_of(texels: Texels) -> TexelType:
    """The type that an array of texels is of.

    Raises
    ------
    InvalidInputError
        If textures hold no such numbers.
    """
    for one in TexelType:
        if one.dtype == texels.dtype:
            return one
    allowed = ", ".join(str(one.dtype) for one in TexelType)
    raise InvalidInputError(f"textures hold {allowed}; got {texels.dtype}")


def write_texture(path: Path, texels: Texels) -> int:
    """Write a texture, and give the size of its file in bytes.

    Parameters
    ----------
    path : Path
        Of whatever name; the type of the texels decides between PNG and OpenEXR.
    texels : array of shape (height, width, 3 or 4)
        Of a type that `TexelType` knows. PNG says nothing of colour spaces; engines are to be told
        that the numbers are no colours.

    Raises
    ------
    InvalidInputError
        If the array is of another shape or type.
    FormatError
        If the library is not installed.
    OSError
        If the file cannot be written.
    """
    found = texel_type_of(texels)
    if texels.ndim != 3 or texels.shape[2] not in CHANNELS or not math.prod(texels.shape):
        raise InvalidInputError(
            f"a texture has shape (height, width, 3 or 4), none 0; got {texels.shape}"
        )
    pixels = np.ascontiguousarray(texels)
    if found.is_integer:
        path.write_bytes(PNG.load().png_encode(pixels))
    else:
        library = OPEN_EXR.load()
        header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
        try:
            library.File(header, {CHANNELS[pixels.shape[2]]: pixels}).write(str(path))
        except RuntimeError as error:  # it says that of a full disk, too, with the name
            reason = str(error).removesuffix(".").rpartition(". ")[2]
            raise OSError(errno.EIO, reason, str(path)) from error
    return path.stat().st_size


def read_texture(path: Path) -> Texels:
    """The texels of a PNG or OpenEXR file, of shape (height, width, channels).

    Raises
    ------
    FormatError
        If the file is neither, damaged, or has other channels than RGB or RGBA, or the library is
        not installed.
    """
    with path.open("rb") as file:
        is_png = file.read(4) == b"\x89PNG"
    library = (PNG if is_png else OPEN_EXR).load()
    try:
        if is_png:
            texels = library.png_decode(path.read_bytes())
        else:
            with library.File(str(path)) as image:
                channels = image.channels()
                if len(channels) != 1:
                    raise ValueError(f"it has channels {listed(channels)}; RGB or RGBA is read")
                [texels] = [one.pixels for one in channels.values()]
    except (RuntimeError, ValueError) as error:  # what both libraries raise
        raise FormatError(f"{path} is no texture that can be read: {error}") from error
    if texels.ndim != 3 or texels.shape[2] not in CHANNELS:
        raise FormatError(f"{path} has texels of shape {texels.shape[2:]}; RGB or RGBA is read")
    return np.asarray(texels)
