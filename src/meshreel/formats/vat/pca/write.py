"""PCA textures of a sequence: a mesh at rest, one texture, and a JSON that tells of it."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Singles
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.gltf.normal_targets import NormalChoice, are_written
from meshreel.formats.gltf.write import WHY_FLAT
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.axes import GLTF_SPACE
from meshreel.formats.vat.gathering import Gathered, gather, note_error
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.pca.digits import Rows, rows_of
from meshreel.formats.vat.pca.search import fit_fields, fit_mean
from meshreel.formats.vat.pca.texture import (
    SIDES,
    make_texture,
    read_header,
    section_offsets,
    texel_places,
)
from meshreel.formats.vat.textures import Texels, TexelType, read_texture, write_texture
from meshreel.runtime.counting import counted

NORMAL_ERROR = 0.1
"""Root mean square difference of unit normals: 3.5 degrees or so in the mean."""

KEPT = 0.999
"""Share of the bound that fields may use; the rest is for float32 of the GPU."""

NEXT_STEPS = "allow a larger error (--max-error), or take fewer frames (--frames)"


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


@dataclass(frozen=True)
class PcaNames:
    """Names of the files of a folder.

    Attributes
    ----------
    mesh, texture, data : str
    """

    mesh: str
    texture: str
    data: str

    @classmethod
    def of(cls, stem: str) -> "PcaNames":
        """Those for files of this stem."""
        return cls(f"{stem}.glb", f"{stem}.png", f"{stem}.json")


@dataclass(frozen=True, eq=False)
class Rest:
    """The mesh at rest: means over all frames.

    Attributes
    ----------
    positions, normals : float32 arrays of shape (V, 3)
        Normals are unit vectors.
    """

    positions: Singles
    normals: Singles

    @classmethod
    def of(cls, motion: Motion) -> "Rest":
        """That of a motion."""
        positions, normals = np.zeros((2, motion.n_verts, 3))
        for frame, units in enumerate(motion.normals()):
            positions += motion.positions(frame) / motion.n_frames
            normals += units
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        first = next(motion.normals())
        units = np.where(lengths > 1e-6, normals / np.maximum(lengths, 1e-6), first)
        return cls(positions.astype(np.float32), units.astype(np.float32))


def write_pca(folder: Path, names: PcaNames, stream: FrameStream, options: WriteOptions) -> None:
    """Write the mesh, the texture and the JSON.

    Raises
    ------
    InvalidInputError
        If the error bound cannot be kept, or the texture would be larger than GPUs hold them.
    """
    gathered = gather(stream, options)
    motion, bound = gathered.motion, gathered.bound
    rest = Rest.of(motion)
    moves = np.empty((motion.n_frames, 3 * motion.n_verts), np.float32)
    for frame in range(motion.n_frames):
        moves[frame] = (motion.positions(frame) - rest.positions).ravel()
    fields = fit_fields(moves, KEPT * bound, stream.progress)
    if fields is None:
        raise InvalidInputError(
            f"PCA textures cannot keep {bound:.4g} model units: integers of five digits are too "
            f"coarse for that; {NEXT_STEPS}, or another layout (--layout)"
        )
    normals = _normal_rows(motion, rest, options)
    texture = folder / names.texture
    write_texture(texture, make_texture(rows_of(fields), normals, motion.n_verts))
    texels = read_texture(texture)
    moving_normals = None if normals is None else rest.normals
    played = play_pca(texels, motion, rest.positions, moving_normals)
    if (worst := float(played.errors.max())) > bound:
        raise InvalidInputError(
            f"PCA textures are off by {worst:.4g} model units as float32 of GPUs plays them; "
            f"{bound:.4g} are allowed; {NEXT_STEPS}"
        )
    places = texel_places(texels, motion.n_verts)
    # The mesh counts v from the bottom, and its file from the top.
    texcoords = places * [1.0, -1.0] + [0.0, 1.0]
    gathered.mesh.write(
        folder / names.mesh,
        rest.positions,
        rest.normals,
        texcoords,
        motion.placement,
        GLTF_SPACE,
        None,
        stream.notes,
    )
    document = _document(names, gathered, len(fields.n_digits), played)
    text = json.dumps(document, ensure_ascii=False, indent=4)
    (folder / names.data).write_text(f"{text}\n", encoding="utf-8")
    _note_achieved(stream.notes, gathered, texels, len(fields.n_digits), played)
    if normals is None and options.normals is None:
        stream.notes.append(f"no normals, so shade it flat: {WHY_FLAT}")


def _normal_rows(motion: Motion, rest: Rest, options: WriteOptions) -> Rows | None:
    """Rows of what is added to normals, if there are to be any."""
    choice = {None: NormalChoice.SMOOTH, True: NormalChoice.ALL, False: NormalChoice.NONE}
    if not are_written(choice[options.normals], motion.positions(0), motion.faces):
        return None
    turns = np.empty((motion.n_frames, 3 * motion.n_verts), np.float32)
    for frame, units in enumerate(motion.normals()):
        turns[frame] = (units - rest.normals).ravel()
    return rows_of(fit_mean(turns, NORMAL_ERROR))


def _document(
    names: PcaNames, gathered: Gathered, n_fields: int, played: PlayedPca
) -> dict[str, Any]:
    """What programs and people want to know of the files."""
    low, high = gathered.motion.box()
    return {
        "layout": "meshreel pca 1",
        "mesh": names.mesh,
        "texture": names.texture,
        "frames": gathered.motion.n_frames,
        "fps": gathered.motion.fps,
        "vertices": gathered.motion.n_verts,
        "fields": n_fields,
        "normals": played.angle_deg is not None,
        "largest_error": float(played.errors.max()),
        "box": {"min": low.tolist(), "max": high.tolist()},
    }


def _note_achieved(
    notes: list[str], gathered: Gathered, texels: Any, n_fields: int, played: PlayedPca
) -> None:
    height, width = texels.shape[:2]
    note_error(notes, gathered.budget, played.errors, TexelType.BITS_8)
    video_bytes = TexelType.BITS_8.video_bytes(height, width)
    notes.append(
        f"{counted(n_fields, 'field')} in a texture of {width} x {height} texels: "
        f"{video_bytes / 1e6:.3g} MB of video memory"
    )
    if played.angle_deg is not None:
        notes.append(f"normals are off by {played.angle_deg:.1f} degrees in the mean")
    if max(height, width) > SIDES[1]:
        notes.append(
            f"GPUs of phones, and some that browsers use, hold no more than {SIDES[1]} texels a "
            "side; take fewer frames, or a larger error, for those"
        )


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
