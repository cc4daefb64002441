"""Where the texel of a vertex is in each frame, and the texture coordinates that lead there."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.formats.vat.textures import Texels

WIDTHS = (8192, 16384)
"""Of textures that every GPU of a desktop holds; wider ones only where the first is too tall."""

MOST_ROWS = 16384


@dataclass(frozen=True)
class TexelGrid:
    """Texels of vertices, in rows that wrap where a texture is as wide as it may be.

    Attributes
    ----------
    n_verts, n_frames : int
    width : int
        Texels in a row.
    frame_by_frame : bool
        Whether the rows of a frame follow one another, as Labs has it; else the frames of a row
        do, as OpenVAT has it.
    n_halves : int, default 1
        How many such grids are in the texture, one below the other.
    """

    n_verts: int
    n_frames: int
    width: int
    frame_by_frame: bool
    n_halves: int = 1

    @property
    def n_rows(self) -> int:
        """Rows of texels that a frame takes."""
        return -(-self.n_verts // self.width)

    @property
    def height(self) -> int:
        """Rows of the whole texture."""
        return self.n_halves * self.n_rows * self.n_frames

    def image(self, n_channels: int, dtype: npt.DTypeLike) -> Texels:
        """A texture of zeros."""
        return np.zeros((self.height, self.width, n_channels), dtype)

    def put(self, image: Texels, frame: int, texels: Texels, half: int = 0) -> None:
        """Set the texels of all vertices in a frame, of shape (V, C)."""
        rows = np.zeros((self.n_rows * self.width, texels.shape[1]), texels.dtype)
        rows[: self.n_verts] = texels
        image[self._rows(frame, half)] = rows.reshape(self.n_rows, self.width, -1)

    def take(self, image: Texels, frame: int, half: int = 0) -> Texels:
        """The texels of all vertices in a frame, of shape (V, C)."""
        rows = image[self._rows(frame, half)]
        return rows.reshape(-1, image.shape[2])[: self.n_verts]

    def texcoords(self) -> npt.NDArray[np.float64]:
        """The middles of the texels of the first frame, of shape (V, 2); v is 0 at the bottom."""
        row, column = np.divmod(np.arange(self.n_verts), self.width)
        first = self._rows(0, 0)[row]
        u = (column + 0.5) / self.width
        return np.stack([u, 1 - (first + 0.5) / self.height], axis=1)

    def _rows(self, frame: int, half: int) -> npt.NDArray[np.int64]:
        """The rows of a frame, from the top."""
        rows = np.arange(self.n_rows)
        own = frame * self.n_rows + rows if self.frame_by_frame else rows * self.n_frames + frame
        return own + half * self.n_rows * self.n_frames


def fit_grid(n_verts: int, n_frames: int, *, frame_by_frame: bool, n_halves: int = 1) -> TexelGrid:
    """The grid for so many vertices and frames; one row for each frame, as long as they fit.

    Raises
    ------
    InvalidInputError
        If a texture would be larger than GPUs hold them.
    """
    for widest in WIDTHS:
        n_rows = -(-n_verts // widest)
        width = -(-n_verts // n_rows)  # all rows about as full
        grid = TexelGrid(n_verts, n_frames, width, frame_by_frame, n_halves)
        if grid.height <= WIDTHS[0]:
            return grid
    if grid.height > MOST_ROWS:
        raise InvalidInputError(
            f"{n_frames} frames of {n_verts} vertices need textures of {grid.width} x "
            f"{grid.height} texels; GPUs hold {MOST_ROWS} rows; take fewer frames (--frames), or "
            "fewer vertices"
        )
    return grid
