"""The motion to bake, and the glTF file of the rest mesh, whose second UVs point to the texels."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.formats.gltf.container import IDENTITY, Placement, write_document
from meshreel.formats.gltf.materials import Materials
from meshreel.formats.gltf.mesh_writer import MorphMesh, SceneWriter, split_at_seams, write_mesh
from meshreel.formats.gltf.morphs import NormalTargets
from meshreel.formats.options import WriteOptions
from meshreel.formats.scenes.parts import split_parts
from meshreel.formats.vat.layouts import MeshSpace, to_blender
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.notes import Notes
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.runtime.counting import counted

TEXEL_UVS = "VAT_UV"
"""Name of the UVs of the texels, TEXCOORD_1 in the file."""

UP = (0.0, 1.0, 0.0)
"""Normal of a vertex without one, since all faces around it are degenerate."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Frames of the vertices that faces use, as offsets from the first frame."""

    frames: Vertices
    """float array of shape (T, V, 3). Positions in model units."""
    faces: Faces
    """int32 array of shape (M, 3)."""
    fps: float
    """Above 0."""
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


class RestMesh:
    """The rest mesh, restricted to the vertices that faces use.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)

    Attributes
    ----------
    used_verts : int64 array of shape (V,)
        Indices of the vertices that faces use, ascending.
    faces : int32 array of shape (M, 3)
        Faces as indices into these vertices.
    """

    def __init__(self, faces: Faces, surface: Surface, n_verts: int) -> None:
        self._n_verts = n_verts
        # Textures store one normal per vertex, so hard edges are lost.
        self._n_hard_edges = 0 if surface.hard_edges is None else len(surface.hard_edges)
        self._all_faces, self._surface = faces, replace(surface, parts=(), hard_edges=None)
        is_used = np.zeros(n_verts, bool)
        is_used[faces] = True
        self.used_verts: npt.NDArray[np.intp] = np.flatnonzero(is_used)
        self._compact_indices = np.cumsum(is_used) - 1
        self.faces: npt.NDArray[np.int32] = self._compact_indices[faces].astype(np.int32)

    def write(
        self,
        path: Path,
        motion: Motion,
        uvs: Floats,
        space: MeshSpace,
        notes: Notes,
    ) -> None:
        """Write a ``.glb`` file of the first frame.

        Parameters
        ----------
        uvs : float64 array of shape (V, 2)
            UVs of the texels of the first frame; v is 0 at the bottom.
        space : MeshSpace
            Axes and units of the vertices in the file.
        notes : Notes
            Gains a sentence for everything of a material that glTF cannot store.
        """
        if self._n_hard_edges:
            notes.unwritten(
                f"left out {counted(self._n_hard_edges, 'hard edge')}: textures store one normal "
                "per vertex"
            )
        surface = self._with_texel_uvs(uvs)
        normals, rest = next(motion.normals()).astype(np.float32), motion.rest
        if space.rotation is not None:
            normals, rest = to_blender(normals), to_blender(rest)
        rest = (rest * space.scale).astype(np.float32)
        name = path.stem
        scene = SceneWriter(name, [0.0], WriteOptions(), notes)
        materials = Materials(surface, scene.buffer, notes)
        [part] = split_parts(self._all_faces, surface, self._n_verts, "")
        split = split_at_seams(part).with_indices(self._compact_indices, self._compact_indices)
        morph_mesh = MorphMesh(motion.placement, rest, None, NormalTargets(normals), np.zeros(1))
        node = scene.tree.add(name, 0, motion.placement)
        if space.rotation is not None:
            transform = {"rotation": list(space.rotation), "scale": [1 / space.scale] * 3}
            scene.tree.nodes[node] |= transform
        scene.meshes.append(write_mesh(name, split, morph_mesh, scene.buffer, materials))
        document = scene.assemble(materials)
        write_document(path, document, scene.buffer, "leave out attributes (--attributes)")

    def _with_texel_uvs(self, uvs: Floats) -> Surface:
        """Return the surface with `uvs` as its second UV set; the first is zeros if it has none."""
        rows = np.zeros((self._n_verts, 2))
        rows[self.used_verts] = uvs
        texel_uvs = Attribute(TEXEL_UVS, Kind.UV, Domain.VERTEX, rows)
        attributes = list(self._surface.attributes)
        uv_indices = [
            index for index, attribute in enumerate(attributes) if attribute.kind is Kind.UV
        ]
        if not uv_indices:
            zeros = np.zeros((self._n_verts, 2), np.float32)
            attributes.insert(0, Attribute("uv", Kind.UV, Domain.VERTEX, zeros))
            uv_indices = [0]
        attributes.insert(uv_indices[0] + 1, texel_uvs)
        return replace(self._surface, attributes=tuple(attributes))
