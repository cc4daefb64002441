"""Textures played as shaders do, to see how far the frames are off."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.formats.vat.filling import Encoding
from meshreel.formats.vat.grid import TexelGrid
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.plain_layout import PlainLayout
from meshreel.formats.vat.textures import Texels


@dataclass(frozen=True, eq=False)
class Played:
    """How far frames are off.

    Attributes
    ----------
    errors : float array of shape (T,)
        Of the furthest vertex of each frame, in model units.
    angles_deg : float array of shape (T,), optional
        Largest angle between normals of each frame; None without normals.
    """

    errors: npt.NDArray[np.float64]
    angles_deg: npt.NDArray[np.float64] | None


def play(
    images: list[Texels], motion: Motion, layout: PlainLayout, grid: TexelGrid, encoding: Encoding,
    *, normals: bool,
) -> Played:  # fmt: skip
    """The errors of textures as they were read from their files.

    Parameters
    ----------
    images : list of arrays
        The texture of offsets, and that of normals where they have their own.
    motion : Motion
    layout : PlainLayout
    grid : TexelGrid
    encoding : Encoding
    normals : bool
    """
    errors = np.zeros(motion.n_frames)
    for frame in range(motion.n_frames):
        sampled = encoding.texels.values(grid.take(images[0], frame))
        errors[frame] = motion.distances(frame, encoding.remap.offsets(sampled)).max()
    if not normals:
        return Played(errors, None)
    angles_deg = np.zeros(motion.n_frames)
    for frame, units in enumerate(motion.normals()):
        sampled = encoding.texels.values(grid.take(images[-1], frame, layout.normal_half))
        found = layout.normals(sampled, encoding.texels)
        found /= np.linalg.norm(found, axis=1, keepdims=True)
        # The chord is exact where the cosine of a small angle is not.
        chords = np.linalg.norm(found - units, axis=1)
        angles_deg[frame] = np.degrees(2 * np.arcsin(np.clip(chords / 2, 0, 1))).max()
    return Played(errors, angles_deg)
