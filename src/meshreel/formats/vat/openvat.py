"""OpenVAT's layout, as written by its Blender add-on and read by its Godot and Unity shaders.

Row `f` of the first block has the first vertices of frame `f`, as many as fit a row; blocks of
further vertices follow, and normals fill the lower half of the texture. Texels are offsets from the
first frame in Blender's axes, normalized per axis from Min (0) to Max (1).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.arrays import Floats, Singles
from meshreel.formats.vat.axes import BLENDER, GLTF_SPACE, MeshSpace
from meshreel.formats.vat.grid import TexelGrid, fit_grid
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.plain_layout import FileNames, Remap
from meshreel.formats.vat.textures import TexelType


@dataclass(frozen=True)
class OpenVat:
    """OpenVAT's layout, for shaders that expect vertices in a certain space; see `PlainLayout`."""

    mesh_space: MeshSpace = GLTF_SPACE
    normal_channels: int = 3
    normal_half: int = 1
    max_distance: float = math.inf

    def names(self, stem: str, extension: str, *, normals: bool) -> FileNames:
        """Return the file names; normals share the texture of positions."""
        return FileNames(f"{stem}.glb", f"{stem}_vat{extension}", f"{stem}-remap_info.json")

    def grid(self, n_verts: int, n_frames: int, *, normals: bool) -> TexelGrid:
        """Return a grid of blocks of all frames, twice as high with normals."""
        return fit_grid(n_verts, n_frames, frame_by_frame=False, n_halves=2 if normals else 1)

    def remap(self, motion: Motion, grid: TexelGrid, texel_type: TexelType) -> Remap:
        """Return the remap between the smallest and largest offset per axis, in float32."""
        low, high = BLENDER.convert_box(*motion.offset_box())
        return Remap(BLENDER, _float32_below(low), -_float32_below(-high))

    def normal_values(self, normals: Floats, texel_type: TexelType) -> Floats:
        """Return normals scaled to 0 to 1, for every texel type."""
        return np.clip((BLENDER.convert(normals) + 1) / 2, 0.0, 1.0)

    def normals(self, values: Floats, texel_type: TexelType) -> Floats:
        """Return normals scaled to -1 to 1."""
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
