"""The steps of an animated VTK mesh: arrays that never change are attributes, others are tracks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import Field, Key, add_field, field_tracks
from meshreel.formats.surfaces.cells import CellSurface
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.vtk.mesh import DataArray, surface_of_arrays
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain, Surface
from meshreel.model.tracks import TrackSource


@dataclass(frozen=True, eq=False)
class StepArray:
    """An array of a step, with values at all points or cells, that is read on demand.

    Parameters
    ----------
    domain : Domain
        Vertices for points, faces for cells.
    identity : object
        Equal in two steps if the values are equal; found without reading them.
    read : function
        Reads the array.
    describe : function
        Returns its description, or None if it cannot be a track.
    is_track : bool, default False
        Whether the file declares it a track, even if it never changes.
    is_attribute : bool, default False
        Whether the file declares it an attribute, which changes only with the faces.
    """

    name: str
    domain: Domain
    identity: Any
    read: Callable[[], DataArray]
    describe: Callable[[], Field | None]
    is_track: bool = False
    is_attribute: bool = False

    @property
    def key(self) -> Key:
        """Domain and name."""
        return self.domain, self.name


@dataclass(frozen=True, eq=False)
class Step:
    """The mesh of a step.

    Parameters
    ----------
    n_points, n_cells : int
    surface : CellSurface
        Of its cells.
    read_points : function
        Reads the points.
    arrays : sequence of StepArray
    """

    n_points: int
    n_cells: int
    surface: CellSurface
    read_points: Callable[[], Vertices]
    arrays: Sequence[StepArray]


class StepFrames:
    """Frames, surfaces and tracks of a `SceneMesh` whose steps are read on demand.

    Parameters
    ----------
    read : function of a step number
    notes : list of str
        Receives a sentence for each thing that is left out.
    """

    def __init__(self, read: Callable[[int], Step], notes: list[str]) -> None:
        self._read, self._notes = read, notes
        self._identities: dict[int, dict[Key, list[Any]]] = {}
        self._tracks: set[Key] = set()
        self._attributes: set[Key] = set()

    def frame(self, index: int) -> PolygonMesh:
        """Return the surface of a step, whose arrays are compared with those of other frames."""
        step = self._read(index)
        identities: dict[Key, list[Any]] = {}
        for array in step.arrays:
            identities.setdefault(array.key, []).append(array.identity)
            self._tracks |= {array.key} if array.is_track else set()
            self._attributes |= {array.key} if array.is_attribute else set()
        self._identities[index] = identities
        return step.surface.mesh(step.read_points())

    def constant_arrays(self, index: int) -> list[StepArray]:
        """Return the arrays of a step that are the same in all frames read so far."""
        changing = self._changing()
        return [array for array in self._read(index).arrays if array.key not in changing]

    def surface(self, index: int) -> Surface:
        """Return the arrays of a step that are the same in all frames read so far."""
        step, arrays = self._read(index), self.constant_arrays(index)
        at_points, at_cells = (
            [array.read() for array in arrays if array.domain is domain]
            for domain in (Domain.VERTEX, Domain.FACE)
        )
        return surface_of_arrays(
            at_points, at_cells, step.n_points, step.n_cells, step.surface, self._notes
        )

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return the other arrays as tracks of consecutive steps that share their faces."""
        changing = self._changing()
        described: list[dict[Key, Field]] = []
        for index in frames if changing else ():
            fields: dict[Key, Field] = {}
            for array in self._read(index).arrays:
                if array.key in changing and (field := array.describe()) is not None:
                    add_field(fields, array.key, field)
            described.append(fields)

        def read(index: int, key: Key) -> Values:
            step = self._read(frames[index])
            values = next(array for array in step.arrays if array.key == key).read().values
            n_items = step.n_points if key[0] is Domain.VERTEX else step.n_cells
            return values.reshape(n_items, -1)[step.surface.source_rows[key[0]]]

        step = self._read(frames.start)
        n_verts = step.surface.n_verts(step.n_points)
        sizes = {Domain.VERTEX: n_verts, Domain.FACE: len(step.surface.cells)}
        return field_tracks(described, sizes, read, self._notes)

    def _changing(self) -> set[Key]:
        """Arrays that differ or are missing in some frames read so far, or are declared tracks."""
        steps = list(self._identities.values())
        keys = {key for identities in steps for key in identities}
        differing = {key for key in keys if any(one.get(key) != steps[0].get(key) for one in steps)}
        return self._tracks | (differing - self._attributes)
