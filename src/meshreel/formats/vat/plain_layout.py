"""What layouts of plain vertex animation textures decide, and share."""

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
    mesh, positions, data : str
    normals : str, optional
        None where no texture of their own has them.
    """

    mesh: str
    positions: str
    data: str
    normals: str | None = None


@dataclass(frozen=True, eq=False)
class Remap:
    """How texels stand for offsets, in the axes and units of a program.

    Attributes
    ----------
    axes : Axes
    low, high : float32 arrays of shape (3,)
        What 0 and 1 stand for, where texels do not hold offsets themselves.
    is_raw : bool
        Whether texels hold offsets themselves.
    """

    axes: Axes
    low: Singles
    high: Singles
    is_raw: bool = False

    def values(self, offsets: Floats) -> Floats:
        """What textures are to hold for offsets of shape (V, 3)."""
        turned = self.axes.scale * self.axes.turn(offsets)
        if self.is_raw:
            return turned
        low, high = self.low.astype(np.float64), self.high.astype(np.float64)
        span = np.where(high > low, high - low, 1.0)
        return np.clip((turned - low) / span, 0.0, 1.0)

    def offsets(self, values: Floats) -> Singles:
        """The offsets that a shader makes of what it samples, of shape (V, 3), in float32."""
        sampled = values.astype(np.float32)
        turned = sampled if self.is_raw else self.low + sampled * (self.high - self.low)
        return np.asarray(self.axes.turn_back(turned) / np.float32(self.axes.scale))


class PlainLayout(Protocol):
    """Names, places and meanings of texels, as the shaders of a program have them."""

    @property
    def normal_channels(self) -> int:
        """How many channels normals take."""

    @property
    def mesh_space(self) -> MeshSpace:
        """Where vertices are in the file of the mesh."""

    @property
    def farthest(self) -> float:
        """Where the mesh may be, in model units from the origin along an axis."""

    @property
    def normal_half(self) -> int:
        """1 where normals are below the offsets, in the same texture; 0 where in one of theirs."""

    def names(self, stem: str, ending: str, *, normals: bool) -> FileNames:
        """The names of files, for textures of an ending."""

    def grid(self, n_verts: int, n_frames: int, *, normals: bool) -> TexelGrid:
        """Where texels are in each texture."""

    def remap(self, motion: Motion, grid: TexelGrid, found: TexelType) -> Remap:
        """How texels of a type stand for offsets.

        Raises
        ------
        InvalidInputError
            If programs could not read where the mesh is.
        """

    def normal_values(self, normals: Floats, found: TexelType) -> Floats:
        """What textures are to hold for unit normals of shape (V, 3)."""

    def normals(self, values: Floats, found: TexelType) -> Floats:
        """The normals that a shader makes of what it samples, of shape (V, 3), of any length."""

    def corners(self, remap: Remap) -> tuple[Singles, Singles] | None:
        """Corners of a box that the mesh is to fill, in our axes and units, if it is to."""

    def document(self, motion: Motion, grid: TexelGrid, remap: Remap, name: str) -> Any:
        """The JSON that tells programs of all this."""
