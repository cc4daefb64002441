"""Reading tracks of a mesh of a stage: quantities that change from frame to frame."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import Field, Key, field_tracks
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.scenes.vector_transforms import transform_vectors
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.instanced_mesh import InstancedMesh
from meshreel.formats.usd.mesh_reading import StageMesh
from meshreel.formats.usd.mesh_shape import Mask
from meshreel.formats.usd.quantities import TRACK_KIND, TRACK_NAME, UNIT, Quantity, quantities
from meshreel.formats.usd.sampling import TOLERANCE, Codes
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackSource

MISMATCHED = "primvars that do not fit their faces"
COLOR, OPACITY = "displayColor", "displayOpacity"


class MeshTracks:
    """The quantities of a mesh that change over its frames, as tracks.

    Parameters
    ----------
    codes : Codes
        Time codes of its frames.
    notes : list of str
        Gains a sentence for each quantity that is not read.
    """

    def __init__(self, mesh: StageMesh | InstancedMesh, codes: Codes, notes: list[str]) -> None:
        self._mesh, self._codes, self._notes = mesh, codes, notes

    @cached_property
    def animated(self) -> dict[str, Quantity]:
        """The animated quantities, by name in the file.

        Normals and velocities of skinned meshes are skipped, since skinning does not deform them.
        """
        is_skinned = self._mesh.skin is not None
        candidates = (
            one for one in quantities(self._mesh.prim) if not (is_skinned and one.to_world)
        )
        with usd_errors(f"USD cannot read the properties of {self._mesh.path}"):
            return {one.name: one for one in candidates if one.is_animated(self._codes)}

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return the tracks over a range of frames with the same faces."""
        if not self.animated:
            return {}
        codes = [float(self._codes[index]) for index in frames]
        tracks = {(one.domain, name): one for name, one in _by_track_name(self.animated).items()}
        with usd_errors(f"USD cannot read the properties of {self._mesh.path}"):
            self._note_samples()
            mesh = self._mesh.all_faces(codes[0])
            solid = self._mesh.shape.solid_faces(len(mesh.counts), codes[0])
            n_instances = self._mesh.n_instances(codes[0])
            fields = [self._fields(tracks, code, mesh) for code in codes]
        fitting = {key for frame in fields for key in frame}
        note_kinds(self._notes, MISMATCHED, (name for _, name in tracks.keys() - fitting))
        masks = _item_masks(mesh, solid)
        kept = {domain: np.tile(mask, n_instances) for domain, mask in masks.items()}
        sizes = {domain: int(np.count_nonzero(mask)) for domain, mask in kept.items()}

        def read(index: int, key: Key) -> Values:
            with usd_errors(f"USD cannot read the properties of {self._mesh.path}"):
                values = self._values(tracks[key], codes[index], mesh)
                if values is not None:
                    values = self._mesh.in_world(tracks[key], values, mesh.counts, codes[index])
            if values is None or len(values) != len(kept[key[0]]):
                raise changed_error(f"{self._mesh.path} (time code {codes[index]:g})")
            return values[kept[key[0]]]

        return field_tracks(fields, sizes, read, self._notes)

    def _fields(
        self, tracks: Mapping[Key, Quantity], code: float, mesh: PolygonMesh
    ) -> dict[Key, Field]:
        fields: dict[Key, Field] = {}
        for key, one in tracks.items():
            values = self._values(one, code, mesh)
            if values is not None:
                kind = one.custom_data(TRACK_KIND) or one.kind
                unit = one.custom_data(UNIT)
                fields[key] = Field(values.dtype, values.shape[1], one.role, kind, unit)
        return fields

    def _values(self, one: Quantity, code: float, mesh: PolygonMesh) -> Values | None:
        """Return values in file order, for all faces of the mesh."""
        counts = len(mesh.vertices), len(mesh.counts), len(mesh.corners)
        return one.values(code, dict(zip(Domain, counts, strict=True))[one.domain])

    def _note_samples(self) -> None:
        """Note samples that no frame has, and velocities of animated transforms."""
        names = []
        for one in self.animated.values():
            own = np.asarray(one.codes)
            nearest = np.searchsorted(self._codes, own - TOLERANCE).clip(0, len(self._codes) - 1)
            n_other = int((np.abs(self._codes[nearest] - own) > TOLERANCE).sum())
            if n_other:
                names.append(f"{one.name} ({n_other} of {len(own)})")
        note_kinds(self._notes, "samples where positions have no frame", names)
        has_rates = any(one.to_world is transform_vectors for one in self.animated.values())
        if has_rates and self._mesh.has_moving_transform:
            note_left_out(self._notes, f"velocity of the transforms above {self._mesh.path}")


def _by_track_name(animated: Mapping[str, Quantity]) -> dict[str, Quantity]:
    """Return animated quantities by track name: as written by meshreel, or else as in the file.

    A color and its opacity become one quantity if they have the same items.
    """
    by_name = dict(animated)
    color, opacity = by_name.get(COLOR), by_name.get(OPACITY)
    if color is not None and opacity is not None and _have_same_items(color, opacity):
        by_name[COLOR] = replace(color, read=partial(_read_rgba, color, opacity))
        del by_name[OPACITY]
    names = {name: one.custom_data(TRACK_NAME) or name for name, one in by_name.items()}
    every = list(names.values())
    return {
        names[name] if every.count(names[name]) == 1 else name: by_name[name] for name in by_name
    }


def _have_same_items(color: Quantity, opacity: Quantity) -> bool:
    is_same_layout = (color.domain, color.is_constant) == (opacity.domain, opacity.is_constant)
    is_same_track = color.custom_data(TRACK_NAME) == opacity.custom_data(TRACK_NAME)
    return is_same_layout and is_same_track and color.codes == opacity.codes


def _read_rgba(color: Quantity, opacity: Quantity, code: float) -> Values | None:
    """Return color and opacity as four components, or None if their counts differ."""
    first, second = color.read(code), opacity.read(code)
    if first is None or second is None or len(first) != len(second) or second.shape[1] != 1:
        return None
    return np.concatenate([first, second], axis=1)


def _item_masks(mesh: PolygonMesh, solid: Mask | None) -> dict[Domain, Mask]:
    """Return masks of the vertices, faces and corners that do not belong to holes."""
    faces = np.ones(len(mesh.counts), bool) if solid is None else solid
    return {
        Domain.VERTEX: np.ones(len(mesh.vertices), bool),
        Domain.FACE: faces,
        Domain.CORNER: np.repeat(faces, mesh.counts),
    }
