"""The soft-body layout of SideFX Labs Vertex Animation Textures 3.0.

Row by row, a frame has all its vertices, and the next frame follows. Texels of EXR files are
offsets from the first frame; those of PNG files go from the least to the greatest coordinate of a
box. The box also tells shaders, in its decimals, what else they must know: see `coded_box`. A
second texture has the rotations, as quaternions, that turn the y axis to the normals.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.arrays import Floats, Singles
from meshreel.errors import InvalidInputError
from meshreel.formats.vat.axes import GLTF_SPACE, UNREAL, Axes, MeshSpace
from meshreel.formats.vat.grid import TexelGrid, fit_grid
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.plain_layout import FileNames, Remap
from meshreel.formats.vat.textures import TexelType

MOST_ROWS = 1980
"""Rows of a frame that a box can tell of."""

RAW_CODE = 0.5
"""In tenths: what is added to the greatest z where texels are offsets themselves."""

TENTHS = 10.0


@dataclass(frozen=True)
class LabsSoft:
    """Labs' layout for a program of these axes; see `PlainLayout`."""

    axes: Axes
    normal_channels: int = 4
    normal_half: int = 0
    mesh_space: MeshSpace = GLTF_SPACE
    farthest: float = 4000.0  # ten times it has 8 bits for decimals in float32

    def names(self, stem: str, ending: str, *, normals: bool) -> FileNames:
        """The names of files; rotations have a texture of their own."""
        return FileNames(
            f"{stem}_mesh.glb",
            f"{stem}_pos{ending}",
            f"{stem}_data.json",
            f"{stem}_rot{ending}" if normals else None,
        )

    def grid(self, n_verts: int, n_frames: int, *, normals: bool) -> TexelGrid:
        """Frames one after the other.

        A single frame of several rows stands there twice: shaders hide vertices whose texel is in
        the last tenth of the first frame of the texture.
        """
        grid = fit_grid(n_verts, n_frames, frame_by_frame=True)
        if n_frames == 1 and grid.n_rows > 1:
            grid = fit_grid(n_verts, 2, frame_by_frame=True)
        if grid.n_rows > MOST_ROWS:
            raise InvalidInputError(
                f"a frame takes {grid.n_rows} rows of texels; this layout has up to {MOST_ROWS}"
            )
        return grid

    def remap(self, motion: Motion, grid: TexelGrid, found: TexelType) -> Remap:
        """The box of all frames, and of all offsets where it says what texels stand for."""
        low, high = motion.box()
        is_raw = not found.is_integer
        if not is_raw:
            least, greatest = motion.offset_box()
            low, high = np.minimum(low, least), np.maximum(high, greatest)
        box = coded_box(low, high, grid.n_rows, is_raw=is_raw, rows_matter=self.axes is UNREAL)
        low, high = self.axes.turn_box(*(one.astype(np.float64) for one in box))
        return Remap(self.axes, low.astype(np.float32), high.astype(np.float32), is_raw)

    def normal_values(self, normals: Floats, found: TexelType) -> Floats:
        """Quaternions x y z w: themselves in EXR files, from 0 to 1 in PNG files."""
        turned = self.axes.turn_rotations(_rotations_of(normals))
        return np.clip((turned + 1) / 2, 0.0, 1.0) if found.is_integer else turned

    def normals(self, values: Floats, found: TexelType) -> Floats:
        """The axis that is upwards, turned."""
        turned = 2 * values - 1 if found.is_integer else values
        up = self.axes.turn(np.array([0.0, 1.0, 0.0]))
        axis, w = turned[:, :3], turned[:, 3:]
        return self.axes.turn_back(up + 2 * np.cross(axis, np.cross(axis, up) + w * up))

    def corners(self, remap: Remap) -> tuple[Singles, Singles] | None:
        """Those of the box: Unreal's shader reads it from the mesh."""
        low, high = (
            self.axes.turn_back(one.astype(np.float64) / self.axes.scale)
            for one in (remap.low, remap.high)
        )
        return np.minimum(low, high).astype(np.float32), np.maximum(low, high).astype(np.float32)

    def document(self, motion: Motion, grid: TexelGrid, remap: Remap, name: str) -> Any:
        """What Labs writes on request, with what players in browsers read beside it."""
        bounds = {
            f"Bound {which} {axis}": float(value)
            for which, corner in (("Max", remap.high), ("Min", remap.low))
            for axis, value in zip("XYZ", corner, strict=True)
        }
        return [
            {
                "Name": name,
                "Axis System": self.axes.name,
                **bounds,
                "Frame Count": grid.n_frames,
                "Houdini FPS": float(motion.fps),
                "Row Count": grid.n_rows,
                "Spare Color Texture": 0,
                "Two Position Textures": 0,
                "Use HDR Textures": int(remap.is_raw),
                "VAT Type": "Softbody",
                "Vertex Count": grid.n_verts,
            }
        ]


def coded_box(
    low: Floats, high: Floats, n_rows: int, *, is_raw: bool, rows_matter: bool
) -> tuple[Singles, Singles]:
    """Corners of a box around another, in tenths of a unit, whose decimals tell shaders more.

    In tenths, these are whole: the least x and z and the greatest x (so all of a texture is used:
    it is not padded) and the greatest y (nothing is told). The greatest z is whole, or its decimals
    say that texels are raw and how many hundred rows a frame has; those of the least y say how many
    rows there are beside.

    Parameters
    ----------
    low, high : float64 arrays of shape (3,)
    n_rows : int
        That a frame takes.
    is_raw : bool
        Whether texels hold offsets themselves.
    rows_matter : bool
        Whether shaders count on the rows, and not only on what is known otherwise.

    Raises
    ------
    InvalidInputError
        If float32 has no such decimals that far from the origin.
    """
    floor, ceiling = np.floor(low * TENTHS), np.ceil(high * TENTHS)
    ceiling = np.maximum(ceiling, floor + 1)
    hundreds, rest = divmod(n_rows, 100)
    skipped = (hundreds > 9) + (hundreds > 18)  # multiples of a tenth mean no hundreds at all
    code = (RAW_CODE if is_raw else 0.0) + 0.01 * (hundreds + skipped)

    def tells_rest(tenths: np.float32) -> bool:
        return not rows_matter or round(100 * float(np.ceil(tenths) - tenths)) == rest

    def tells_code(tenths: np.float32) -> bool:
        told = float(tenths - np.floor(tenths))
        return (told >= RAW_CODE) == is_raw and (not rows_matter or abs(told - code) < 0.004)

    coded_low = [_settled(one, -1, _is_whole) for one in floor]
    coded_high = [_settled(one, 1, _is_whole) for one in ceiling]
    coded_low[1] = _settled(floor[1] - 0.01 * rest, -1, tells_rest)
    coded_high[2] = _settled(ceiling[2] + code, 1, tells_code)
    return np.array(coded_low, np.float32), np.array(coded_high, np.float32)


def _settled(tenths: float, outwards: int, accepts: Callable[[np.float32], bool]) -> np.float32:
    """A coordinate of so many tenths, or up to a unit more, that shaders read as they are to.

    They multiply by ten in float32, where most tenths are not exact.
    """
    for more in range(11):
        near = np.float32((tenths + more * outwards) / TENTHS)
        beside = [np.nextafter(near, np.float32(way)) for way in (-np.inf, np.inf)]
        for found in map(np.float32, (near, *beside)):
            if accepts(np.float32(found * np.float32(TENTHS))):
                return found
    raise InvalidInputError(
        f"shaders of this layout read the decimals of a box around the mesh, and float32 has too "
        f"few at {tenths / TENTHS:.6g}; scale the mesh down, or take layout 'openvat'"
    )


def _is_whole(tenths: np.float32) -> bool:
    return bool(tenths == np.rint(tenths))


def _rotations_of(normals: Floats) -> Floats:
    """The shortest rotations from the y axis to unit normals, as quaternions x y z w."""
    x, y, z = normals.T
    found: Floats = np.stack([z, np.zeros_like(x), -x, 1 + y], axis=1)
    found[y <= -1 + 1e-9] = (1.0, 0.0, 0.0, 0.0)  # half a turn, about any axis
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))
