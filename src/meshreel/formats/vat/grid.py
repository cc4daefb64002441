"""The texel of each vertex and frame in a texture, and the UVs that point to it."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.vat.textures import Texels

WIDTHS = (8192, 16384)
"""Texture widths that desktop GPUs support; the larger one only if the first is too tall."""

MAX_HEIGHT = 16384


@dataclass(frozen=True)
class TexelGrid:
    """Arrangement of the texels of all vertices and frames in a texture.

    The frames of a row of vertices are adjacent.

    Attributes
    ----------
    width : int
        Texels per row; a frame with more vertices takes several rows.
    n_halves : int, default 1
        Number of such grids in the texture, stacked vertically.
    """

    n_verts: int
    n_frames: int
    width: int
    n_halves: int = 1

    @property
    def n_rows(self) -> int:
        """Rows of texels per frame."""
        return -(-self.n_verts // self.width)

    @property
    def height(self) -> int:
        """Rows of the whole texture."""
        return self.n_halves * self.n_rows * self.n_frames

    def image(self, n_channels: int, dtype: npt.DTypeLike) -> Texels:
        """Return a texture of zeros."""
        return np.zeros((self.height, self.width, n_channels), dtype)

    def write_frame(self, image: Texels, frame: int, texels: Texels, half: int = 0) -> None:
        """Write the texels of all vertices in a frame, of shape (V, C)."""
        rows = np.zeros((self.n_rows * self.width, texels.shape[1]), texels.dtype)
        rows[: self.n_verts] = texels
        image[self._rows(frame, half)] = rows.reshape(self.n_rows, self.width, -1)

    def texel_uvs(self) -> npt.NDArray[np.float64]:
        """Return the UVs of the texel centers of the first frame, of shape (V, 2), v upward."""
        row, column = np.divmod(np.arange(self.n_verts), self.width)
        first = self._rows(0, 0)[row]
        u = (column + 0.5) / self.width
        return np.stack([u, 1 - (first + 0.5) / self.height], axis=1)

    def _rows(self, frame: int, half: int) -> npt.NDArray[np.int64]:
        """Return the row indices of a frame, from the top."""
        return (np.arange(self.n_rows) + half * self.n_rows) * self.n_frames + frame


def fit_grid(n_verts: int, n_frames: int, *, n_halves: int = 1) -> TexelGrid:
    """Return the smallest grid for these counts, with one row per frame if the width allows it.

    Raises
    ------
    InvalidInputError
        If the texture would exceed the size that GPUs support.
    """
    for max_width in WIDTHS:
        n_rows = -(-n_verts // max_width)
        width = -(-n_verts // n_rows)  # balance the rows
        grid = TexelGrid(n_verts, n_frames, width, n_halves)
        if grid.height <= WIDTHS[0]:
            return grid
    if grid.height > MAX_HEIGHT:
        raise InvalidInputError(
            f"{n_frames} frames of {n_verts} vertices need textures of {grid.width} x "
            f"{grid.height} texels; GPUs support {MAX_HEIGHT} rows; use fewer frames (",
            Keyword("frames"),
            "), or fewer vertices",
        )
    return grid
