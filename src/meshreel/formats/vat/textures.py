"""Textures as shaders read them: PNG with 8 and 16 bits, OpenEXR with half floats and floats.

The first row of an array is the top row of the image, as in PNG and OpenEXR.
"""

import errno
import math
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.notes import listed
from meshreel.runtime.extras import OPEN_EXR, PNG

Texels = npt.NDArray[Any]
"""Texels of shape (height, width, channels)."""

CHANNELS = {3: "RGB", 4: "RGBA"}


class TexelType(Enum):
    """Number types of textures: title, NumPy type, and file extension.

    Shaders read integers as 0 to 1 (UNORM), and floats unchanged.
    """

    BITS_8 = ("8-bit PNG", "u1", ".png")
    BITS_16 = ("16-bit PNG", "u2", ".png")
    HALF = ("half-float EXR", "f2", ".exr")
    FLOAT = ("float EXR", "f4", ".exr")

    def __init__(self, title: str, dtype: str, extension: str) -> None:
        self.title: str = title
        self.dtype: np.dtype[Any] = np.dtype(dtype)
        self.extension: str = extension

    @property
    def is_integer(self) -> bool:
        """Whether texels are integers, which shaders read as 0 to 1."""
        return self.dtype.kind == "u"

    @property
    def range(self) -> tuple[float, float]:
        """The smallest and the largest value."""
        return (0.0, 1.0) if self.is_integer else (-self._max, self._max)

    def texels(self, values: npt.NDArray[np.floating]) -> Texels:
        """Return values of any shape, rounded to texels.

        Raises
        ------
        InvalidInputError
            If a value is not finite or out of range: 0 to 1 for integers, up to 65504 in magnitude
            for half floats.
        """
        values = np.asarray(values)
        if not np.isfinite(values).all():
            raise InvalidInputError("texture values must be finite; got infinity or NaN")
        low, high = self.range
        smallest, largest = (
            (float(values.min()), float(values.max())) if values.size else (low, high)
        )
        if smallest < low or largest > high:
            raise InvalidInputError(
                f"{self.title} stores values from {low:g} to {high:g}; "
                f"got {smallest:g} to {largest:g}"
            )
        if self.is_integer:
            return np.rint(values.astype(np.float64) * self._max).astype(self.dtype)
        return values.astype(self.dtype)

    def values(self, texels: Texels) -> npt.NDArray[np.float64]:
        """Return the values that a shader samples from texels of this type."""
        divisor = self._max if self.is_integer else 1.0
        return texels.astype(np.float64) / divisor

    def video_bytes(self, height: int, width: int) -> int:
        """Return the size of the uncompressed texture on a GPU, in bytes.

        It always has four channels, since few GPUs support three, and no mipmaps.
        """
        return height * width * 4 * self.dtype.itemsize

    @property
    def _max(self) -> float:
        info = np.iinfo(self.dtype) if self.is_integer else np.finfo(self.dtype)
        return float(info.max)


def texel_type_of(texels: Texels) -> TexelType:
    """Return the type of an array of texels.

    Raises
    ------
    InvalidInputError
        If no texture has this number type.
    """
    for texel_type in TexelType:
        if texel_type.dtype == texels.dtype:
            return texel_type
    allowed = ", ".join(str(texel_type.dtype) for texel_type in TexelType)
    raise InvalidInputError(f"textures store {allowed}; got {texels.dtype}")


def write_texture(path: Path, texels: Texels) -> int:
    """Write a texture, and return the size of the file in bytes.

    Parameters
    ----------
    path : Path
        File to write; the type of the texels selects PNG or OpenEXR, not the name.
    texels : array of shape (height, width, 3 or 4)
        Of a type of `TexelType`. PNG does not declare a color space: import it as non-color data.

    Raises
    ------
    InvalidInputError
        If the array has another shape or type.
    FormatError
        If the library is not installed.
    OSError
        If the file cannot be written.
    """
    texel_type = texel_type_of(texels)
    if texels.ndim != 3 or texels.shape[2] not in CHANNELS or not math.prod(texels.shape):
        raise InvalidInputError(
            f"a texture has shape (height, width, 3 or 4), without a 0; got {texels.shape}"
        )
    pixels = np.ascontiguousarray(texels)
    if texel_type.is_integer:
        path.write_bytes(PNG.load().png_encode(pixels))
    else:
        library = OPEN_EXR.load()
        header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
        try:
            library.File(header, {CHANNELS[pixels.shape[2]]: pixels}).write(str(path))
        except RuntimeError as error:  # also raised for a full disk, with the file name
            reason = str(error).removesuffix(".").rpartition(". ")[2]
            raise OSError(errno.EIO, reason, str(path)) from error
    return path.stat().st_size


def read_texture(path: Path) -> Texels:
    """Return the texels of a PNG or OpenEXR file, of shape (height, width, channels).

    Raises
    ------
    FormatError
        If the file is not a PNG or OpenEXR file, is damaged, or has channels other than RGB or
        RGBA, or the library is not installed.
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
                    raise ValueError(f"it has channels {listed(channels)}; expected RGB or RGBA")
                [texels] = [channel.pixels for channel in channels.values()]
    except (RuntimeError, ValueError) as error:  # raised by both libraries
        raise FormatError(f"{path} cannot be read as a texture: {error}") from error
    if texels.ndim != 3 or texels.shape[2] not in CHANNELS:
        raise FormatError(f"{path} has texels of shape {texels.shape[2:]}; expected RGB or RGBA")
    return np.asarray(texels)
