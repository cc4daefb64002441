"""Plain vertex animation textures: one texel per vertex and frame, of the smallest type."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.grid import WIDTHS, TexelGrid
from meshreel.formats.vat.motion import Motion
from meshreel.formats.vat.plain_layout import FileNames, PlainLayout, Remap
from meshreel.formats.vat.preparation import BakeInput, note_error, prepare
from meshreel.formats.vat.textures import Texels, TexelType, read_texture, write_texture
from meshreel.runtime.counting import counted


@dataclass(frozen=True, eq=False)
class Encoding:
    """How offsets are stored in texels."""

    texels: TexelType
    remap: Remap


def smallest_encoding(
    motion: Motion, layout: PlainLayout, grid: TexelGrid, types: Sequence[TexelType], bound: float
) -> Encoding:
    """Return the first encoding of the given types that meets the error bound.

    Parameters
    ----------
    types : sequence of TexelType
    bound : float
        Largest distance of a vertex from its position, in model units.

    Raises
    ------
    InvalidInputError
        If no type meets the bound.
    """
    min_error = np.inf
    for texel_type in types:
        encoding = Encoding(texel_type, layout.remap(motion, grid, texel_type))
        min_error = min(min_error, _largest_error(motion, encoding, bound))
        if min_error <= bound:
            return encoding
    advice = ", or choose textures 'exr'" if texel_type.is_integer else ""
    raise InvalidInputError(
        f"the error with {texel_type.title} is {min_error:.4g} model units; at most {bound:.4g} "
        f"are allowed; allow a larger error (max_error){advice}"
    )


def fill_textures(
    motion: Motion, layout: PlainLayout, grid: TexelGrid, encoding: Encoding, *, normals: bool
) -> list[Texels]:
    """Return the texture of offsets and, if the layout separates them, the texture of normals."""
    packed = normals and layout.normal_half > 0
    images = [grid.image(3, encoding.texels.dtype)]
    if normals and not packed:
        images.append(grid.image(layout.normal_channels, encoding.texels.dtype))
    for frame, offsets in enumerate(motion.offsets()):
        grid.write_frame(images[0], frame, encoding.texels.texels(encoding.remap.values(offsets)))
    if normals:
        for frame, units in enumerate(motion.normals()):
            values = layout.normal_values(units, encoding.texels)
            texels = encoding.texels.texels(values)
            grid.write_frame(images[-1], frame, texels, layout.normal_half)
    return images


def _largest_error(motion: Motion, encoding: Encoding, bound: float) -> float:
    """Return the largest error, or that of the frames up to the first one beyond the bound."""
    largest = 0.0
    low, high = encoding.texels.range
    for frame, offsets in enumerate(motion.offsets()):
        values = encoding.remap.values(offsets)
        if values.min() < low or values.max() > high:
            return np.inf
        sampled = encoding.texels.values(encoding.texels.texels(values))
        errors = motion.playback_errors(frame, encoding.remap.offsets(sampled))
        largest = max(largest, float(errors.max()))
        if largest > bound:
            break
    return largest


@dataclass(frozen=True, eq=False)
class PlaybackErrors:
    """Errors of textures as shaders play them.

    Attributes
    ----------
    errors : float array of shape (T,)
        Largest error of a vertex in each frame, in model units.
    angles_deg : float array of shape (T,), optional
        Largest angle between original and played normals of each frame; None without normals.
    """

    errors: npt.NDArray[np.float64]
    angles_deg: npt.NDArray[np.float64] | None


@dataclass(frozen=True, eq=False)
class _Bake:
    """Data to write to a folder."""

    prepared: BakeInput
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
    stream : FrameStream
        Its notes gain all losses, and the errors achieved.
    types : sequence of TexelType
        Candidates; the first that meets the error bound is used.

    Raises
    ------
    InvalidInputError
        If no type meets the error bound, or a texture would exceed the size limit of GPUs.
    """
    normals = options.normals is not False
    bake = _bake(stream, options, layout, types, normals=normals)
    motion, grid, encoding = bake.motion, bake.grid, bake.encoding
    stream.progress("textures", 0.0)
    images = fill_textures(motion, layout, grid, encoding, normals=normals)
    textures = [folder / name for name in (names.positions, names.normals) if name is not None]
    for path, image in zip(textures, images, strict=True):
        write_texture(path, image)
    rest_normals = next(motion.normals()).astype(np.float32)
    bake.prepared.mesh.write(
        folder / names.mesh,
        motion.rest,
        rest_normals,
        grid.texel_uvs(),
        motion.placement,
        layout.mesh_space,
        layout.corners(encoding.remap),
        stream.notes,
    )
    document = layout.document(motion, grid, encoding.remap, stream.name or Path(names.mesh).stem)
    text = json.dumps(document, ensure_ascii=False, indent=4)
    (folder / names.data).write_text(f"{text}\n", encoding="utf-8")
    decoded = [read_texture(path) for path in textures]
    playback = measure_playback(decoded, motion, layout, grid, encoding, normals=normals)
    if (worst := float(playback.errors.max())) > bake.prepared.bound:
        raise InvalidInputError(
            f"{textures[0].name} decodes with an error of {worst:.4g} model units, a defect of the "
            "library that wrote it; choose the other kind of textures"
        )
    _note_achieved(stream.notes, bake, playback, len(textures))


def _bake(
    stream: FrameStream,
    options: WriteOptions,
    layout: PlainLayout,
    types: Sequence[TexelType],
    *,
    normals: bool,
) -> _Bake:
    prepared = prepare(stream, options, max_distance=layout.max_distance)
    motion = replace(prepared.motion, mesh_scale=layout.mesh_space.axes.scale)
    grid = layout.grid(motion.n_verts, motion.n_frames, normals=normals)
    if grid.n_frames > motion.n_frames:
        motion = replace(motion, frames=np.concatenate([motion.frames] * grid.n_frames))
        stream.notes.append(
            "the frame is stored twice: shaders of this layout hide part of a single one"
        )
    encoding = smallest_encoding(motion, layout, grid, types, prepared.bound)
    return _Bake(prepared, motion, grid, encoding)


def _note_achieved(
    notes: list[str], bake: _Bake, playback: PlaybackErrors, n_textures: int
) -> None:
    grid, texels = bake.grid, bake.encoding.texels
    note_error(notes, bake.prepared.budget, playback.errors, texels)
    video_bytes = n_textures * texels.video_bytes(grid.height, grid.width)
    notes.append(
        f"{counted(n_textures, 'texture')} of {grid.width} x {grid.height} texels: "
        f"{video_bytes / 1e6:.3g} MB of video memory"
    )
    if playback.angles_deg is not None:
        notes.append(f"the largest error of normals is {playback.angles_deg.max():.2g} degrees")
    if max(grid.width, grid.height) > WIDTHS[0]:
        notes.append(
            f"GPUs of phones, and some browsers, support at most {WIDTHS[0]} texels per side; use "
            "fewer frames for them"
        )


def measure_playback(
    images: list[Texels], motion: Motion, layout: PlainLayout, grid: TexelGrid, encoding: Encoding,
    *, normals: bool,
) -> PlaybackErrors:  # fmt: skip
    """Return the errors of textures as decoded from their files.

    Parameters
    ----------
    images : list of arrays
        The texture of offsets and, if the layout separates them, the texture of normals.
    """
    errors = np.zeros(motion.n_frames)
    for frame in range(motion.n_frames):
        sampled = encoding.texels.values(grid.read_frame(images[0], frame))
        errors[frame] = motion.playback_errors(frame, encoding.remap.offsets(sampled)).max()
    if not normals:
        return PlaybackErrors(errors, None)
    angles_deg = np.zeros(motion.n_frames)
    for frame, units in enumerate(motion.normals()):
        sampled = encoding.texels.values(grid.read_frame(images[-1], frame, layout.normal_half))
        played_normals = layout.normals(sampled, encoding.texels)
        played_normals /= np.linalg.norm(played_normals, axis=1, keepdims=True)
        # Chords are accurate for small angles; cosines are not.
        chords = np.linalg.norm(played_normals - units, axis=1)
        angles_deg[frame] = np.degrees(2 * np.arcsin(np.clip(chords / 2, 0, 1))).max()
    return PlaybackErrors(errors, angles_deg)
