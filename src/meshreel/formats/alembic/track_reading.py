"""Tracks of an Alembic mesh: what of it changes over time beside its positions."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.archive import Property
from meshreel.formats.alembic.attributes import COMPUTED, NORMALS, VELOCITIES, Properties, domain_of
from meshreel.formats.alembic.params import GeometryParam
from meshreel.formats.alembic.time_sampling import Times, between
from meshreel.formats.alembic.winding import turned_corners
from meshreel.formats.frames.field_tracks import NORMALS as ROLE
from meshreel.formats.frames.field_tracks import Field, Key, field_tracks
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.scenes.merged_tracks import BLENDED
from meshreel.formats.scenes.turned_values import Matrix, turned_normals, turned_vectors
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import Domain, Kind
from meshreel.model.tracks import NUMBER_TYPES, TrackKind, TrackSource

Values = npt.NDArray[Any]

TRACK_KIND, UNIT = "meshreelKind", "unit"
"""Entries of the metadata of a property that we write as a track."""

UNFIT = "what does not fit the mesh, or is no numbers"


@dataclass(frozen=True, eq=False)
class _Quantity:
    """A property that changes over time.

    Parameters
    ----------
    found : Property
    name : str
        Of the track.
    kind : str
        Of the track, if the file says it.
    to_world : function of values and a matrix, optional
        Turns them as the mesh is turned.
    """

    found: Property
    name: str
    kind: str
    role: str = ""
    to_world: Callable[[Values, Matrix], Values] | None = None

    @property
    def domain(self) -> Domain | None:
        """As the file says it."""
        if self.found.header.name == VELOCITIES:
            return Domain.VERTEX
        return self._param(0.0).domain

    @property
    def unit(self) -> str:
        return self._param(0.0).said(UNIT)

    @property
    def times_s(self) -> Times:
        """When it has samples."""
        return self._param(0.0).times_s

    def values(self, time_s: float) -> Values | None:
        """Values of all items at a time, of shape (N, C); None if they are no numbers."""
        before, after, share = between(self.times_s, time_s)
        first = self._param(float(self.times_s[before])).every_number()
        if first is None or first.dtype not in NUMBER_TYPES:
            return None
        is_blended = not self.kind or self.kind in BLENDED
        if share == 0 or not is_blended or self.role or first.dtype.kind != "f":
            return first
        second = self._param(float(self.times_s[after])).every_number()
        if second is None or second.shape != first.shape:
            return first
        with np.errstate(all="ignore"):
            blend: Values = (1 - share) * first.astype(np.float64) + share * second
        return blend.astype(first.dtype)

    def _param(self, time_s: float) -> GeometryParam:
        return GeometryParam(self.found, time_s)


@dataclass(frozen=True, eq=False)
class MeshTracks:
    """What a mesh carries that changes over time.

    Parameters
    ----------
    path : str
    geometry : dict of Property
        Those of the mesh.
    notes : list of str
        Gains a sentence for what is not read.
    """

    path: str
    geometry: Properties
    notes: list[str] = field(repr=False)

    @cached_property
    def moving(self) -> dict[str, _Quantity]:
        """What changes, by the name of its property, each with a name that no other has."""
        found: dict[str, _Quantity] = {}
        taken: set[str] = set()
        for one in self._candidates():
            name = one.name
            while name in taken:
                name += "_"
            taken.add(name)
            if name != one.name:
                self.notes.append(f"{self.path} has {one.name!r} twice; one is called {name!r}")
            renamed = _Quantity(one.found, name, one.kind, one.role, one.to_world)
            found[one.found.header.name] = renamed
        return found

    @property
    def times_s(self) -> list[Times]:
        """When each of these is sampled."""
        return [one.times_s for one in self.moving.values()]

    def tracks(
        self,
        times_s: Times,
        mesh: PolygonMesh,
        world: Callable[[float], Matrix],
        every_time_s: Times,
        *,
        is_moved: bool,
    ) -> Mapping[str, TrackSource]:
        """The tracks of some frames.

        Parameters
        ----------
        times_s : float64 array
            Of the frames.
        mesh : PolygonMesh
            Its faces in all of them.
        world : function of a time
            Gives the transform to the world.
        every_time_s : float64 array
            Of all frames of the mesh.
        is_moved : bool
            Whether that changes.
        """
        if not self.moving:
            return {}
        self._note(every_time_s, is_moved=is_moved)
        placed = dict(self._placed(times_s, mesh))
        counts = len(mesh.vertices), len(mesh.counts), len(mesh.corners)
        sizes = dict(zip(Domain, counts, strict=True))
        turned = turned_corners(mesh.counts)

        def values_of(key: Key, time_s: float) -> Values | None:
            one = placed[key]
            values = one.values(time_s)
            if values is None or len(values) != sizes[key[0]]:
                return None
            values = values[turned] if key[0] is Domain.CORNER else values
            return values if one.to_world is None else one.to_world(values, world(time_s))

        def read(index: int, key: Key) -> Values:
            if (values := values_of(key, float(times_s[index]))) is None:
                raise changed_error(f"{self.path} (frame {index})")
            return values

        frames: list[dict[Key, Field]] = []
        for time_s in times_s.tolist():
            fields: dict[Key, Field] = {}
            for key, one in placed.items():
                if (values := values_of(key, time_s)) is not None:
                    fields[key] = Field(values.dtype, values.shape[1], one.role, one.kind, one.unit)
            frames.append(fields)
        return field_tracks(frames, sizes, read, self.notes)

    def _candidates(self) -> Iterator[_Quantity]:
        others = (
            self.geometry[".arbGeomParams"].properties if ".arbGeomParams" in self.geometry else {}
        )
        own = [self.geometry["uv"]] if "uv" in self.geometry else []
        for found in [*own, *others.values()]:
            param = GeometryParam(found, 0.0)
            said = param.said(TRACK_KIND)
            is_whole = param.domain is None and found not in own
            if is_whole or param.is_text or (param.is_constant and not said):
                continue
            kind = said or ("" if param.kind is Kind.OTHER else str(param.kind))
            yield _Quantity(found, param.name, kind, ROLE if param.meaning == "normal" else "")
        user = self.geometry.get(".userProperties")
        is_computed = user is not None and COMPUTED in user.properties
        if NORMALS in self.geometry and not (is_computed or _is_constant(self.geometry[NORMALS])):
            yield _Quantity(self.geometry[NORMALS], NORMALS, "", ROLE, turned_normals)
        if VELOCITIES in self.geometry and not self.geometry[VELOCITIES].is_constant:
            found, name = self.geometry[VELOCITIES], VELOCITIES.strip(".")
            yield _Quantity(found, name, TrackKind.VELOCITY, "", turned_vectors)

    def _placed(self, times_s: Times, mesh: PolygonMesh) -> Iterator[tuple[Key, _Quantity]]:
        """What fits the mesh at some time, by where its values are and its name."""
        unfit = []
        for one in self.moving.values():
            for time_s in times_s.tolist():
                values = one.values(time_s)
                domain = None if values is None else domain_of(one.domain, len(values), mesh)
                if domain is not None:
                    yield (domain, one.name), one
                    break
            else:
                unfit.append(one.name)
        note_kinds(self.notes, UNFIT, unfit)

    def _note(self, frames_s: Times, *, is_moved: bool) -> None:
        """Tell of samples where there are no frames, and of what transforms add."""
        found = []
        for one in self.moving.values():
            times = one.times_s
            n_other = sum(not _is_at(frames_s, time_s) for time_s in times.tolist())
            if n_other and len(times) > 1:
                found.append(f"{one.name} ({n_other} of {len(times)})")
        note_kinds(self.notes, "samples where positions have no frame", found)
        if is_moved and VELOCITIES in self.moving:
            note_left_out(self.notes, f"what transforms add to velocities of {self.path}")


def _is_constant(found: Property) -> bool:
    return GeometryParam(found, 0.0).is_constant


def _is_at(frames_s: Times, time_s: float) -> bool:
    """Whether there is a frame at a time."""
    before, _, share = between(frames_s, time_s)
    margin = 1e-3 * float(frames_s[-1] - frames_s[0]) / max(1, len(frames_s) - 1)
    return share == 0 and abs(float(frames_s[before]) - time_s) <= margin
