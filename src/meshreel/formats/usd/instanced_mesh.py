"""A mesh with all its instances by a point instancer, as one mesh, frame by frame."""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.errors import FormatError
from meshreel.formats.notes import listed, note_left_out
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.instancers import Placements
from meshreel.formats.usd.mesh_notes import MeshNotes
from meshreel.formats.usd.mesh_reading import StageMesh, mesh_samples, reversed_corners
from meshreel.formats.usd.mesh_shape import MeshShape
from meshreel.formats.usd.primitives import PrimitiveShape
from meshreel.formats.usd.quantities import Quantity
from meshreel.formats.usd.sampling import Samples
from meshreel.formats.usd.skinning import Skin
from meshreel.formats.usd.transforms import transform_instances
from meshreel.model.geometry.hard_edges import merged_edges
from meshreel.model.surface import Attribute, Domain, Int32s, Surface
from meshreel.runtime.counting import counted

MAX_FRAME_BYTES = 1 << 30
"""Limit of positions and faces of all instances in a frame."""

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class InstancedMesh:
    """All instances of a mesh of a prototype, concatenated.

    Parameters
    ----------
    path : str
        Name of the result; other instancers may instance the same mesh.
    mesh : StageMesh
        In the space of the prototype.
    placements : Placements
        Transforms of the instances.
    """

    path: str
    mesh: StageMesh
    placements: Placements

    @property
    def prim(self) -> Any:
        """The prim of the mesh."""
        return self.mesh.prim

    @property
    def skin(self) -> Skin | None:
        """The skinning of the mesh, if any."""
        return self.mesh.skin

    @property
    def shape(self) -> MeshShape | PrimitiveShape:
        """Points and faces of the mesh in its local space."""
        return self.mesh.shape

    @property
    def notes(self) -> MeshNotes:
        """Notes on the meshes of the file."""
        return self.mesh.notes

    @property
    def has_moving_transform(self) -> bool:
        """Whether the instances move, or the mesh within its prototype."""
        return len(set(self.placements.codes)) > 1 or self.mesh.has_moving_transform

    @cached_property
    def samples(self) -> Samples:
        """Time codes where the mesh, its instances or prims above them have samples."""
        stored, keys = self.mesh.motion_codes
        return mesh_samples(stored, keys + self.placements.codes, self.prim)

    def frame(self, code: float) -> PolygonMesh:
        """Return all instances in world space at a time code; mirrored faces are reversed.

        Raises
        ------
        FormatError
            If there are no instances at the time code, or too many, or the mesh cannot be read.
        """
        with usd_errors(f"USD cannot read {self.path} at time code {code:g}"):
            one, matrices = self.mesh.frame(code), self.placements.world(code)
            if not len(matrices):
                raise FormatError(
                    f"{self.path} has no instance at time code {code:g}, so its frame would be "
                    "empty; remove such time codes, or select another mesh with --object (object=)"
                )
            size_bytes = len(matrices) * (24 * len(one.vertices) + 4 * len(one.corners))
            n_verts = len(matrices) * len(one.vertices)
            if size_bytes > MAX_FRAME_BYTES or n_verts > np.iinfo(np.int32).max:
                raise FormatError(
                    f"{self.path}: {len(matrices)} instances of {len(one.vertices)} vertices need "
                    f"{size_bytes:.3g} bytes; the limit is {MAX_FRAME_BYTES}"
                )
            return PolygonMesh(
                transform_instances(one.vertices, matrices),
                *_instance_faces(one, _mirrored(matrices)),
            )

    def surface(self, code: float, animated: Collection[str] = ()) -> Surface:
        """Return the attributes and groups of all instances, as in `StageMesh.surface`."""
        surface = self.mesh.surface(code, animated)
        frame = self.mesh.frame(code)
        with usd_errors(f"USD cannot read the instances of {self.path} at time code {code:g}"):
            return _instance_surface(surface, frame, _mirrored(self.placements.world(code)))

    def all_faces(self, code: float) -> PolygonMesh:
        """Return all faces of a single instance, as in `StageMesh.all_faces`."""
        return self.mesh.all_faces(code)

    def n_instances(self, code: float) -> int:
        """Return the number of instances at a time code."""
        return len(self.placements.world(code))

    def in_world(
        self, one: Quantity, values: Values, counts: npt.NDArray[np.int64], code: float
    ) -> Values:
        """Return values of a mesh for every instance, transformed with it, of shape (I * N, C)."""
        own = self.mesh.in_world(one, values, counts, code)
        matrices = self.placements.world(code)
        copies = [own if one.to_world is None else one.to_world(own, each) for each in matrices]
        if one.domain is Domain.CORNER:
            order = reversed_corners(counts)
            pairs = zip(copies, _mirrored(matrices), strict=True)
            copies = [each[order] if is_mirrored else each for each, is_mirrored in pairs]
        return np.concatenate(copies) if copies else own[:0]


def note_instances(meshes: Sequence[InstancedMesh], notes: list[str]) -> None:
    """Note the instances of a file: their number, those left out, and changes over time.

    Parameters
    ----------
    meshes : sequence of InstancedMesh
    notes : list of str
        Gains the sentences.
    """
    if not meshes:
        return
    instancers = {one.instancer.path: one.instancer for m in meshes for one in m.placements.levels}
    counts, masked, changing, primvars = [], [], [], dict[str, None]()
    for path, one in instancers.items():
        with suppress(FormatError):  # raised again when its meshes are read
            _, is_rendered = one.selection(min(one.selection_codes, default=0.0))
            counts.append(int(np.count_nonzero(is_rendered)))
            if not is_rendered.all():
                masked.append(f"{np.count_nonzero(~is_rendered)} of {len(is_rendered)} of {path}")
            if one.selection_changes():
                changing.append(path)
        primvars |= dict.fromkeys(one.instance_primvars)
    where = f" of {len(counts)} point instancers" if len(counts) > 1 else ""
    notes.append(
        f"baked {counted(sum(counts), 'instance')}{where} into one mesh per prototype mesh"
    )
    if masked:
        note_left_out(notes, f"instances that are inactive or invisible: {listed(masked)}")
    if changing:
        notes.append(
            f"the rendered instances change over time: {listed(changing)}; the vertices of a frame "
            "are those of the instances in that frame, in file order"
        )
    if primvars:
        note_left_out(notes, f"primvars of instances: {listed(primvars)}")


def _mirrored(matrices: npt.NDArray[np.float64]) -> Mask:
    with np.errstate(all="ignore"):
        is_mirrored: Mask = np.linalg.det(matrices[:, :3, :3]) < 0
    return is_mirrored


def _instance_faces(
    mesh: PolygonMesh, is_mirrored: Mask
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    starts = len(mesh.vertices) * np.arange(len(is_mirrored), dtype=np.int32)
    corners = np.tile(mesh.corners, (len(is_mirrored), 1))
    corners[is_mirrored] = mesh.corners[reversed_corners(mesh.counts)]
    return np.tile(mesh.counts, len(is_mirrored)), (corners + starts[:, np.newaxis]).ravel()


def _instance_surface(surface: Surface, frame: PolygonMesh, is_mirrored: Mask) -> Surface:
    n_instances = len(is_mirrored)

    def instance(one: Attribute) -> Attribute:
        indices: Int32s | None = one.indices
        items = np.arange(len(one.values), dtype=np.int32) if indices is None else indices
        rows = np.tile(items, (n_instances, 1))
        if one.domain is Domain.CORNER:
            rows[is_mirrored] = items[reversed_corners(frame.counts)]
        return replace(one, indices=rows.ravel())

    groups = (replace(one, numbers=np.tile(one.numbers, n_instances)) for one in surface.groups)
    return replace(
        surface,
        attributes=tuple(instance(one) for one in surface.attributes),
        groups=tuple(groups),
        hard_edges=merged_edges(
            [surface.hard_edges] * n_instances, [len(frame.vertices)] * n_instances
        ),
    )
