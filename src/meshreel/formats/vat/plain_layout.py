"""The interface of layouts of plain vertex animation textures, and what they share."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from meshreel.arrays import Floats, Singles
from meshreel.formats.vat.axes import Axes, MeshSpace
from meshreel.formats.vat.grid import TexelGrid
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.textures import TexelType


@dataclass(frozen=True)
class FileNames:
    """Names of the files of a folder.

    Attributes
    ----------
    normals : str, optional
        None if normals have no separate texture.
    """

    mesh: str
    positions: str
    data: str
    normals: str | None = None


@dataclass(frozen=True, eq=False)
class Remap:
    """The mapping between offsets and texel values, in the axes and units of a program.

    Attributes
    ----------
    low, high : float32 arrays of shape (3,)
        Offsets at values 0 and 1, unless texels are raw offsets.
    is_raw : bool
        Whether texels are raw offsets.
    """

    axes: Axes
    low: Singles
    high: Singles
    is_raw: bool = False

    def values(self, offsets: Floats) -> Floats:
        """Return the texel values of offsets of shape (V, 3)."""
        converted = self.axes.scale * self.axes.convert(offsets)
        if self.is_raw:
            return converted
        low, high = self.low.astype(np.float64), self.high.astype(np.float64)
        span = np.where(high > low, high - low, 1.0)
        return np.clip((converted - low) / span, 0.0, 1.0)

    def offsets(self, values: Floats) -> Singles:
        """Return the offsets that a shader computes from samples, of shape (V, 3), in float32."""
        sampled = values.astype(np.float32)
        converted = sampled if self.is_raw else self.low + sampled * (self.high - self.low)
        return np.asarray(self.axes.convert_back(converted) / np.float32(self.axes.scale))


class PlainLayout(Protocol):
    """File names, arrangement and meaning of texels, as the shader of a program expects them."""

    @property
    def normal_channels(self) -> int:
        """Number of channels of normals."""

    @property
    def mesh_space(self) -> MeshSpace:
        """The axes and units of the vertices in the mesh file."""

    @property
    def max_distance(self) -> float:
        """Limit of the coordinates of the mesh, in model units."""

    @property
    def normal_half(self) -> int:
        """1 if normals are in the lower half of the offset texture; 0 if they have their own."""

    def names(self, stem: str, extension: str, *, normals: bool) -> FileNames:
        """Return the file names, for a file extension of textures."""

    def grid(self, n_verts: int, n_frames: int, *, normals: bool) -> TexelGrid:
        """Return the arrangement of texels in each texture."""

    def remap(self, motion: Motion, grid: TexelGrid, texel_type: TexelType) -> Remap:
        """Return the mapping between offsets and values of a texel type.

        Raises
        ------
        InvalidInputError
            If shaders could not decode the bounding box of the mesh.
        """

    def normal_values(self, normals: Floats, texel_type: TexelType) -> Floats:
        """Return the texel values of unit normals of shape (V, 3)."""

    def normals(self, values: Floats, texel_type: TexelType) -> Floats:
        """Return the normals that a shader computes from samples, of shape (V, 3), any length."""

    def corners(self, remap: Remap) -> tuple[Singles, Singles] | None:
        """Return the corners of the box that the mesh must fill, in glTF axes and units, if any."""

    def document(self, motion: Motion, grid: TexelGrid, remap: Remap, name: str) -> Any:
        """Return the JSON that describes the files."""
