"""Layouts of vertex animation textures, as the shaders of programs expect them.

OpenVAT's add-on for Blender writes blocks: row `f` of the first block has the first vertices of
frame `f`, as many as fit a row; blocks of further vertices follow, and normals fill the lower half
of the texture. Texels are offsets from the first frame in Blender's axes, normalized per axis from
Min (0) to Max (1).

In the soft-body layout of SideFX Labs Vertex Animation Textures 3.0 all rows of a frame are
adjacent, and the frames follow in order. Texels of EXR files are offsets from the first frame;
those of PNG files are normalized to a bounding box. The decimals of the box also carry parameters
for the shaders: see `encode_box`. A second texture stores normals, as quaternions that rotate the
y axis to the normal.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.arrays import Floats, Singles
from meshreel.errors import InvalidInputError
from meshreel.formats.vat.axes import BLENDER, GLTF_SPACE, UNREAL, Axes, MeshSpace
from meshreel.formats.vat.grid import TexelGrid, fit_grid
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.textures import TexelType

MAX_FRAME_ROWS = 1980
"""Largest number of rows per frame that the box of Labs can encode."""

RAW_CODE = 0.5
"""Added to the largest z in tenths, to mark texels that are raw offsets."""

TENTHS = 10.0


@dataclass(frozen=True)
class FileNames:
    """Names of the files of a folder; `normals` is None if they have no texture of their own."""

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


@dataclass(frozen=True)
class OpenVat:
    """OpenVAT's layout.

    Attributes
    ----------
    mesh_space : MeshSpace
        The axes and units of the vertices in the mesh file.
    normal_channels : int
        Number of channels of normals.
    normal_half : int
        1 if normals are in the lower half of the offset texture; 0 if they have their own.
    max_distance : float
        Limit of the coordinates of the mesh, in model units.
    """

    mesh_space: MeshSpace = GLTF_SPACE
    normal_channels: int = 3
    normal_half: int = 1
    max_distance: float = math.inf

    def names(self, stem: str, extension: str, *, normals: bool) -> FileNames:
        """Return the file names, for a file extension of textures."""
        return FileNames(f"{stem}.glb", f"{stem}_vat{extension}", f"{stem}-remap_info.json")

    def grid(self, n_verts: int, n_frames: int, *, normals: bool) -> TexelGrid:
        """Return a grid of blocks of all frames, twice as high with normals."""
        return fit_grid(n_verts, n_frames, frame_by_frame=False, n_halves=2 if normals else 1)

    def remap(self, motion: Motion, grid: TexelGrid, texel_type: TexelType) -> Remap:
        """Return the remap between the smallest and largest offset per axis, in float32."""
        low, high = BLENDER.convert_box(*motion.offset_box())
        return Remap(BLENDER, _float32_below(low), -_float32_below(-high))

    def normal_values(self, normals: Floats, texel_type: TexelType) -> Floats:
        """Return unit normals scaled to 0 to 1, for every texel type."""
        return np.clip((BLENDER.convert(normals) + 1) / 2, 0.0, 1.0)

    def normals(self, values: Floats, texel_type: TexelType) -> Floats:
        """Return the normals that a shader computes from samples, of any length."""
        return BLENDER.convert_back(2 * values - 1)

    def corners(self, remap: Remap) -> tuple[Singles, Singles] | None:
        """Return None: shaders read the bounds from the JSON."""
        return None

    def document(self, motion: Motion, grid: TexelGrid, remap: Remap, name: str) -> Any:
        """Return the JSON that OpenVAT's importers read; its frames count from 1."""
        fps = round(motion.fps) if motion.fps == round(motion.fps) else motion.fps
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
    near = values.astype(np.float32)
    return np.where(near > values, np.nextafter(near, np.float32(-np.inf)), near)


@dataclass(frozen=True)
class LabsSoft:
    """The soft-body layout of Labs, for a program with these axes; attributes as in `OpenVat`."""

    axes: Axes
    normal_channels: int = 4
    normal_half: int = 0
    mesh_space: MeshSpace = GLTF_SPACE
    max_distance: float = 4000.0  # in tenths, float32 has 8 fractional bits left there

    def names(self, stem: str, extension: str, *, normals: bool) -> FileNames:
        """Return the file names; rotations have a separate texture."""
        return FileNames(
            f"{stem}_mesh.glb",
            f"{stem}_pos{extension}",
            f"{stem}_data.json",
            f"{stem}_rot{extension}" if normals else None,
        )

    def grid(self, n_verts: int, n_frames: int, *, normals: bool) -> TexelGrid:
        """Return a grid with adjacent frames.

        A single frame of several rows is stored twice, since shaders hide vertices whose texel is
        in the last tenth of the first frame.
        """
        grid = fit_grid(n_verts, n_frames, frame_by_frame=True)
        if n_frames == 1 and grid.n_rows > 1:
            grid = fit_grid(n_verts, 2, frame_by_frame=True)
        if grid.n_rows > MAX_FRAME_ROWS:
            raise InvalidInputError(
                f"a frame needs {grid.n_rows} rows of texels; this layout supports up to "
                f"{MAX_FRAME_ROWS}; use fewer vertices, or choose layout 'openvat'"
            )
        return grid

    def remap(self, motion: Motion, grid: TexelGrid, texel_type: TexelType) -> Remap:
        """Return the remap to the box of all positions and, for integer texels, of all offsets."""
        low, high = motion.bounding_box()
        is_raw = not texel_type.is_integer
        if not is_raw:
            offset_low, offset_high = motion.offset_box()
            low, high = np.minimum(low, offset_low), np.maximum(high, offset_high)
        is_unreal = self.axes is UNREAL
        box = encode_box(low, high, grid.n_rows, is_raw=is_raw, encode_rows=is_unreal)
        low, high = self.axes.convert_box(*(corner.astype(np.float64) for corner in box))
        return Remap(self.axes, low.astype(np.float32), high.astype(np.float32), is_raw)

    def normal_values(self, normals: Floats, texel_type: TexelType) -> Floats:
        """Return quaternions x y z w: unscaled in EXR files, from 0 to 1 in PNG files."""
        rotations = self.axes.convert_rotations(_rotations_of(normals))
        return np.clip((rotations + 1) / 2, 0.0, 1.0) if texel_type.is_integer else rotations

    def normals(self, values: Floats, texel_type: TexelType) -> Floats:
        """Return the up axis rotated by the sampled quaternions."""
        rotations = 2 * values - 1 if texel_type.is_integer else values
        up = self.axes.convert(np.array([0.0, 1.0, 0.0]))
        axis, w = rotations[:, :3], rotations[:, 3:]
        return self.axes.convert_back(up + 2 * np.cross(axis, np.cross(axis, up) + w * up))

    def corners(self, remap: Remap) -> tuple[Singles, Singles] | None:
        """Return the corners of the box, which Unreal's shader reads from the mesh bounds."""
        low, high = (
            self.axes.convert_back(corner.astype(np.float64) / self.axes.scale)
            for corner in (remap.low, remap.high)
        )
        return np.minimum(low, high).astype(np.float32), np.maximum(low, high).astype(np.float32)

    def document(self, motion: Motion, grid: TexelGrid, remap: Remap, name: str) -> Any:
        """Return the JSON of Labs' exporter, which browser players read as well."""
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


def encode_box(
    low: Floats, high: Floats, n_rows: int, *, is_raw: bool, encode_rows: bool
) -> tuple[Singles, Singles]:
    """Return an enclosing box whose decimals, in tenths of a unit, encode shader parameters.

    In tenths, the smallest x and z and the largest x are integers, which means that the texture is
    not padded, and so is the largest y, which encodes nothing. The decimals of the largest z encode
    whether texels are raw offsets and the hundreds of the rows per frame, and those of the smallest
    y the remaining rows.

    Parameters
    ----------
    low, high : float64 arrays of shape (3,)
    n_rows : int
        Rows per frame.
    is_raw : bool
        Whether texels are raw offsets.
    encode_rows : bool
        Whether shaders read the number of rows from the box.

    Raises
    ------
    InvalidInputError
        If float32 cannot represent these decimals so far from the origin.
    """
    floor, ceiling = np.floor(low * TENTHS), np.ceil(high * TENTHS)
    ceiling = np.maximum(ceiling, floor + 1)
    hundreds, remainder = divmod(n_rows, 100)
    skipped = (hundreds > 9) + (hundreds > 18)  # multiples of 0.1 would decode as no hundreds
    code = (RAW_CODE if is_raw else 0.0) + 0.01 * (hundreds + skipped)

    def decodes_remainder(tenths: np.float32) -> bool:
        return not encode_rows or round(100 * float(np.ceil(tenths) - tenths)) == remainder

    def decodes_code(tenths: np.float32) -> bool:
        decoded = float(tenths - np.floor(tenths))
        is_raw_decoded = (decoded >= RAW_CODE) == is_raw
        return is_raw_decoded and (not encode_rows or abs(decoded - code) < 0.004)

    coded_low = [_decodable_coordinate(tenths, -1, _is_integer) for tenths in floor]
    coded_high = [_decodable_coordinate(tenths, 1, _is_integer) for tenths in ceiling]
    coded_low[1] = _decodable_coordinate(floor[1] - 0.01 * remainder, -1, decodes_remainder)
    coded_high[2] = _decodable_coordinate(ceiling[2] + code, 1, decodes_code)
    return np.array(coded_low, np.float32), np.array(coded_high, np.float32)


def _decodable_coordinate(
    tenths: float, direction: int, is_valid: Callable[[np.float32], bool]
) -> np.float32:
    """Return a coordinate near `tenths`, up to one unit outward, that shaders decode correctly.

    Shaders multiply by ten in float32, where most tenths are not exact.
    """
    for n_tenths in range(11):
        nearest = np.float32((tenths + n_tenths * direction) / TENTHS)
        neighbors = [np.nextafter(nearest, np.float32(end)) for end in (-np.inf, np.inf)]
        for candidate in map(np.float32, (nearest, *neighbors)):
            if is_valid(np.float32(candidate * np.float32(TENTHS))):
                return candidate
    raise InvalidInputError(
        f"shaders of this layout read the decimals of the bounding box, and float32 has too few "
        f"at {tenths / TENTHS:.6g}; scale the mesh down, or choose layout 'openvat'"
    )


def _is_integer(tenths: np.float32) -> bool:
    return bool(tenths == np.rint(tenths))


def _rotations_of(normals: Floats) -> Floats:
    """Return the shortest rotations from the y axis to unit normals, as quaternions x y z w."""
    x, y, z = normals.T
    quaternions: Floats = np.stack([z, np.zeros_like(x), -x, 1 + y], axis=1)
    quaternions[y <= -1 + 1e-9] = (1.0, 0.0, 0.0, 0.0)  # 180 degrees, about any axis
    return np.asarray(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))


Layout = OpenVat | LabsSoft
