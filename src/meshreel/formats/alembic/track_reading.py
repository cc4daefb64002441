"""Tracks of an Alembic mesh: properties other than positions that change over time."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.alembic.archive import Property
from meshreel.formats.alembic.attributes import (
    COMPUTED,
    NORMALS,
    VELOCITIES,
    GeometryParam,
    Properties,
    domain_of,
    segment_attributes,
)
from meshreel.formats.alembic.time_sampling import Times, bracketing_samples
from meshreel.formats.alembic.winding import reversed_corners
from meshreel.formats.frames.field_tracks import NORMALS as NORMALS_ROLE
from meshreel.formats.frames.field_tracks import Field, Key, field_tracks
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.scenes.merging import BLENDED
from meshreel.formats.scenes.vector_transforms import Matrix, transform_normals, transform_vectors
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import Domain, Kind
from meshreel.model.tracks import NUMBER_TYPES, TrackKind, TrackSource

TRACK_KIND, UNIT = "meshreelKind", "unit"
"""Metadata keys of properties that meshreel writes for tracks."""

UNSUPPORTED = "properties that do not fit the mesh or are not numeric"


@dataclass(frozen=True, eq=False)
class _AnimatedProperty:
    """A property that changes over time, and the track that it becomes.

    Parameters
    ----------
    name : str
        Name of the track.
    kind : str
        Kind of the track if declared, otherwise empty.
    role : str, optional
        `NORMALS_ROLE` if the values are normals.
    to_world : function of values and a matrix, optional
        Transforms the values with the mesh.
    """

    source: Property
    name: str
    kind: str
    role: str = ""
    to_world: Callable[[Values, Matrix], Values] | None = None

    @property
    def domain(self) -> Domain | None:
        """The declared domain of the values."""
        if self.source.header.name == VELOCITIES:
            return Domain.VERTEX
        return self._param(0.0).domain

    @property
    def unit(self) -> str:
        return self._param(0.0).metadata(UNIT)

    @property
    def times_s(self) -> Times:
        """Times at which it is sampled."""
        return self._param(0.0).times_s

    def values(self, time_s: float) -> Values | None:
        """Return the values of all items at a time, of shape (N, C); None if not numeric."""
        before, after, weight = bracketing_samples(self.times_s, time_s)
        first = self._param(float(self.times_s[before])).item_values()
        if first is None or first.dtype not in NUMBER_TYPES:
            return None
        is_interpolated = not self.kind or self.kind in BLENDED
        if weight == 0 or not is_interpolated or self.role or first.dtype.kind != "f":
            return first
        second = self._param(float(self.times_s[after])).item_values()
        if second is None or second.shape != first.shape:
            return first
        with np.errstate(all="ignore"):
            blend: Values = (1 - weight) * first.astype(np.float64) + weight * second
        return blend.astype(first.dtype)

    def _param(self, time_s: float) -> GeometryParam:
        return GeometryParam(self.source, time_s)


@dataclass(frozen=True, eq=False)
class MeshTracks:
    """The animated properties of a mesh, as tracks.

    Parameters
    ----------
    geometry : dict of Property
        Properties of the mesh.
    notes : list of str
        Gains a sentence for properties that are not read.
    """

    path: str
    geometry: Properties
    notes: list[str] = field(repr=False)

    @cached_property
    def properties(self) -> dict[str, _AnimatedProperty]:
        """The animated properties by property name, each with a unique track name."""
        animated_properties: dict[str, _AnimatedProperty] = {}
        used: set[str] = set()
        for one in self._candidates():
            name = one.name
            while name in used:
                name += "_"
            used.add(name)
            if name != one.name:
                self.notes.append(
                    f"{self.path} has {one.name!r} twice; the second is called {name!r}"
                )
            animated_properties[one.source.header.name] = replace(one, name=name)
        return animated_properties

    @property
    def times_s(self) -> list[Times]:
        """Sample times of each animated property."""
        return [one.times_s for one in self.properties.values()]

    def tracks(
        self,
        times_s: Times,
        mesh: PolygonMesh,
        world: Callable[[float], Matrix],
        all_times_s: Times,
        *,
        is_transform_animated: bool,
    ) -> Mapping[str, TrackSource]:
        """Return the tracks over a range of frames.

        Parameters
        ----------
        times_s : float64 array
            Times of the frames.
        mesh : PolygonMesh
            The mesh, whose faces are the same in these frames.
        world : function of a time
            Returns the world matrix.
        all_times_s : float64 array
            Times of all frames of the mesh.
        is_transform_animated : bool
            Whether the world matrix changes.
        """
        if not self.properties:
            return {}
        self._note(all_times_s, is_transform_animated=is_transform_animated)
        fitting = dict(self._fitting(times_s, mesh))
        counts = len(mesh.vertices), len(mesh.counts), len(mesh.corners)
        sizes = dict(zip(Domain, counts, strict=True))
        order = reversed_corners(mesh.counts)

        def values_of(key: Key, time_s: float) -> Values | None:
            one = fitting[key]
            values = one.values(time_s)
            if values is None or len(values) != sizes[key[0]]:
                return None
            values = values[order] if key[0] is Domain.CORNER else values
            return values if one.to_world is None else one.to_world(values, world(time_s))

        def read(index: int, key: Key) -> Values:
            if (values := values_of(key, float(times_s[index]))) is None:
                raise changed_error(f"{self.path} (frame {index})")
            return values

        frames: list[dict[Key, Field]] = []
        for time_s in times_s.tolist():
            fields: dict[Key, Field] = {}
            for key, one in fitting.items():
                if (values := values_of(key, time_s)) is not None:
                    fields[key] = Field(values.dtype, values.shape[1], one.role, one.kind, one.unit)
            frames.append(fields)
        return field_tracks(frames, sizes, read, self.notes)

    def _candidates(self) -> Iterator[_AnimatedProperty]:
        others = (
            self.geometry[".arbGeomParams"].properties if ".arbGeomParams" in self.geometry else {}
        )
        uvs = [self.geometry["uv"]] if "uv" in self.geometry else []
        marked = segment_attributes(self.geometry)
        for source in [*uvs, *others.values()]:
            if source.header.name in marked:
                continue
            param = GeometryParam(source, 0.0)
            declared = param.metadata(TRACK_KIND)
            is_single = param.domain is None and source not in uvs
            if is_single or param.is_text or (param.is_constant and not declared):
                continue
            kind = declared or ("" if param.kind is Kind.OTHER else str(param.kind))
            role = NORMALS_ROLE if param.interpretation == "normal" else ""
            yield _AnimatedProperty(source, param.name, kind, role)
        user = self.geometry.get(".userProperties")
        is_computed = user is not None and COMPUTED in user.properties
        if NORMALS in self.geometry and not (is_computed or _is_constant(self.geometry[NORMALS])):
            yield _AnimatedProperty(
                self.geometry[NORMALS], NORMALS, "", NORMALS_ROLE, transform_normals
            )
        if VELOCITIES in self.geometry and not self.geometry[VELOCITIES].is_constant:
            source, name = self.geometry[VELOCITIES], VELOCITIES.strip(".")
            yield _AnimatedProperty(source, name, TrackKind.VELOCITY, "", transform_vectors)

    def _fitting(
        self, times_s: Times, mesh: PolygonMesh
    ) -> Iterator[tuple[Key, _AnimatedProperty]]:
        """Yield the properties that fit the mesh at some time, by domain and name."""
        unsupported = []
        for one in self.properties.values():
            for time_s in times_s.tolist():
                values = one.values(time_s)
                domain = None if values is None else domain_of(one.domain, len(values), mesh)
                if domain is not None:
                    yield (domain, one.name), one
                    break
            else:
                unsupported.append(one.name)
        note_kinds(self.notes, UNSUPPORTED, unsupported)

    def _note(self, frames_s: Times, *, is_transform_animated: bool) -> None:
        """Note samples without a frame, and the velocity of animated transforms."""
        names = []
        for one in self.properties.values():
            times = one.times_s
            n_other = sum(not _is_at(frames_s, time_s) for time_s in times.tolist())
            if n_other and len(times) > 1:
                names.append(f"{one.name} ({n_other} of {len(times)})")
        note_kinds(self.notes, "samples where positions have no frame", names)
        if is_transform_animated and VELOCITIES in self.properties:
            note_left_out(self.notes, f"velocity of the transforms above {self.path}")


def _is_constant(values: Property) -> bool:
    return GeometryParam(values, 0.0).is_constant


def _is_at(frames_s: Times, time_s: float) -> bool:
    """Return whether there is a frame at a time."""
    before, _, weight = bracketing_samples(frames_s, time_s)
    margin = 1e-3 * float(frames_s[-1] - frames_s[0]) / max(1, len(frames_s) - 1)
    return weight == 0 and abs(float(frames_s[before]) - time_s) <= margin
