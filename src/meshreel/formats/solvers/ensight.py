"""Reader for EnSight Gold cases: parts of elements over time, in text or C binary.

Each part is a mesh of its elements with faces. Positions and values are read when they are needed,
a part at a time; text files are read whole.
"""

import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path

import numpy as np

from meshreel.arrays import Floats, Singles
from meshreel.errors import FormatError
from meshreel.formats.file_errors import read_bytes
from meshreel.formats.file_references import resolve_reference
from meshreel.formats.frames.field_tracks import Field, Key, add_field, field_tracks
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import ascending_times
from meshreel.formats.solvers.ensight_files import (
    Part,
    Tables,
    find_columns,
    find_order,
    find_parts,
    read_cells,
    read_columns,
    read_lines,
    read_values,
)
from meshreel.formats.surfaces.cells import CellSurface, cell_mesh
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.notes import Notes
from meshreel.model.surface import Domain
from meshreel.model.tracks import TrackSource

WIDTHS = {"scalar": 1, "vector": 3, "tensor symm": 6, "tensor asym": 9}
DOMAINS = {"node": Domain.VERTEX, "element": Domain.FACE}
COORDS_ONLY, PER_PART = "change_coords_only", "changing_geometry_per_part"
MAX_STEPS = 1 << 24


@dataclass(frozen=True, eq=False)
class TimeSet:
    """Times, and the number in the file names of each."""

    times_s: Floats
    """float64 array of shape (T,)."""
    numbers: tuple[int, ...] = ()
    """Empty if file names have no numbers."""


@dataclass(frozen=True, eq=False)
class FileSeries:
    """A file for each step of a time set, or one for all."""

    pattern: str
    """File name, in which asterisks are replaced by a number."""
    times: TimeSet | None
    """None if there is one file."""

    def name(self, step: int) -> str:
        """Return the file name of a step of the time set."""
        if self.times is None or "*" not in self.pattern:
            return self.pattern
        number = self.times.numbers[step]
        return re.sub(r"\*+", lambda stars: f"{number:0{len(stars[0])}}", self.pattern)


@dataclass(frozen=True, eq=False)
class Variable:
    """A variable of nodes or elements."""

    name: str
    domain: Domain
    """Of vertices or faces."""
    width: int
    """Number of components."""
    files: FileSeries


class EnsightCase:
    """A case file.

    Parameters
    ----------
    reading : Reading
        Their notes name everything that is not read.

    Attributes
    ----------
    elements_step : int or None
        Step of the geometry whose file has the elements of all steps; None if all have their own.

    Raises
    ------
    FormatError
        If it is not a case of EnSight Gold, or uses features that are not supported.
    """

    def __init__(self, path: Path, reading: Reading) -> None:
        self._path, self._options = path, reading
        self._sections = _read_sections(read_bytes(path).decode("latin-1"))
        kinds = [value.lower().split() for key, value in self._sections["FORMAT"] if key == "type"]
        if kinds != [["ensight", "gold"]]:
            kind = " ".join(kinds[0]) if kinds else "(none)"
            raise FormatError(f"is a case of type {kind[:40]!r}; 'ensight gold' is supported")
        self._time_sets = dict(self._read_time_sets())
        models = [value for key, value in self._sections["GEOMETRY"] if key == "model"]
        if len(models) != 1:
            raise FormatError(f"has {len(models)} models in its section GEOMETRY; expected one")
        words = _words(models[0])
        if PER_PART in words:
            raise FormatError(
                f"has the model option {PER_PART}, which is not supported; write whole geometries"
            )
        self.elements_step: int | None = None
        if COORDS_ONLY in words:
            index = words.index(COORDS_ONLY)
            self.elements_step = int(_numbers(words[index + 1 : index + 2] or ["0"])[0])
            words = words[:index]
        *numbers, pattern = words or [""]
        geometry = self._series(numbers, pattern, "the model")
        if geometry is None:
            raise FormatError(
                "stores all steps of the geometry in one file (file set); write one file per step"
            )
        self.geometry: FileSeries = geometry
        keys = [key for key, _ in self._sections["GEOMETRY"] if key != "model"]
        reading.notes.left_out("geometry", keys)
        reading.notes.left_out("sections", self._sections.keys() - KNOWN_SECTIONS)
        self.variables: list[Variable] = list(self._read_variables())

    def file(self, series: FileSeries, step: int) -> Path:
        """Return the path of a file.

        Raises
        ------
        FormatError
            If it does not exist, or is outside the folder of the case without permission.
        """
        return resolve_reference(self._path, series.name(step), self._options)

    def _read_variables(self) -> Iterator[Variable]:
        left_out = []
        for key, value in self._sections["VARIABLE"]:
            kind, _, location = key.partition(" per ")
            words = _words(value)
            name = next((word for word in words if not word.isdigit()), "")
            if kind not in WIDTHS or location not in DOMAINS:
                left_out.append(f"{name} ({key})")
                continue
            *numbers, name, pattern = words if len(words) > 1 else [name, ""]
            series = self._series(numbers, pattern, name)
            if series is None:
                left_out.append(f"{name} (in a file set)")
            else:
                yield Variable(name, DOMAINS[location], WIDTHS[kind], series)
        self._options.notes.left_out("variables", left_out)

    def _series(self, numbers: list[str], pattern: str, label: str) -> FileSeries | None:
        """Return the files of a line that begins with a time set; None if a file set follows it."""
        if len(numbers) > 1:
            return None
        if not pattern or any(not number.isdigit() for number in numbers):
            raise FormatError(f"has a line without a file name for {label[:40]!r}")
        number = int(numbers[0]) if numbers else min(self._time_sets, default=None)
        if not numbers and "*" not in pattern:
            return FileSeries(pattern, None)
        if number is None or number not in self._time_sets:
            raise FormatError(f"has no time set {number} for {label[:40]!r}")
        times = self._time_sets[number]
        if "*" in pattern and len(times.numbers) < len(times.times_s):
            raise FormatError(
                f"has {len(times.numbers)} file numbers for the {len(times.times_s)} times of "
                f"time set {number}"
            )
        return FileSeries(pattern, times if "*" in pattern else None)

    def _read_time_sets(self) -> Iterator[tuple[int, TimeSet]]:
        sets: list[dict[str, str]] = []
        for key, value in self._sections["TIME"]:
            if key == "time set":
                sets.append({})
            if not sets:
                raise FormatError("has a section TIME that does not begin with a time set")
            sets[-1][key] = value
        for entries in sets:
            number = _numbers((entries["time set"] or "?").split()[:1])[0]
            times = self._read_list(entries, "time values")
            n_steps = int(_numbers([entries.get("number of steps", str(len(times)))])[0])
            file_numbers = self._read_list(entries, "filename numbers")
            if not len(file_numbers) and "filename start number" in entries:
                if not 0 <= n_steps <= MAX_STEPS:
                    raise FormatError(
                        f"has a time set of {n_steps} steps; at most {MAX_STEPS} are read"
                    )
                start = _numbers([entries["filename start number"]])[0]
                step = _numbers([entries.get("filename increment", "1")])[0]
                file_numbers = start + step * np.arange(n_steps)
            if len(times) != n_steps or n_steps == 0:
                raise FormatError(
                    f"has {len(times)} times in time set {number:g}; expected {n_steps}"
                )
            yield int(number), TimeSet(times, tuple(int(number) for number in file_numbers))

    def _read_list(self, entries: dict[str, str], key: str) -> Floats:
        if f"{key} file" in entries:
            path = self.file(FileSeries(entries[f"{key} file"].strip('"'), None), 0)
            return _numbers(read_bytes(path).decode("latin-1").split())
        return _numbers(entries.get(key, "").split())


KNOWN_SECTIONS = {"FORMAT", "GEOMETRY", "VARIABLE", "TIME", "FILE"}


def _read_sections(text: str) -> dict[str, list[tuple[str, str]]]:
    """Return the keys and values of each section; values continue on lines without a key."""
    sections: dict[str, list[tuple[str, str]]] = defaultdict(list)
    section = ""
    for line in text.splitlines():
        line = line.strip()
        key, colon, value = line.partition(":")
        if not line or line.startswith("#"):
            continue
        if re.fullmatch(r"[A-Z_ ]+", line):
            section = line
            sections[section] = sections[section]
        elif colon and re.fullmatch(r"[a-zA-Z_ ]+", key):
            sections[section].append((" ".join(key.lower().split()), value.strip()))
        elif sections[section]:
            key, value = sections[section][-1]
            sections[section][-1] = key, f"{value} {line}"
    return sections


def _words(text: str) -> list[str]:
    """Split a value at spaces outside quotation marks, which are removed."""
    return [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', text)]


def _numbers(words: list[str]) -> Floats:
    try:
        numbers = np.array(words, np.float64)
    except ValueError as error:
        raise FormatError(f"has a section TIME with a bad number ({error})") from error
    if not np.isfinite(numbers).all():
        raise FormatError("has a section TIME with a number that is not finite")
    return numbers


MAX_TIME_DIFFERENCE = 1e-5
"""Largest difference between equal times, relative to the interval between frames."""


def read_ensight(path: Path, reading: Reading) -> Sequence[SceneMesh]:
    """Return the parts of a case that have faces.

    Raises
    ------
    FormatError
        If a file is missing or damaged, or uses features that are not supported.
    InvalidInputError
        If a file cannot be read.
    """
    case = EnsightCase(path, reading)
    steps = _Steps(case, reading)
    parts = steps.parts(steps.elements_step(0)).values()
    surface_parts = [part for part in parts if any(block.has_faces for block in part.blocks)]
    if not surface_parts:
        raise FormatError("contains no elements with faces; there is no surface")
    reading.notes.left_out("parts without faces", (p.name for p in parts if p not in surface_parts))
    kinds = {block.kind for part in surface_parts for block in part.blocks if not block.has_faces}
    reading.notes.left_out("elements of points, lines and ghosts", sorted(kinds))
    names = [part.name for part in surface_parts]
    meshes = []
    for part in surface_parts:
        is_unique = part.name and names.count(part.name) == 1
        name = part.name if is_unique else f"{part.name or 'part'} {part.number}"
        frames = _PartFrames(steps, part.number, reading.notes)
        label = f"/{name}" if len(surface_parts) > 1 else name
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

    def __init__(self, case: EnsightCase, reading: Reading) -> None:
        self._case = case
        series = [case.geometry, *(variable.files for variable in case.variables)]
        sets = [files.times for files in series if files.times is not None]
        self._time_set = next(
            (time_set for time_set in sets if len(time_set.times_s) > 1), next(iter(sets), None)
        )
        if case.geometry.times is not None:
            self._time_set = case.geometry.times
        times_s = np.zeros(1) if self._time_set is None else self._time_set.times_s
        self.times_s: Floats = ascending_times(times_s, "step", reading)
        self.variables: list[Variable] = [
            variable for variable in case.variables if self._fits(variable)
        ]
        names = (variable.name for variable in case.variables if variable not in self.variables)
        reading.notes.left_out("variables at other times than the geometry", names)
        self._lines = lru_cache(maxsize=2)(read_lines)
        self._order = cache(find_order)
        self._find = cache(lambda path: find_parts(self._open(path, path), reading.notes))
        self._columns = cache(
            lambda path, width, step: find_columns(
                self._open(path, self._geometry_file(step)), self.parts(step), width
            )
        )

    def parts(self, index: int) -> dict[int, Part]:
        """Return the parts of a frame by number."""
        parts: dict[int, Part] = self._find(self._geometry_file(index))
        return parts

    def part(self, index: int, number: int) -> Part:
        """Return a part in a frame.

        Raises
        ------
        FormatError
            If the frame lacks the part.
        """
        if (part := self.parts(index).get(number)) is None:
            raise FormatError(
                f"has no part {number} in {self._geometry_file(index).name}; all parts must exist "
                "in all frames"
            )
        return part

    def points(self, index: int, number: int) -> Singles:
        """Read the coordinates of a part.

        Raises
        ------
        FormatError
            If the part has another number of nodes than where its elements are.
        """
        part, element_part = self.part(index, number), self.part(self.elements_step(index), number)
        if part.n_nodes != element_part.n_nodes:
            raise FormatError(
                f"has {part.n_nodes} nodes in part {number} of {self._geometry_file(index).name}; "
                f"its elements are for {element_part.n_nodes}"
            )
        return read_columns(self._geometry(index), part.position, part.n_nodes, 3)

    def surface(self, step: int, number: int) -> CellSurface:
        """Return the surface of a part from the elements in the file of a step."""
        part = self.part(step, number)
        return cell_mesh(read_cells(self._geometry(step), part), part.n_nodes)

    def elements_step(self, index: int) -> int:
        """Return the frame whose file has the elements of a frame."""
        if self._case.elements_step is not None:
            return min(self._case.elements_step, len(self.times_s) - 1)
        return index if self._case.geometry.times is not None else 0

    def has_values(self, variable: Variable, index: int, number: int) -> bool:
        """Return whether a variable has values of a part in a frame."""
        columns = self._columns(*self._location(variable, index))
        return any(part == number for part, _ in columns)

    def values(self, variable: Variable, index: int, number: int) -> Singles:
        """Read the values of a variable at the nodes or elements of a part."""
        location = path, width, step = self._location(variable, index)
        tables = self._open(path, self._geometry_file(step))
        at_nodes, part = variable.domain is Domain.VERTEX, self.part(step, number)
        return read_values(tables, part, self._columns(*location), width, at_nodes=at_nodes)

    def _location(self, variable: Variable, index: int) -> tuple[Path, int, int]:
        """Return the file of a variable in a frame, its width, and the step of the elements."""
        times, step = variable.files.times, 0
        if times is not None:
            step = index
            if times is not self._time_set and self._time_set is not None:
                step = int(np.abs(times.times_s - self._time_set.times_s[index]).argmin())
        path = self._case.file(variable.files, step)
        return path, variable.width, self.elements_step(index)

    def _geometry(self, index: int) -> Tables:
        path = self._geometry_file(index)
        return self._open(path, path)

    def _open(self, path: Path, geometry: Path) -> Tables:
        """Open a file that is encoded as a geometry file."""
        return Tables(path, self._order(geometry), self._lines)

    def _geometry_file(self, index: int) -> Path:
        return self._case.file(self._case.geometry, index)

    def _fits(self, variable: Variable) -> bool:
        """Whether a variable never changes, or has values at the times of all frames."""
        times = variable.files.times
        if times is None or times is self._time_set or self._time_set is None:
            return True
        frame_times = self._time_set.times_s
        nearest = [np.abs(times.times_s - time).min() for time in frame_times]
        interval_s = (frame_times[-1] - frame_times[0]) / max(1, len(frame_times) - 1)
        return bool(max(nearest) <= MAX_TIME_DIFFERENCE * abs(interval_s))


class _PartFrames:
    """The frames of a part."""

    def __init__(self, steps: _Steps, number: int, notes: Notes) -> None:
        self._steps, self._number, self._notes = steps, number, notes
        self._surfaces: dict[int, CellSurface] = {}

    def frame(self, index: int) -> PolygonMesh:
        """Return the surface of the part in a frame."""
        points = self._steps.points(index, self._number)
        return self._surface(index).mesh(points)

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return the variables of frames that share their faces."""
        surface = self._surface(frames.start)
        fields: dict[Key, Field] = {}
        variables: dict[Key, Variable] = {}
        for variable in self._steps.variables:
            try:
                if not self._steps.has_values(variable, frames.start, self._number):
                    continue
            except FormatError as error:
                self._notes.left_out(f"variable {variable.name!r}: {error}")
                continue
            field = Field(np.dtype(np.float32), variable.width, is_track=True)
            is_at_nodes = variable.domain is Domain.VERTEX
            key = Domain.VERTEX if is_at_nodes else surface.cell_domain, variable.name
            add_field(fields, key, field)
            variables[key] = variable

        def read(index: int, key: Key) -> Singles:
            surface = self._surface(frames[index])
            values = self._steps.values(variables[key], frames[index], self._number)
            return values[surface.source_rows[key[0]]]

        surface.note_interior(self._notes)
        n_verts = surface.n_verts(self._steps.part(frames.start, self._number).n_nodes)
        sizes = {Domain.VERTEX: n_verts, surface.cell_domain: surface.n_cell_items}
        return field_tracks([fields] * len(frames), sizes, read, self._notes)

    def _surface(self, index: int) -> CellSurface:
        """Return the surface of a frame, read once; equal surfaces of frames are one object."""
        step = self._steps.elements_step(index)
        if step not in self._surfaces:
            self._surfaces[step] = self._steps.surface(step, self._number)
        return self._surfaces[step]


FORMATS = tuple(
    SequenceFormat(extension, "EnSight Gold", read_meshes=read_ensight, refers_to_files=True)
    for extension in (".case", ".encas")
)
