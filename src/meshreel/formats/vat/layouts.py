"""The layout of OpenVAT's add-on for Blender, as the shaders of its players expect it.

The texture consists of blocks: row `f` of the first block has the first vertices of frame `f`, as
many as fit a row; blocks of further vertices follow, and normals fill the lower half of the
texture. Texels are offsets from the first frame in Blender's axes, normalized per axis from Min (0)
to Max (1).
"""

from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.vat.textures import Texels

Number = TypeVar("Number", np.float32, np.float64)


def to_blender(vectors: npt.NDArray[Number]) -> npt.NDArray[Number]:
    """Return vectors of shape (..., 3), from glTF's axes to Blender's."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([x, -z, y], axis=-1)


def from_blender(vectors: npt.NDArray[Number]) -> npt.NDArray[Number]:
    """Return vectors of shape (..., 3), from Blender's axes to glTF's."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([x, z, -y], axis=-1)


@dataclass(frozen=True)
class MeshSpace:
    """The axes and units of the vertices in a mesh file, as the shader expects them."""

    scale: float = 1.0
    """Units of the file per glTF unit."""
    rotation: tuple[float, float, float, float] | None = None
    """The quaternion x y z w of the node, which rotates vertices in Blender's axes to those of
    glTF; None if they are in glTF's axes.
    """


GLTF_SPACE = MeshSpace()
BLENDER_FBX_SPACE = MeshSpace(0.01, (-(0.5**0.5), 0.0, 0.0, 0.5**0.5))
"""The space of FBX files from Blender: centimeters and z up, corrected by rotation and scale of the
node."""

WIDTHS = (8192, 16384)
"""Texture widths that desktop GPUs support; the larger one only if the first is too tall."""

MAX_HEIGHT = 16384


@dataclass(frozen=True)
class TexelGrid:
    """Arrangement of the texels of all vertices and frames in a texture.

    The frames of a row of vertices are adjacent.
    """

    n_verts: int
    n_frames: int
    width: int
    """Texels per row; a frame with more vertices takes several rows."""
    n_halves: int = 1
    """Number of such grids in the texture, stacked vertically."""

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


N_CHANNELS = 3
"""Channels of offsets and of normals."""


@dataclass(frozen=True, eq=False)
class Remap:
    """The mapping between offsets and texel values."""

    low: Singles
    high: Singles
    """float32 arrays of shape (3,). Offsets at values 0 and 1, in Blender's axes."""

    @classmethod
    def of(cls, offset_box: tuple[Floats, Floats]) -> "Remap":
        """Return the remap between two corners of the box of all offsets, in float32."""
        corners = [to_blender(corner) for corner in offset_box]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        return cls(_float32_below(low), -_float32_below(-high))

    def values(self, offsets: Floats) -> Floats:
        """Return the texel values of offsets of shape (V, 3)."""
        low, high = self.low.astype(np.float64), self.high.astype(np.float64)
        span = np.where(high > low, high - low, 1.0)
        return np.clip((to_blender(offsets) - low) / span, 0.0, 1.0)

    def offsets(self, values: Floats) -> Singles:
        """Return the offsets that a shader computes from samples, of shape (V, 3), in float32."""
        return from_blender(self.low + values.astype(np.float32) * (self.high - self.low))


def normal_values(normals: Floats) -> Floats:
    """Return unit normals scaled to 0 to 1, for every texel type."""
    return np.clip((to_blender(normals) + 1) / 2, 0.0, 1.0)


def normals_of(values: Floats) -> Floats:
    """Return the normals that a shader computes from samples, of any length."""
    return from_blender(2 * values - 1)


def remap_document(fps: float, grid: TexelGrid, remap: Remap, name: str) -> Any:
    """Return the JSON that OpenVAT's importers read; its frames count from 1."""
    fps = round(fps) if fps == round(fps) else fps
    animation = {
        "startFrame": 1, "endFrame": grid.n_frames, "framerate": fps, "looping": True,
    }  # fmt: skip
    return {
        "os-remap": {
            "Min": remap.low.tolist(),
            "Max": remap.high.tolist(),
            "Frames": grid.n_frames,
        },
        "animations": {name: animation},
        "meshreel": {
            "rows": grid.n_rows,
            "width": grid.width,
            "height": grid.height,
            "normals": "lower half" if grid.n_halves == 2 else "none",
        },
    }


def _float32_below(values: Floats) -> Singles:
    """Return the largest float32 values that are not above the given values."""
    nearest = values.astype(np.float32)
    return np.where(nearest > values, np.nextafter(nearest, np.float32(-np.inf)), nearest)
