"""PCA textures played as shaders do, to see how far the frames are off."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.pca.texture import read_header, section_offsets
from meshreel.formats.vat.textures import Texels

Singles = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class PlayedPca:
    """How far frames are off.

    Attributes
    ----------
    errors : float64 array of shape (T,)
        Of the furthest vertex of each frame, in model units.
    angle_deg : float, optional
        Mean angle between normals of all frames; None without normals.
    """

    errors: npt.NDArray[np.float64]
    angle_deg: float | None


def play_pca(
    texels: Texels, motion: Motion, rest: Singles, rest_normals: Singles | None
) -> PlayedPca:
    """The errors of a texture as it was read from its file.

    Parameters
    ----------
    texels : uint8 array of shape (height, width, 4)
    motion : Motion
    rest : float32 array of shape (V, 3)
        As the file of the mesh has it.
    rest_normals : float32 array of shape (V, 3), optional
        The same; None if normals do not move.
    """
    header = read_header(texels)
    offsets = section_offsets(texels, header, header.positions, motion.n_verts)
    errors = np.zeros(motion.n_frames)
    for frame in range(motion.n_frames):
        played = (rest + offsets.frame(frame)).astype(np.float64)
        errors[frame] = np.linalg.norm(played - motion.positions(frame), axis=1).max()
    if rest_normals is None:
        return PlayedPca(errors, None)
    turns = section_offsets(texels, header, header.normals, motion.n_verts)
    angles_deg = np.zeros(motion.n_frames)
    for frame, units in enumerate(motion.normals()):
        found = (rest_normals + turns.frame(frame)).astype(np.float64)
        found /= np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-30)
        chords = np.linalg.norm(found - units, axis=1)
        angles_deg[frame] = np.degrees(2 * np.arcsin(np.clip(chords / 2, 0, 1))).mean()
    return PlayedPca(errors, float(angles_deg.mean()))
