"""Writing a folder of vertex animation textures: one texel per vertex and frame."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.codec.error_bounds import bound_of
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.error_budget import ErrorBudget, requested_budget
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.gltf.container import IDENTITY
from meshreel.formats.gltf.mesh_writer import describe_losses
from meshreel.formats.gltf.morphs import check_range
from meshreel.formats.kinds import FolderFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.layouts import (
    BLENDER_FBX_SPACE,
    GLTF_SPACE,
    N_CHANNELS,
    WIDTHS,
    MeshSpace,
    Remap,
    TexelGrid,
    fit_grid,
    normal_values,
    normals_of,
    remap_document,
)
from meshreel.formats.vat.mesh import Motion, RestMesh, placement_for
from meshreel.formats.vat.textures import Texels, TexelType, read_texture, write_texture
from meshreel.model.notes import Notes, written_rate
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import OPEN_EXR, PNG

TEXEL_TYPES = {
    "exr": (TexelType.HALF, TexelType.FLOAT),
    "png": (TexelType.BITS_8, TexelType.BITS_16),
}
"""Texel types of each ``--textures`` choice, smallest first."""

DEFAULT_TEXTURES = "exr"

LAYOUTS = {"openvat": GLTF_SPACE, "openvat-unity": BLENDER_FBX_SPACE}
"""The space of the mesh file in each ``--layout``; all else is the same."""

DEFAULT_LAYOUT = "openvat"

DEFAULT_MAX_ERROR = 0.1
"""Percent of the diagonal: one pixel in a thousand, for a mesh that fills the image."""


def vat_files(path: Path, options: WriteOptions) -> list[Path]:
    """Return the paths of the files that a folder will contain.

    Raises
    ------
    InvalidInputError
        If the layout, the kind of textures or the error bound is invalid.
    FormatError
        If the library that writes the textures is not installed.
    """
    if options.max_error is not None:
        bound_of(options.max_error)
    types, _ = _choices(options)
    names = _file_names(path.stem, types)
    (PNG if options.textures == "png" else OPEN_EXR).load()
    return [path / name for name in names]


def write_vat(
    folder: Path,
    stem: str,
    stream: FrameStream,
    options: WriteOptions,
    types: Sequence[TexelType] = (),
) -> None:
    """Write the mesh, the texture and the JSON of a layout.

    All frames are loaded into memory.

    Parameters
    ----------
    stream : FrameStream
        Its notes gain all losses, and the errors achieved.
    types : sequence of TexelType, optional
        Candidates; the first that meets the error bound is used. Default: those of the option
        `textures`.

    Raises
    ------
    InvalidInputError
        If no type meets the error bound, or a texture would exceed the size limit of GPUs.
    """
    requested_types, space = _choices(options)
    types, notes = types or requested_types, stream.notes
    mesh_path, path, data_path = (folder / name for name in _file_names(stem, types))
    has_normals = options.normals is not False
    fps = _note_losses(stream)
    sequence = stream.gather()
    mesh = RestMesh(sequence.faces, sequence.surface, sequence.n_verts)
    low, high = sequence.extent.low, sequence.extent.high
    check_range(low, high)
    _, budget = requested_budget(low, high, options, DEFAULT_MAX_ERROR, consumer="textures")
    motion = _motion(sequence, mesh, fps, space, budget, notes)
    grid = fit_grid(motion.n_verts, motion.n_frames, n_halves=2 if has_normals else 1)

    stream.progress("textures", 0.0)
    # Without a budget, the resolution of float32 for a single point.
    bound = budget.max_added or float(np.spacing(np.abs(motion.rest).max()))
    remap = Remap.of(motion.offset_box())
    texel_type, image, errors = _smallest_texture(motion, remap, grid, types, bound)
    angle_deg = _write_normals(image, motion, grid, texel_type) if has_normals else None
    write_texture(path, image)
    if not np.array_equal(read_texture(path), image):
        raise InvalidInputError(
            f"{path.name} decodes to other texels, a defect of the library that wrote it; "
            "choose the other kind of textures"
        )
    mesh.write(mesh_path, motion, grid.texel_uvs(), space, notes)
    document = remap_document(motion.fps, grid, remap, stream.name or stem)
    text = json.dumps(document, ensure_ascii=False, indent=4)
    data_path.write_text(f"{text}\n", encoding="utf-8")
    _note_errors(notes, budget, errors, angle_deg, texel_type)
    _note_size(notes, grid, texel_type)


def _file_names(stem: str, types: Sequence[TexelType]) -> tuple[str, str, str]:
    """Return the names of the mesh, the texture and the JSON."""
    return f"{stem}.glb", f"{stem}_vat{types[0].extension}", f"{stem}-remap_info.json"


def _choices(options: WriteOptions) -> tuple[Sequence[TexelType], MeshSpace]:
    """Return the texel types and the mesh space; raises InvalidInputError for unknown names."""
    layout, textures = options.layout or DEFAULT_LAYOUT, options.textures or DEFAULT_TEXTURES
    for option, name, names in (("layout", layout, LAYOUTS), ("textures", textures, TEXEL_TYPES)):
        if name not in names:
            raise InvalidInputError(
                Keyword(option), f" must be one of {', '.join(names)}; got {name!r}"
            )
    return TEXEL_TYPES[textures], LAYOUTS[layout]


def _note_losses(stream: FrameStream) -> float:
    """Note what the folder cannot store, and return the frame rate to write."""
    notes, surface = stream.notes, stream.surface
    notes.add_all(describe_losses(surface, len(stream.faces)))
    if surface.parts:
        notes.changed(f"{counted(len(surface.parts), 'part')} become one mesh, without their names")
    if start_s := stream.timing.start_s:
        notes.changed("start", f"starts at 0 s, not {start_s:g} s: textures have no start time")
    return written_rate(stream.timing, notes if stream.n_frames > 1 else Notes())


def _motion(
    sequence: MeshSequence,
    mesh: RestMesh,
    fps: float,
    space: MeshSpace,
    budget: ErrorBudget,
    notes: Notes,
) -> Motion:
    """Return the motion of the vertices that faces use, near the origin."""
    frames = sequence.vertices
    if n_isolated := sequence.n_verts - len(mesh.used_verts):
        notes.unwritten(f"left out {counted(n_isolated, 'vertex')} that no face uses")
        frames = frames[:, mesh.used_verts]
    placement = placement_for(frames, budget.max_added or np.inf)
    if placement is not IDENTITY:
        origin = " ".join(f"{coordinate:g}" for coordinate in placement.offset)
        notes.changed(
            f"the mesh is centered at the origin, and the node of the file moves it to {origin}, "
            "where float32 is too coarse; keep the node when you import it"
        )
    return Motion(frames, mesh.faces, fps, placement, space.scale)


def _smallest_texture(
    motion: Motion, remap: Remap, grid: TexelGrid, types: Sequence[TexelType], bound: float
) -> tuple[TexelType, Texels, npt.NDArray[np.float64]]:
    """Return the texture of offsets of the first type that meets the error bound.

    Parameters
    ----------
    bound : float
        Largest distance of a vertex from its position, in model units.

    Returns
    -------
    texel_type : TexelType
    image : array of texels
    errors : float64 array of shape (T,)
        Largest error of each frame as shaders play it, in model units.

    Raises
    ------
    InvalidInputError
        If no type meets the bound.
    """
    min_error = np.inf
    for texel_type in types:
        image = grid.image(N_CHANNELS, texel_type.dtype)
        errors = np.empty(motion.n_frames)
        for frame, offsets in enumerate(motion.offsets()):
            texels = texel_type.texels(remap.values(offsets))
            grid.write_frame(image, frame, texels)
            played_offsets = remap.offsets(texel_type.values(texels))
            errors[frame] = motion.playback_errors(frame, played_offsets).max()
        min_error = min(min_error, errors.max())
        if min_error <= bound:
            return texel_type, image, errors
    advice = ", or choose textures 'exr'" if texel_type.is_integer else ""
    raise InvalidInputError(
        f"the error with {texel_type.title} is {min_error:.4g} model units; at most {bound:.4g} "
        "are allowed; allow a larger error (",
        Keyword("max_error"),
        f"){advice}",
    )


def _write_normals(image: Texels, motion: Motion, grid: TexelGrid, texel_type: TexelType) -> float:
    """Write normals to the lower half of a texture; return their largest error in degrees."""
    angle_deg = 0.0
    for frame, normals in enumerate(motion.normals()):
        texels = texel_type.texels(normal_values(normals))
        grid.write_frame(image, frame, texels, half=1)
        played_normals = normals_of(texel_type.values(texels))
        played_normals /= np.linalg.norm(played_normals, axis=1, keepdims=True)
        # Chords are accurate for small angles; cosines are not.
        chord = np.linalg.norm(played_normals - normals, axis=1).max()
        angle_deg = max(angle_deg, float(np.degrees(2 * np.arcsin(min(chord / 2, 1)))))
    return angle_deg


def _note_errors(
    notes: Notes,
    budget: ErrorBudget,
    errors: npt.NDArray[np.float64],
    angle_deg: float | None,
    texel_type: TexelType,
) -> None:
    largest, frame = float(errors.max()), int(errors.argmax())
    added = "" if budget.origin is None else " added"
    notes.result(
        f"the largest error{added} is {budget.percent(largest):.3g} % of the diagonal, in frame "
        f"{frame}, as decoded from {texel_type.title}"
    )
    notes += budget.describe(largest)
    if angle_deg is not None:
        notes.result(f"the largest error of normals is {angle_deg:.2g} degrees")


def _note_size(notes: Notes, grid: TexelGrid, texel_type: TexelType) -> None:
    video_bytes = texel_type.video_bytes(grid.height, grid.width)
    notes.result(
        f"1 texture of {grid.width} x {grid.height} texels: "
        f"{video_bytes / 1e6:.3g} MB of video memory"
    )
    if max(grid.width, grid.height) > WIDTHS[0]:
        notes.result(
            f"GPUs of phones, and some browsers, support at most {WIDTHS[0]} texels per side; use "
            "fewer frames for them"
        )


FORMATS = (
    FolderFormat(
        ".vat",
        "vertex animation textures",
        vat_files,
        write_vat,
        extra=OPEN_EXR,
        write_options=frozenset({"layout", "textures", "max_error", "normals"}),
    ),
)
