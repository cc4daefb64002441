"""Writing PCA textures: a rest mesh, one texture, and a JSON file that describes them."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Singles
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.gltf.normal_targets import NormalChoice, wants_normals
from meshreel.formats.gltf.write import CREASED_REASON
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.axes import GLTF_SPACE
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.pca.digits import DigitRows, digit_rows
from meshreel.formats.vat.pca.search import fit_fields, fit_rms
from meshreel.formats.vat.pca.texture import (
    SIDES,
    make_texture,
    read_header,
    section_offsets,
    texel_coordinates,
)
from meshreel.formats.vat.preparation import BakeInput, note_error, prepare
from meshreel.formats.vat.textures import Texels, TexelType, read_texture, write_texture
from meshreel.runtime.counting import counted

NORMAL_ERROR = 0.1
"""Root mean square error of unit normals, about 3.5 degrees in the mean."""

KEPT = 0.999
"""Fraction of the bound for the fields; the rest is for float32 arithmetic of the GPU."""

NEXT_STEPS = "allow a larger error (--max-error), or use fewer frames (--frames)"


@dataclass(frozen=True, eq=False)
class PcaPlaybackErrors:
    """Errors of a texture as shaders play it.

    Attributes
    ----------
    errors : float64 array of shape (T,)
        Largest error of a vertex in each frame, in model units.
    angle_deg : float, optional
        Mean angle between original and played normals; None without normals.
    """

    errors: npt.NDArray[np.float64]
    angle_deg: float | None


@dataclass(frozen=True)
class PcaNames:
    """Names of the files of a folder."""

    mesh: str
    texture: str
    data: str

    @classmethod
    def of(cls, stem: str) -> "PcaNames":
        """Return the names of the files with this stem."""
        return cls(f"{stem}.glb", f"{stem}.png", f"{stem}.json")


@dataclass(frozen=True, eq=False)
class Rest:
    """The rest mesh: the mean over all frames.

    Attributes
    ----------
    positions, normals : float32 arrays of shape (V, 3)
        Normals are unit vectors.
    """

    positions: Singles
    normals: Singles

    @classmethod
    def of(cls, motion: Motion) -> "Rest":
        """Return the rest mesh of a motion."""
        positions, normals = np.zeros((2, motion.n_verts, 3))
        for frame, units in enumerate(motion.normals()):
            positions += motion.positions(frame) / motion.n_frames
            normals += units
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        first = next(motion.normals())
        units = np.where(lengths > 1e-6, normals / np.maximum(lengths, 1e-6), first)
        return cls(positions.astype(np.float32), units.astype(np.float32))


def write_pca(folder: Path, names: PcaNames, stream: FrameStream, options: WriteOptions) -> None:
    """Write the rest mesh, the texture and the JSON file.

    Raises
    ------
    InvalidInputError
        If the error bound cannot be met, or the texture would exceed the size limit of GPUs.
    """
    prepared = prepare(stream, options)
    motion, bound = prepared.motion, prepared.bound
    rest = Rest.of(motion)
    displacements = np.empty((motion.n_frames, 3 * motion.n_verts), np.float32)
    for frame in range(motion.n_frames):
        displacements[frame] = (motion.positions(frame) - rest.positions).ravel()
    fields = fit_fields(displacements, KEPT * bound, stream.progress)
    if fields is None:
        raise InvalidInputError(
            f"PCA textures cannot meet an error of {bound:.4g} model units, for which five digits "
            f"are too coarse; {NEXT_STEPS}, or choose another layout (--layout)"
        )
    normals = _normal_rows(motion, rest, options)
    texture = folder / names.texture
    write_texture(texture, make_texture(digit_rows(fields), normals, motion.n_verts))
    texels = read_texture(texture)
    rest_normals = None if normals is None else rest.normals
    playback = measure_pca_playback(texels, motion, rest.positions, rest_normals)
    if (worst := float(playback.errors.max())) > bound:
        raise InvalidInputError(
            f"the error of PCA textures is {worst:.4g} model units in the float32 of GPUs; at most "
            f"{bound:.4g} are allowed; {NEXT_STEPS}"
        )
    coordinates = texel_coordinates(texels, motion.n_verts)
    # v counts from the bottom in the mesh, and from the top in its file.
    uvs = coordinates * [1.0, -1.0] + [0.0, 1.0]
    prepared.mesh.write(
        folder / names.mesh,
        rest.positions,
        rest.normals,
        uvs,
        motion.placement,
        GLTF_SPACE,
        None,
        stream.notes,
    )
    document = _document(names, prepared, len(fields.n_digits), playback)
    text = json.dumps(document, ensure_ascii=False, indent=4)
    (folder / names.data).write_text(f"{text}\n", encoding="utf-8")
    _note_achieved(stream.notes, prepared, texels, len(fields.n_digits), playback)
    if normals is None and options.normals is None:
        stream.notes.append(f"no normals, so use flat shading: {CREASED_REASON}")


def _normal_rows(motion: Motion, rest: Rest, options: WriteOptions) -> DigitRows | None:
    """Return the digits of the animated normals, or None without them."""
    choice = {None: NormalChoice.SMOOTH, True: NormalChoice.ALL, False: NormalChoice.NONE}
    if not wants_normals(choice[options.normals], motion.positions(0), motion.faces):
        return None
    normal_offsets = np.empty((motion.n_frames, 3 * motion.n_verts), np.float32)
    for frame, units in enumerate(motion.normals()):
        normal_offsets[frame] = (units - rest.normals).ravel()
    return digit_rows(fit_rms(normal_offsets, NORMAL_ERROR))


def _document(
    names: PcaNames, prepared: BakeInput, n_fields: int, playback: PcaPlaybackErrors
) -> dict[str, Any]:
    """Return the JSON that describes the files."""
    low, high = prepared.motion.bounding_box()
    return {
        "layout": "meshreel pca 1",
        "mesh": names.mesh,
        "texture": names.texture,
        "frames": prepared.motion.n_frames,
        "fps": prepared.motion.fps,
        "vertices": prepared.motion.n_verts,
        "fields": n_fields,
        "normals": playback.angle_deg is not None,
        "largest_error": float(playback.errors.max()),
        "box": {"min": low.tolist(), "max": high.tolist()},
    }


def _note_achieved(
    notes: list[str], prepared: BakeInput, texels: Any, n_fields: int, playback: PcaPlaybackErrors
) -> None:
    height, width = texels.shape[:2]
    note_error(notes, prepared.budget, playback.errors, TexelType.BITS_8)
    video_bytes = TexelType.BITS_8.video_bytes(height, width)
    notes.append(
        f"{counted(n_fields, 'field')} in a texture of {width} x {height} texels: "
        f"{video_bytes / 1e6:.3g} MB of video memory"
    )
    if playback.angle_deg is not None:
        notes.append(f"the mean error of normals is {playback.angle_deg:.1f} degrees")
    if max(height, width) > SIDES[1]:
        notes.append(
            f"GPUs of phones, and some browsers, support at most {SIDES[1]} texels per side; use "
            "fewer frames, or a larger error, for them"
        )


def measure_pca_playback(
    texels: Texels, motion: Motion, rest: Singles, rest_normals: Singles | None
) -> PcaPlaybackErrors:
    """Return the errors of a texture as decoded from its file.

    Parameters
    ----------
    texels : uint8 array of shape (height, width, 4)
    rest : float32 array of shape (V, 3)
        Rest positions in the mesh file.
    rest_normals : float32 array of shape (V, 3), optional
        Rest normals in the mesh file; None if normals are not animated.
    """
    header = read_header(texels)
    offsets = section_offsets(texels, header, header.positions, motion.n_verts)
    errors = np.zeros(motion.n_frames)
    for frame in range(motion.n_frames):
        moved = (rest + offsets.frame(frame)).astype(np.float64)
        errors[frame] = np.linalg.norm(moved - motion.positions(frame), axis=1).max()
    if rest_normals is None:
        return PcaPlaybackErrors(errors, None)
    normal_offsets = section_offsets(texels, header, header.normals, motion.n_verts)
    angles_deg = np.zeros(motion.n_frames)
    for frame, units in enumerate(motion.normals()):
        played_normals = (rest_normals + normal_offsets.frame(frame)).astype(np.float64)
        played_normals /= np.maximum(np.linalg.norm(played_normals, axis=1, keepdims=True), 1e-30)
        chords = np.linalg.norm(played_normals - units, axis=1)
        angles_deg[frame] = np.degrees(2 * np.arcsin(np.clip(chords / 2, 0, 1))).mean()
    return PcaPlaybackErrors(errors, float(angles_deg.mean()))
