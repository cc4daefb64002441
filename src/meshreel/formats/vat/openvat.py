"""OpenVAT's layout, as its Blender add-on writes it and its shaders for Godot and Unity read it.

Rows of frames: row `f` of the first block has the first vertices in frame `f`, as many as a row
has; the blocks of further vertices follow, and normals fill the lower half of the texture. Texels
are offsets from the first frame in Blender's axes, from Min (0) to Max (1) of each axis.
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
    """OpenVAT's layout, for shaders that expect vertices in this space; see `PlainLayout`."""

    mesh_space: MeshSpace = GLTF_SPACE
    normal_channels: int = 3
    normal_half: int = 1
    farthest: float = math.inf

    def names(self, stem: str, ending: str, *, normals: bool) -> FileNames:
        """The names of files; normals are in the texture of positions."""
        return FileNames(f"{stem}.glb", f"{stem}_vat{ending}", f"{stem}-remap_info.json")

    def grid(self, n_verts: int, n_frames: int, *, normals: bool) -> TexelGrid:
        """Blocks of all frames, one after the other; as many again for normals."""
        return fit_grid(n_verts, n_frames, frame_by_frame=False, n_halves=2 if normals else 1)

    def remap(self, motion: Motion, grid: TexelGrid, found: TexelType) -> Remap:
        """From the least to the greatest offset along each axis, in float32 as shaders have it."""
        low, high = BLENDER.turn_box(*motion.offset_box())
        return Remap(BLENDER, _float32_below(low), -_float32_below(-high))

    def normal_values(self, normals: Floats, found: TexelType) -> Floats:
        """From 0 to 1, whatever the type."""
        return np.clip((BLENDER.turn(normals) + 1) / 2, 0.0, 1.0)

    def normals(self, values: Floats, found: TexelType) -> Floats:
        """From -1 to 1."""
        return BLENDER.turn_back(2 * values - 1)

    def corners(self, remap: Remap) -> tuple[Singles, Singles] | None:
        """None: shaders read the JSON."""
        return None

    def document(self, motion: Motion, grid: TexelGrid, remap: Remap, name: str) -> Any:
        """What OpenVAT's importers read; frames of an animation count from 1."""
        whole = round(motion.fps) if motion.fps == round(motion.fps) else motion.fps
        animation = {
            "startFrame": 1, "endFrame": grid.n_frames, "framerate": whole, "looping": True,
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
    """The next float32 that is not above each value."""
    near = values.astype(np.float32)
    return np.where(near > values, np.nextafter(near, np.float32(-np.inf)), near)
