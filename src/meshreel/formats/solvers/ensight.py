"""Reader for EnSight Gold cases: parts of elements over time, in text or C binary.

Each part is a mesh of its elements with faces. Positions and values are read when they are needed,
a part at a time; text files are read whole.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Singles
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import Field, Key, add_field, field_tracks
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import file_order_times, note_file_order
from meshreel.formats.solvers.ensight_case import EnsightCase, TimeSet, Variable
from meshreel.formats.solvers.ensight_geometry import (
    Columns,
    Part,
    find_columns,
    find_parts,
    read_cells,
    read_points,
    read_values,
)
from meshreel.formats.solvers.ensight_tables import (
    Tables,
    open_geometry,
    open_variable,
    read_lines,
)
from meshreel.formats.surfaces.cells import CellSurface, extract_surface, used_points
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackSource
from meshreel.model.validation import validate_fps

N_KEPT = 32
"""Files whose tables are remembered."""

SAME_TIME = 1e-5
"""Largest difference of equal times, relative to the interval of frames."""


def read_ensight(path: Path, options: ReadOptions) -> Sequence[SceneMesh]:
    """Return the parts of a case that have faces.

    Raises
    ------
    FormatError
        If a file is missing or damaged, or uses features that are not supported.
    InvalidInputError
        If a file cannot be read.
    """
    case = EnsightCase(path, options)
    steps = _Steps(case, options)
    parts = steps.parts(steps.elements_step(0)).values()
    shown = [part for part in parts if any(block.has_faces for block in part.blocks)]
    if not shown:
        raise FormatError("contains no elements with faces; there is no surface")
    note_kinds(options.notes, "parts without faces", (p.name for p in parts if p not in shown))
    kinds = {block.kind for part in shown for block in part.blocks if not block.has_faces}
    note_kinds(options.notes, "elements of points, lines and ghosts", sorted(kinds))
    names = [part.name for part in shown]
    meshes = []
    for part in shown:
        is_unique = part.name and names.count(part.name) == 1
        name = part.name if is_unique else f"{part.name or 'part'} {part.number}"
        frames = _PartFrames(steps, part.number, name, options.notes)
        label = f"/{name}" if len(shown) > 1 else name
        meshes.append(SceneMesh(label, steps.times_s, frames.frame, tracks=frames.tracks))
    return meshes


class _Steps:
    """The files of a case at each frame.

    Attributes
    ----------
    times_s : float64 array of shape (T,)
        Times of the geometry, or those of the first variable with several if it never changes.
    variables : list of Variable
        Those with values at the times of the frames.
    """

    def __init__(self, case: EnsightCase, options: ReadOptions) -> None:
        self._case = case
        series = [case.geometry, *(one.files for one in case.variables)]
        sets = [one.times for one in series if one.times is not None]
        self._set = next((one for one in sets if len(one.times_s) > 1), next(iter(sets), None))
        if case.geometry.times is not None:
            self._set = case.geometry.times
        stored = np.zeros(1) if self._set is None else self._set.times_s
        self.times_s: Floats = _ascending(stored, options)
        self.variables: list[Variable] = [one for one in case.variables if self._fits(one)]
        others = (one.name for one in case.variables if one not in self.variables)
        note_kinds(options.notes, "variables at other times than the geometry", others)
        self._find = lru_cache(maxsize=N_KEPT)(self._find_parts)
        self._columns = lru_cache(maxsize=N_KEPT)(self._find_columns)
        self._lines = lru_cache(maxsize=2)(read_lines)

    def parts(self, index: int) -> dict[int, Part]:
        """Return the parts of a frame by number."""
        return self._find(self._geometry_file(index))

    def part(self, index: int, number: int) -> Part:
        """Return a part in a frame.

        Raises
        ------
        FormatError
            If the frame lacks the part.
        """
        if (found := self.parts(index).get(number)) is None:
            raise FormatError(
                f"has no part {number} in {self._geometry_file(index).name}; all parts must exist "
                "in all frames"
            )
        return found

    def points(self, index: int, number: int) -> Singles:
        """Read the coordinates of a part.

        Raises
        ------
        FormatError
            If the part has another number of nodes than where its elements are.
        """
        part, whole = self.part(index, number), self.part(self.elements_step(index), number)
        if part.n_nodes != whole.n_nodes:
            raise FormatError(
                f"has {part.n_nodes} nodes in part {number} of {self._geometry_file(index).name}; "
                f"its elements are for {whole.n_nodes}"
            )
        return read_points(self._geometry(index), part)

    def surface(self, index: int, number: int) -> CellSurface:
        """Return the surface of a part; the elements may be those of another step."""
        step = self.elements_step(index)
        part = self.part(step, number)
        cells = read_cells(self._geometry(step), part)
        return used_points(extract_surface(cells, part.n_nodes))

    def elements_step(self, index: int) -> int:
        """Return the frame whose file has the elements of a frame."""
        if self._case.elements_step is not None:
            return min(self._case.elements_step, len(self.times_s) - 1)
        return index if self._case.geometry.times is not None else 0

    def field(self, variable: Variable, index: int, number: int) -> Field | None:
        """Describe a variable of a part in a frame; None if it has no values there."""
        path, step = self._file(variable, index), self.elements_step(index)
        columns = self._columns(path, variable.width, step)
        if all(part != number for part, _ in columns):
            return None
        return Field(np.dtype(np.float32), variable.width, is_track=True)

    def values(self, variable: Variable, index: int, number: int) -> Singles:
        """Read the values of a variable at the nodes or elements of a part."""
        path, step = self._file(variable, index), self.elements_step(index)
        columns = self._columns(path, variable.width, step)
        tables = open_variable(path, self._geometry(step), self._lines)
        at_nodes = variable.domain is Domain.VERTEX
        part = self.part(step, number)
        return read_values(tables, part, columns, variable.width, at_nodes=at_nodes)

    def _find_parts(self, path: Path) -> dict[int, Part]:
        return find_parts(open_geometry(path, self._lines))

    def _find_columns(self, path: Path, width: int, step: int) -> Columns:
        tables = open_variable(path, self._geometry(step), self._lines)
        return find_columns(tables, self.parts(step), width)

    def _geometry(self, index: int) -> Tables:
        return open_geometry(self._geometry_file(index), self._lines)

    def _geometry_file(self, index: int) -> Path:
        return self._case.file(self._case.geometry, index)

    def _file(self, variable: Variable, index: int) -> Path:
        times = variable.files.times
        return self._case.file(variable.files, 0 if times is None else self._step(times, index))

    def _step(self, times: TimeSet, index: int) -> int:
        """Return the step of a time set at the time of a frame."""
        if times is self._set or self._set is None:
            return index
        return int(np.abs(times.times_s - self._set.times_s[index]).argmin())

    def _fits(self, variable: Variable) -> bool:
        """Whether a variable never changes, or has values at the times of all frames."""
        times = variable.files.times
        if times is None or times is self._set or self._set is None:
            return True
        frames = self._set.times_s
        nearest = [np.abs(times.times_s - time).min() for time in frames]
        span = (frames[-1] - frames[0]) / max(1, len(frames) - 1)
        return bool(max(nearest) <= SAME_TIME * abs(span))


def _ascending(times: Floats, options: ReadOptions) -> Floats:
    """Return the times if they ascend, else those of the frame rate of the options."""
    if (np.diff(times) > 0).all():
        return times
    if fps := validate_fps(options.fps or 0.0):
        note_file_order(fps, options.notes)
        return file_order_times(len(times), fps)
    index = int(np.flatnonzero(np.diff(times) <= 0)[0])
    raise FormatError(
        f"has step {index} at time {times[index]:g} and step {index + 1} at "
        f"{times[index + 1]:g}; times must ascend; read the steps in file order with --fps (fps=)"
    )


class _PartFrames:
    """The frames of a part."""

    def __init__(self, steps: _Steps, number: int, name: str, notes: list[str]) -> None:
        self._steps, self._number, self._name, self._notes = steps, number, name, notes
        self._last: tuple[int, CellSurface] | None = None

    def frame(self, index: int) -> PolygonMesh:
        """Return the surface of the part in a frame."""
        points = self._steps.points(index, self._number)
        return self._surface(index).mesh(points)

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return the variables of frames that share their faces."""
        fields: dict[Key, Field] = {}
        variables: dict[Key, Variable] = {}
        for variable in self._steps.variables:
            try:
                found = self._steps.field(variable, frames.start, self._number)
            except FormatError as error:
                note_left_out(self._notes, f"variable {variable.name!r}: {error}")
                continue
            if found is not None:
                add_field(fields, (variable.domain, variable.name), found)
                variables[variable.domain, variable.name] = variable

        def read(index: int, key: Key) -> npt.NDArray[np.float32]:
            surface = self._surface(frames[index])
            values = self._steps.values(variables[key], frames[index], self._number)
            return values[surface.source_rows[key[0]]]

        surface = self._surface(frames.start)
        n_verts = surface.n_verts(self._steps.part(frames.start, self._number).n_nodes)
        sizes = {Domain.VERTEX: n_verts, Domain.FACE: len(surface.cells)}
        return field_tracks([fields] * len(frames), sizes, read, self._notes)

    def _surface(self, index: int) -> CellSurface:
        """Return the surface of a frame, remembered for frames with the same file of elements."""
        step = self._steps.elements_step(index)
        if self._last is None or self._last[0] != step:
            self._last = step, self._steps.surface(index, self._number)
        return self._last[1]
