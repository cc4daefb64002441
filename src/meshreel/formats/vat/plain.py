"""Plain vertex animation textures: a texel for each vertex in each frame."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.filling import Encoding, fill_textures, smallest_encoding
from meshreel.formats.vat.gathering import Gathered, gather, note_error
from meshreel.formats.vat.grid import WIDTHS, TexelGrid
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.plain_layout import FileNames, PlainLayout
from meshreel.formats.vat.textures import Texels, TexelType, read_texture, write_texture
from meshreel.runtime.counting import counted


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


@dataclass(frozen=True, eq=False)
class _Baked:
    """What is written into a folder."""

    gathered: Gathered
    motion: Motion
    grid: TexelGrid
    encoding: Encoding


def write_plain(
    folder: Path,
    names: FileNames,
    stream: FrameStream,
    options: WriteOptions,
    layout: PlainLayout,
    types: Sequence[TexelType],
) -> None:
    """Write the mesh, the textures and the JSON of a layout.

    Parameters
    ----------
    folder : Path
    names : FileNames
    stream : FrameStream
        Its notes gain what is lost, and what was achieved.
    options : WriteOptions
    layout : PlainLayout
    types : sequence of TexelType
        Of which the first that keeps the error bound is taken.

    Raises
    ------
    InvalidInputError
        If none keeps it, or a texture would be larger than GPUs hold them.
    """
    normals = options.normals is not False
    baked = _bake(stream, options, layout, types, normals=normals)
    motion, grid, encoding = baked.motion, baked.grid, baked.encoding
    stream.progress("textures", 0.0)
    images = fill_textures(motion, layout, grid, encoding, normals=normals)
    textures = [folder / name for name in (names.positions, names.normals) if name is not None]
    for path, image in zip(textures, images, strict=True):
        write_texture(path, image)
    rest_normals = next(motion.normals()).astype(np.float32)
    baked.gathered.mesh.write(
        folder / names.mesh,
        motion.rest,
        rest_normals,
        grid.texcoords(),
        motion.placement,
        layout.mesh_space,
        layout.corners(encoding.remap),
        stream.notes,
    )
    document = layout.document(motion, grid, encoding.remap, stream.name or Path(names.mesh).stem)
    text = json.dumps(document, ensure_ascii=False, indent=4)
    (folder / names.data).write_text(f"{text}\n", encoding="utf-8")
    read = [read_texture(path) for path in textures]
    played = play(read, motion, layout, grid, encoding, normals=normals)
    if (worst := float(played.errors.max())) > baked.gathered.bound:
        raise InvalidInputError(
            f"{textures[0].name} reads back as frames that are off by {worst:.4g} model units; "
            "this is an error of the library that wrote it; take the other kind of textures"
        )
    _note_achieved(stream.notes, baked, played, len(textures))


def _bake(
    stream: FrameStream,
    options: WriteOptions,
    layout: PlainLayout,
    types: Sequence[TexelType],
    *,
    normals: bool,
) -> _Baked:
    gathered = gather(stream, options, farthest=layout.farthest)
    motion = replace(gathered.motion, mesh_scale=layout.mesh_space.axes.scale)
    grid = layout.grid(motion.n_verts, motion.n_frames, normals=normals)
    if grid.n_frames > motion.n_frames:
        motion = replace(motion, frames=np.concatenate([motion.frames] * grid.n_frames))
        stream.notes.append("the frame is there twice: shaders of this layout hide a part of one")
    encoding = smallest_encoding(motion, layout, grid, types, gathered.bound)
    return _Baked(gathered, motion, grid, encoding)


def _note_achieved(notes: list[str], baked: _Baked, played: Played, n_textures: int) -> None:
    grid, texels = baked.grid, baked.encoding.texels
    note_error(notes, baked.gathered.budget, played.errors, texels)
    video_bytes = n_textures * texels.video_bytes(grid.height, grid.width)
    notes.append(
        f"{counted(n_textures, 'texture')} of {grid.width} x {grid.height} texels: "
        f"{video_bytes / 1e6:.3g} MB of video memory"
    )
    if played.angles_deg is not None:
        notes.append(f"normals are off by {played.angles_deg.max():.2g} degrees at most")
    if max(grid.width, grid.height) > WIDTHS[0]:
        notes.append(
            f"GPUs of phones, and some that browsers use, hold no more than {WIDTHS[0]} texels a "
            "side; take fewer frames for those"
        )


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
