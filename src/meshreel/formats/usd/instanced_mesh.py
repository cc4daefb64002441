"""Copies of a mesh that a point instancer makes, as one mesh, frame by frame."""

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
from meshreel.formats.usd.mesh_reading import StageMesh, flipped_corners, mesh_samples
from meshreel.formats.usd.mesh_shape import MeshShape
from meshreel.formats.usd.primitives import PrimitiveShape
from meshreel.formats.usd.quantities import Quantity
from meshreel.formats.usd.sampling import Samples
from meshreel.formats.usd.skinning import Skin
from meshreel.formats.usd.transforms import placed_copies
from meshreel.model.geometry.hard_edges import joined_edges
from meshreel.model.surface import Attribute, Domain, Int32s, Surface
from meshreel.runtime.counting import counted

MAX_FRAME_BYTES = 1 << 30
"""Of the positions and faces of all copies in one frame."""

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class InstancedMesh:
    """All copies of a mesh of a prototype, one after the other.

    Parameters
    ----------
    path : str
        What it is called; the mesh itself may be copied by other instancers too.
    mesh : StageMesh
        In the space of the prototype.
    """

    path: str
    mesh: StageMesh
    placements: Placements

    @property
    def prim(self) -> Any:
        """The prim of the mesh that is copied."""
        return self.mesh.prim

    @property
    def skin(self) -> Skin | None:
        """How a skeleton moves the mesh."""
        return self.mesh.skin

    @property
    def shape(self) -> MeshShape | PrimitiveShape:
        """Points and faces of the mesh in its own space."""
        return self.mesh.shape

    @property
    def notes(self) -> MeshNotes:
        """Notes on meshes of the file."""
        return self.mesh.notes

    @property
    def has_moving_transform(self) -> bool:
        """Whether the copies move, or the mesh within its prototype."""
        return len(set(self.placements.codes)) > 1 or self.mesh.has_moving_transform

    @cached_property
    def samples(self) -> Samples:
        """The time codes where the mesh, its copies or what is above them has samples."""
        stored, keys = self.mesh.motion_codes
        return mesh_samples(stored, keys + self.placements.codes, self.prim)

    def frame(self, code: float) -> PolygonMesh:
        """All copies in world space at a time code; faces of mirrored ones are reversed.

        Raises
        ------
        FormatError
            If there are none then, they are too many, or the mesh cannot be read.
        """
        with usd_errors(f"USD cannot read {self.path} at time code {code:g}"):
            one, matrices = self.mesh.frame(code), self.placements.world(code)
            if not len(matrices):
                raise FormatError(
                    f"{self.path} has no instance at time code {code:g}, where its frame would be "
                    "empty; remove such time codes, or take another mesh with --object (object=)"
                )
            size_bytes = len(matrices) * (24 * len(one.vertices) + 4 * len(one.corners))
            n_verts = len(matrices) * len(one.vertices)
            if size_bytes > MAX_FRAME_BYTES or n_verts > np.iinfo(np.int32).max:
                raise FormatError(
                    f"{self.path}: {len(matrices)} instances of {len(one.vertices)} vertices take "
                    f"{size_bytes:.3g} bytes; at most {MAX_FRAME_BYTES} are read"
                )
            return PolygonMesh(
                placed_copies(one.vertices, matrices), *_copied_faces(one, _mirrored(matrices))
            )

    def surface(self, code: float, moving: Collection[str] = ()) -> Surface:
        """Attributes and groups of the mesh, for every copy, as `StageMesh.surface` has them."""
        surface = self.mesh.surface(code, moving)
        frame = self.mesh.frame(code)
        with usd_errors(f"USD cannot read the instances of {self.path} at time code {code:g}"):
            return _copied_surface(surface, frame, _mirrored(self.placements.world(code)))

    def whole(self, code: float) -> PolygonMesh:
        """All faces of the mesh that is copied, as `StageMesh.whole` has them."""
        return self.mesh.whole(code)

    def n_copies(self, code: float) -> int:
        """How many copies there are at a time code."""
        return len(self.placements.world(code))

    def in_world(
        self, one: Quantity, values: Values, counts: npt.NDArray[np.int64], code: float
    ) -> Values:
        """Values of the mesh for every copy, turned as each is; of shape (I * N, C)."""
        own = self.mesh.in_world(one, values, counts, code)
        matrices = self.placements.world(code)
        copies = [own if one.to_world is None else one.to_world(own, each) for each in matrices]
        if one.domain is Domain.CORNER:
            order = flipped_corners(counts)
            pairs = zip(copies, _mirrored(matrices), strict=True)
            copies = [each[order] if is_mirrored else each for each, is_mirrored in pairs]
        return np.concatenate(copies) if copies else own[:0]


def note_instances(meshes: Sequence[InstancedMesh], notes: list[str]) -> None:
    """Tell of the instances of a file: how many there are, which are left out, which change.

    Parameters
    ----------
    meshes : sequence of InstancedMesh
    """
    if not meshes:
        return
    instancers = {one.instancer.path: one.instancer for m in meshes for one in m.placements.levels}
    counts, masked, changing, own = [], [], [], dict[str, None]()
    for path, one in instancers.items():
        with suppress(FormatError):  # which reading its meshes raises again
            _, is_drawn = one.selection(min(one.selection_codes, default=0.0))
            counts.append(int(np.count_nonzero(is_drawn)))
            if not is_drawn.all():
                masked.append(f"{np.count_nonzero(~is_drawn)} of {len(is_drawn)} of {path}")
            if one.changes():
                changing.append(path)
        own |= dict.fromkeys(one.own_values)
    where = f" of {len(counts)} point instancers" if len(counts) > 1 else ""
    notes.append(f"baked {counted(sum(counts), 'instance')}{where}, those of a mesh as one mesh")
    if masked:
        note_left_out(notes, f"instances that are inactive or invisible: {listed(masked)}")
    if changing:
        notes.append(
            f"which instances are drawn changes over time: {listed(changing)}; vertices of a frame "
            "belong to the instances of that frame, in the order of the file"
        )
    if own:
        note_left_out(notes, f"values of instances: {listed(own)}")


def _mirrored(matrices: npt.NDArray[np.float64]) -> Mask:
    with np.errstate(all="ignore"):
        found: Mask = np.linalg.det(matrices[:, :3, :3]) < 0
    return found


def _copied_faces(
    mesh: PolygonMesh, is_mirrored: Mask
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int32]]:
    starts = len(mesh.vertices) * np.arange(len(is_mirrored), dtype=np.int32)
    corners = np.tile(mesh.corners, (len(is_mirrored), 1))
    corners[is_mirrored] = mesh.corners[flipped_corners(mesh.counts)]
    return np.tile(mesh.counts, len(is_mirrored)), (corners + starts[:, np.newaxis]).ravel()


def _copied_surface(surface: Surface, frame: PolygonMesh, is_mirrored: Mask) -> Surface:
    n_copies = len(is_mirrored)

    def copied(one: Attribute) -> Attribute:
        given: Int32s | None = one.indices
        items = np.arange(len(one.values), dtype=np.int32) if given is None else given
        rows = np.tile(items, (n_copies, 1))
        if one.domain is Domain.CORNER:
            rows[is_mirrored] = items[flipped_corners(frame.counts)]
        return replace(one, indices=rows.ravel())

    groups = (replace(one, numbers=np.tile(one.numbers, n_copies)) for one in surface.groups)
    return replace(
        surface,
        attributes=tuple(copied(one) for one in surface.attributes),
        groups=tuple(groups),
        hard_edges=joined_edges([surface.hard_edges] * n_copies, [len(frame.vertices)] * n_copies),
    )
