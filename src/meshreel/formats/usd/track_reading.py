"""Tracks of a mesh of a stage: what of it changes from frame to frame."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import Field, Key, field_tracks
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.scenes.turned_values import turned_vectors
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.holes import Mask
from meshreel.formats.usd.instanced_mesh import InstancedMesh
from meshreel.formats.usd.mesh_reading import StageMesh
from meshreel.formats.usd.quantities import TRACK_KIND, TRACK_NAME, UNIT, Quantity, quantities
from meshreel.formats.usd.sampling import TOLERANCE, Codes
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackSource

UNFIT = "primvars that do not fit their faces"
COLOR, OPACITY = "displayColor", "displayOpacity"


class MeshTracks:
    """What a mesh carries that changes over its frames.

    Parameters
    ----------
    codes : Codes
        The time codes of its frames.
    notes : list of str
        Gains a sentence for each thing that is not read.
    """

    def __init__(self, mesh: StageMesh | InstancedMesh, codes: Codes, notes: list[str]) -> None:
        self._mesh, self._codes, self._notes = mesh, codes, notes

    @cached_property
    def moving(self) -> dict[str, Quantity]:
        """What changes, by its name in the file.

        Of a mesh that a skeleton moves, normals and velocities are not moved, and none of it.
        """
        is_skinned = self._mesh.skin is not None
        found = (one for one in quantities(self._mesh.prim) if not (is_skinned and one.to_world))
        with usd_errors(f"USD cannot read what {self._mesh.path} carries"):
            return {one.name: one for one in found if one.is_moving(self._codes)}

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """The tracks of some frames, whose faces are the same."""
        if not self.moving:
            return {}
        codes = [float(self._codes[index]) for index in frames]
        named = {(one.domain, name): one for name, one in _named(self.moving).items()}
        with usd_errors(f"USD cannot read what {self._mesh.path} carries"):
            self._note_samples()
            whole = self._mesh.whole(codes[0])
            solid = self._mesh.shape.solid_faces(len(whole.counts), codes[0])
            n_copies = self._mesh.n_copies(codes[0])
            fields = [self._fields(named, code, whole) for code in codes]
        fitting = {key for frame in fields for key in frame}
        note_kinds(self._notes, UNFIT, (name for _, name in named.keys() - fitting))
        kept = {domain: np.tile(rows, n_copies) for domain, rows in _kept(whole, solid).items()}
        sizes = {domain: int(np.count_nonzero(rows)) for domain, rows in kept.items()}

        def read(index: int, key: Key) -> Values:
            with usd_errors(f"USD cannot read what {self._mesh.path} carries"):
                values = self._values(named[key], codes[index], whole)
                if values is not None:
                    values = self._mesh.in_world(named[key], values, whole.counts, codes[index])
            if values is None or len(values) != len(kept[key[0]]):
                raise changed_error(f"{self._mesh.path} (time code {codes[index]:g})")
            return values[kept[key[0]]]

        return field_tracks(fields, sizes, read, self._notes)

    def _fields(
        self, named: Mapping[Key, Quantity], code: float, whole: PolygonMesh
    ) -> dict[Key, Field]:
        fields: dict[Key, Field] = {}
        for key, one in named.items():
            values = self._values(one, code, whole)
            if values is not None:
                kind = one.said(TRACK_KIND) or one.kind
                unit = one.said(UNIT)
                fields[key] = Field(values.dtype, values.shape[1], one.role, kind, unit)
        return fields

    def _values(self, one: Quantity, code: float, whole: PolygonMesh) -> Values | None:
        """Values in the order of the file, of all faces of the mesh."""
        counts = len(whole.vertices), len(whole.counts), len(whole.corners)
        return one.values(code, dict(zip(Domain, counts, strict=True))[one.domain])

    def _note_samples(self) -> None:
        """Tell of samples where there are no frames."""
        found = []
        for one in self.moving.values():
            own = np.asarray(one.codes)
            places = np.searchsorted(self._codes, own - TOLERANCE).clip(0, len(self._codes) - 1)
            n_other = int((np.abs(self._codes[places] - own) > TOLERANCE).sum())
            if n_other:
                found.append(f"{one.name} ({n_other} of {len(own)})")
        note_kinds(self._notes, "samples where positions have no frame", found)
        has_rates = any(one.to_world is turned_vectors for one in self.moving.values())
        if has_rates and self._mesh.has_moving_transform:
            note_left_out(self._notes, f"what transforms add to velocities of {self._mesh.path}")


def _named(moving: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """What changes, by the names of tracks: those that we wrote if there are, or of the file.

    A colour and its opacity are one if they are given alike.
    """
    found = dict(moving)
    color, opacity = found.get(COLOR), found.get(OPACITY)
    if color is not None and opacity is not None and _are_alike(color, opacity):
        found[COLOR] = replace(color, given=partial(_joined, color, opacity))
        del found[OPACITY]
    said = {name: one.said(TRACK_NAME) or name for name, one in found.items()}
    every = list(said.values())
    return {said[name] if every.count(said[name]) == 1 else name: found[name] for name in found}


def _are_alike(color: Quantity, opacity: Quantity) -> bool:
    is_alike = (color.domain, color.is_constant) == (opacity.domain, opacity.is_constant)
    is_one = color.said(TRACK_NAME) == opacity.said(TRACK_NAME)
    return is_alike and is_one and color.codes == opacity.codes


def _joined(color: Quantity, opacity: Quantity, code: float) -> Values | None:
    """Four numbers; None where the two do not fit."""
    first, second = color.given(code), opacity.given(code)
    if first is None or second is None or len(first) != len(second) or second.shape[1] != 1:
        return None
    return np.concatenate([first, second], axis=1)


def _kept(mesh: PolygonMesh, solid: Mask | None) -> dict[Domain, Mask]:
    """The vertices, faces and corners that are not of holes."""
    faces = np.ones(len(mesh.counts), bool) if solid is None else solid
    return {
        Domain.VERTEX: np.ones(len(mesh.vertices), bool),
        Domain.FACE: faces,
        Domain.CORNER: np.repeat(faces, mesh.counts),
    }
