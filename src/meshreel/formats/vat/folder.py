"""Writing a folder of vertex animation textures: one texel per vertex and frame.

The second UVs of the rest mesh, a glTF file, point to the texels.
"""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.error_bounds import bound_of
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.error_budget import requested_budget
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.gltf.container import IDENTITY, Placement, write_document
from meshreel.formats.gltf.materials import Materials
from meshreel.formats.gltf.mesh_writer import (
    MorphMesh,
    SceneWriter,
    describe_losses,
    split_at_seams,
    write_mesh,
)
from meshreel.formats.gltf.morphs import NormalTargets, check_range
from meshreel.formats.kinds import FolderFormat
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import split_parts
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
    to_blender,
)
from meshreel.formats.vat.textures import Texels, TexelType, read_texture, write_texture
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.notes import Notes, written_rate
from meshreel.model.sequence import Faces, MeshSequence, Vertices
from meshreel.model.surface import Attribute, Domain, Kind
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

TEXEL_UVS = "VAT_UV"
"""Name of the UVs of the texels, TEXCOORD_1 in the file."""

UP = (0.0, 1.0, 0.0)
"""Normal of a vertex without one, since all faces around it are degenerate."""


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
    notes.add_all(describe_losses(stream.surface, len(stream.faces)))
    if parts := stream.surface.parts:
        notes.changed(f"{counted(len(parts), 'part')} become one mesh, without their names")
    if start_s := stream.timing.start_s:
        notes.changed("start", f"starts at 0 s, not {start_s:g} s: textures have no start time")
    fps = written_rate(stream.timing, notes if stream.n_frames > 1 else Notes())

    sequence = stream.gather()
    is_used = np.zeros(sequence.n_verts, bool)
    is_used[sequence.faces] = True
    faces = (np.cumsum(is_used) - 1)[sequence.faces].astype(np.int32)
    low, high = sequence.extent.low, sequence.extent.high
    check_range(low, high)
    _, budget = requested_budget(low, high, options, DEFAULT_MAX_ERROR, consumer="textures")
    frames = sequence.vertices
    if n_isolated := int((~is_used).sum()):
        notes.unwritten(f"left out {counted(n_isolated, 'vertex')} that no face uses")
        frames = frames[:, is_used]
    placement = placement_for(frames, budget.max_added or np.inf)
    if placement is not IDENTITY:
        origin = " ".join(f"{coordinate:g}" for coordinate in placement.offset)
        notes.changed(
            f"the mesh is centered at the origin, and the node of the file moves it to {origin}, "
            "where float32 is too coarse; keep the node when you import it"
        )
    motion = Motion(frames, faces, placement, space.scale)
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
    _write_rest_mesh(mesh_path, sequence, is_used, motion, grid.texel_uvs(), space, notes)
    document = remap_document(fps, grid, remap, stream.name or stem)
    text = json.dumps(document, ensure_ascii=False, indent=4)
    data_path.write_text(f"{text}\n", encoding="utf-8")

    largest, frame = float(errors.max()), int(errors.argmax())
    added = "" if budget.origin is None else " added"
    notes.result(
        f"the largest error{added} is {budget.percent(largest):.3g} % of the diagonal, in frame "
        f"{frame}, as decoded from {texel_type.title}"
    )
    notes += budget.describe(largest)
    if angle_deg is not None:
        notes.result(f"the largest error of normals is {angle_deg:.2g} degrees")
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


@dataclass(frozen=True, eq=False)
class Motion:
    """Frames of the vertices that faces use, as offsets from the first frame."""

    frames: Vertices
    """float array of shape (T, V, 3). Positions in model units."""
    faces: Faces
    """int32 array of shape (M, 3)."""
    placement: Placement
    """Translation of the mesh in the model; its scale is 1."""
    mesh_scale: float = 1.0
    """Units of the mesh file per model unit."""

    @property
    def n_frames(self) -> int:
        """Number of frames, T."""
        return len(self.frames)

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return int(self.frames.shape[1])

    @cached_property
    def rest(self) -> npt.NDArray[np.float32]:
        """Rest positions in the mesh file: the first frame as float32, of shape (V, 3)."""
        return self.positions(0).astype(np.float32)

    def positions(self, frame: int) -> npt.NDArray[np.float64]:
        """Return the positions of a frame relative to the placement, of shape (V, 3)."""
        return np.asarray(self.frames[frame].astype(np.float64) - self.placement.offset)

    def offsets(self) -> Iterator[npt.NDArray[np.float64]]:
        """Yield the offsets of each frame from the rest mesh, of shape (V, 3)."""
        rest = self.rest.astype(np.float64)
        for frame in range(self.n_frames):
            yield self.positions(frame) - rest

    def playback_errors(
        self, frame: int, offsets: npt.NDArray[np.float32]
    ) -> npt.NDArray[np.float64]:
        """Return the errors of vertices that a shader moves by offsets, of shape (V,).

        Shaders add them in float32, in the units of the mesh file.
        """
        scale = np.float32(self.mesh_scale)
        rest = (self.rest * self.mesh_scale).astype(np.float32)
        moved = (rest + scale * offsets).astype(np.float64) / self.mesh_scale
        return np.asarray(np.linalg.norm(moved - self.positions(frame), axis=1))

    def normals(self) -> Iterator[npt.NDArray[np.float64]]:
        """Yield the smooth unit normals of each frame, of shape (V, 3)."""
        for frame in range(self.n_frames):
            normals = vertex_normals(self.positions(frame), self.faces)
            normals[~normals.any(axis=1)] = UP
            yield normals

    def offset_box(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return the corners of the bounding box of all offsets."""
        boxes = [(offsets.min(axis=0), offsets.max(axis=0)) for offsets in self.offsets()]
        lows, highs = zip(*boxes, strict=True)
        return np.min(lows, axis=0), np.max(highs, axis=0)


def placement_for(frames: Vertices, max_error: float) -> Placement:
    """Return a placement that centers the mesh where float32 is too coarse, or else none.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    max_error : float
        Error that may be added to a position, in model units; float32 may use an eighth of it.
    """
    low = np.min([frame.min(axis=0) for frame in frames], axis=0).astype(np.float64)
    high = np.max([frame.max(axis=0) for frame in frames], axis=0).astype(np.float64)
    reach = float(np.maximum(-low, high).max())
    center = ((low + high) / 2).astype(np.float32).astype(np.float64)
    is_near = np.spacing(np.float32(reach)) <= max_error / 8
    if is_near or not center.any():
        return IDENTITY
    return Placement(center, 1.0)


def _write_rest_mesh(
    path: Path,
    sequence: MeshSequence,
    is_used: npt.NDArray[np.bool_],
    motion: Motion,
    uvs: Floats,
    space: MeshSpace,
    notes: Notes,
) -> None:
    """Write a ``.glb`` file of the first frame.

    Parameters
    ----------
    is_used : bool array of shape (number of all vertices,)
        Whether a face uses a vertex; others are left out.
    uvs : float64 array of shape (V, 2)
        UVs of the texels of the first frame; v is 0 at the bottom.
    space : MeshSpace
        Axes and units of the vertices in the file.
    notes : Notes
        Gains a sentence for everything of a material that glTF cannot store.
    """
    surface, n_verts = sequence.surface, sequence.n_verts
    if surface.hard_edges is not None and len(surface.hard_edges):
        notes.unwritten(
            f"left out {counted(len(surface.hard_edges), 'hard edge')}: textures store one normal "
            "per vertex"
        )
    # The UVs of texels are the second UV set; the first is zeros if there is none.
    rows = np.zeros((n_verts, 2))
    rows[is_used] = uvs
    attributes = list(surface.attributes)
    uv_indices = [index for index, attribute in enumerate(attributes) if attribute.kind is Kind.UV]
    if not uv_indices:
        zeros = np.zeros((n_verts, 2), np.float32)
        attributes.insert(0, Attribute("uv", Kind.UV, Domain.VERTEX, zeros))
        uv_indices = [0]
    texel_uvs = Attribute(TEXEL_UVS, Kind.UV, Domain.VERTEX, rows)
    attributes.insert(uv_indices[0] + 1, texel_uvs)
    surface = replace(surface, parts=(), hard_edges=None, attributes=tuple(attributes))

    normals, rest = next(motion.normals()).astype(np.float32), motion.rest
    if space.rotation is not None:
        normals, rest = to_blender(normals), to_blender(rest)
    rest = (rest * space.scale).astype(np.float32)
    name = path.stem
    scene = SceneWriter(name, [0.0], WriteOptions(), notes)
    materials = Materials(surface, scene.buffer, notes)
    [part] = split_parts(sequence.faces, surface, n_verts, "")
    compact_indices = np.cumsum(is_used) - 1
    split = split_at_seams(part).with_indices(compact_indices, compact_indices)
    morph_mesh = MorphMesh(motion.placement, rest, None, NormalTargets(normals), np.zeros(1))
    node = scene.tree.add(name, 0, motion.placement)
    if space.rotation is not None:
        transform = {"rotation": list(space.rotation), "scale": [1 / space.scale] * 3}
        scene.tree.nodes[node] |= transform
    scene.meshes.append(write_mesh(name, split, morph_mesh, scene.buffer, materials))
    document = scene.assemble(materials)
    write_document(path, document, scene.buffer, "leave out attributes (--attributes)")


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
