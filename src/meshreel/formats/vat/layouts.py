"""The layout of OpenVAT's add-on for Blender, as the shaders of its players expect it.

The texture consists of blocks: row `f` of the first block has the first vertices of frame `f`, as
many as fit a row; blocks of further vertices follow, and normals fill the lower half of the
texture. Texels are offsets from the first frame in Blender's axes, normalized per axis from Min (0)
to Max (1).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.arrays import Floats, Singles
from meshreel.formats.vat.axes import from_blender, to_blender
from meshreel.formats.vat.grid import TexelGrid
from meshreel.formats.vat.motion import Motion

N_CHANNELS = 3
"""Channels of offsets and of normals."""


@dataclass(frozen=True, eq=False)
class Remap:
    """The mapping between offsets and texel values.

    Attributes
    ----------
    low, high : float32 arrays of shape (3,)
        Offsets at values 0 and 1, in Blender's axes.
    """

    low: Singles
    high: Singles

    @classmethod
    def of(cls, motion: Motion) -> "Remap":
        """Return the remap between the smallest and largest offset per axis, in float32."""
        corners = [to_blender(corner) for corner in motion.offset_box()]
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


def remap_document(motion: Motion, grid: TexelGrid, remap: Remap, name: str) -> Any:
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
