"""Textures as shaders read them: PNG with 8 and 16 bits, OpenEXR with half floats and floats.

The first row of an array is the top row of the image, as in PNG and OpenEXR.
"""

import errno
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.model.notes import listed
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

    def texels(self, values: npt.NDArray[np.floating]) -> Texels:
        """Return values from 0 to 1, of any shape, rounded to texels."""
        scaled = values * self._max
        return (np.rint(scaled) if self.is_integer else scaled).astype(self.dtype)

    def values(self, texels: Texels) -> npt.NDArray[np.float64]:
        """Return the values that a shader samples from texels of this type."""
        return texels.astype(np.float64) / self._max

    def video_bytes(self, height: int, width: int) -> int:
        """Return the size of the uncompressed texture on a GPU, in bytes.

        It always has four channels, since few GPUs support three, and no mipmaps.
        """
        return height * width * 4 * self.dtype.itemsize

    @property
    def _max(self) -> float:
        """The texel that stores the value 1."""
        return float(np.iinfo(self.dtype).max) if self.is_integer else 1.0


def write_texture(path: Path, texels: Texels) -> None:
    """Write a texture.

    Parameters
    ----------
    path : Path
        File to write; the type of the texels selects PNG or OpenEXR, not the name.
    texels : array of shape (height, width, 3 or 4)
        Their type is in `TexelType`. PNG declares no color space: import it as non-color data.

    Raises
    ------
    FormatError
        If the library is not installed.
    OSError
        If the file cannot be written.
    """
    pixels = np.ascontiguousarray(texels)
    if texels.dtype.kind == "u":
        path.write_bytes(PNG.load().png_encode(pixels))
    else:
        library = OPEN_EXR.load()
        header = {"compression": library.ZIP_COMPRESSION, "type": library.scanlineimage}
        try:
            library.File(header, {CHANNELS[pixels.shape[2]]: pixels}).write(str(path))
        except RuntimeError as error:  # also raised for a full disk, with the file name
            reason = str(error).removesuffix(".").rpartition(". ")[2]
            raise OSError(errno.EIO, reason, str(path)) from error


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
