"""Case files of EnSight Gold: which files contain the geometry and the variables, and when."""

import re
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.file_references import resolve_reference
from meshreel.formats.notes import note_kinds
from meshreel.formats.options import ReadOptions
from meshreel.model.surface import Domain

WIDTHS = {"scalar": 1, "vector": 3, "tensor symm": 6, "tensor asym": 9}
PLACES = {"node": Domain.VERTEX, "element": Domain.FACE}
COORDS_ONLY, PER_PART = "change_coords_only", "changing_geometry_per_part"
MAX_STEPS = 1 << 24


@dataclass(frozen=True, eq=False)
class TimeSet:
    """Times, and the numbers in the names of the files of each.

    Parameters
    ----------
    times_s : float64 array of shape (T,)
    numbers : tuple of int
        Empty if file names have no numbers.
    """

    times_s: Floats
    numbers: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class FileSeries:
    """A file for each step of a time set, or one for all.

    Parameters
    ----------
    pattern : str
        File name, in which asterisks are replaced by a number.
    times : TimeSet or None
        None if there is one file.
    """

    pattern: str
    times: TimeSet | None

    def name(self, step: int) -> str:
        """Return the file name of a step of the time set."""
        if self.times is None or "*" not in self.pattern:
            return self.pattern
        number = self.times.numbers[step]
        return re.sub(r"\*+", lambda stars: f"{number:0{len(stars[0])}}", self.pattern)


@dataclass(frozen=True, eq=False)
class Variable:
    """A variable of nodes or elements.

    Parameters
    ----------
    name : str
    domain : Domain
        Of vertices or faces.
    width : int
        Number of components.
    files : FileSeries
    """

    name: str
    domain: Domain
    width: int
    files: FileSeries


class EnsightCase:
    """A case file.

    Parameters
    ----------
    path : Path
    options : ReadOptions
        Their notes receive what is left out.

    Attributes
    ----------
    geometry : FileSeries
    elements_step : int or None
        Step of the geometry whose file has the elements of all steps; None if all have their own.
    variables : list of Variable

    Raises
    ------
    FormatError
        If it is not a case of EnSight Gold, or uses features that are not supported.
    """

    def __init__(self, path: Path, options: ReadOptions) -> None:
        self._path, self._options = path, options
        with os_errors_naming(path):
            self._sections = _read_sections(path.read_text("latin-1"))
        kinds = [value.lower().split() for key, value in self._sections["FORMAT"] if key == "type"]
        if kinds != [["ensight", "gold"]]:
            found = " ".join(kinds[0]) if kinds else "(none)"
            raise FormatError(f"is a case of type {found[:40]!r}; 'ensight gold' is supported")
        self._time_sets = dict(self._read_time_sets())
        models = [value for key, value in self._sections["GEOMETRY"] if key == "model"]
        if len(models) != 1:
            raise FormatError(f"has {len(models)} models in its section GEOMETRY; expected one")
        self.elements_step: int | None = None
        self.geometry: FileSeries = self._read_model(_words(models[0]))
        others = [key for key, _ in self._sections["GEOMETRY"] if key != "model"]
        note_kinds(options.notes, "geometry", others)
        note_kinds(options.notes, "sections", self._sections.keys() - KNOWN_SECTIONS)
        self.variables: list[Variable] = list(self._read_variables())

    def file(self, series: FileSeries, step: int) -> Path:
        """Return the path of a file.

        Raises
        ------
        FormatError
            If it does not exist, or is outside the folder of the case without permission.
        """
        allow_outside = self._options.allow_outside
        return resolve_reference(self._path, series.name(step), allow_outside=allow_outside)

    def _read_model(self, words: list[str]) -> FileSeries:
        if PER_PART in words:
            raise FormatError(
                f"has the model option {PER_PART}, which is not supported; write whole geometries"
            )
        if COORDS_ONLY in words:
            at = words.index(COORDS_ONLY)
            self.elements_step = int(_numbers(words[at + 1 : at + 2] or ["0"])[0])
            words = words[:at]
        *numbers, pattern = words or [""]
        series = self._series(numbers, pattern, "the model")
        if series is None:
            raise FormatError(
                "stores all steps of the geometry in one file (file set); write one file per step"
            )
        return series

    def _read_variables(self) -> Iterator[Variable]:
        left_out = []
        for key, value in self._sections["VARIABLE"]:
            kind, _, place = key.partition(" per ")
            words = _words(value)
            name = next((word for word in words if not word.isdigit()), "")
            if kind not in WIDTHS or place not in PLACES:
                left_out.append(f"{name} ({key})")
                continue
            *numbers, name, pattern = words if len(words) > 1 else [name, ""]
            series = self._series(numbers, pattern, name)
            if series is None:
                left_out.append(f"{name} (in a file set)")
            else:
                yield Variable(name, PLACES[place], WIDTHS[kind], series)
        note_kinds(self._options.notes, "variables", left_out)

    def _series(self, numbers: list[str], pattern: str, what: str) -> FileSeries | None:
        """Return the files of a line that begins with a time set; None if a file set follows it."""
        if len(numbers) > 1:
            return None
        if not pattern or any(not one.isdigit() for one in numbers):
            raise FormatError(f"has a line without a file name for {what[:40]!r}")
        number = int(numbers[0]) if numbers else min(self._time_sets, default=None)
        if not numbers and "*" not in pattern:
            return FileSeries(pattern, None)
        if number is None or number not in self._time_sets:
            raise FormatError(f"has no time set {number} for {what[:40]!r}")
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
        for facts in sets:
            number = _numbers((facts["time set"] or "?").split()[:1])[0]
            times = self._listed(facts, "time values")
            n_steps = int(_numbers([facts.get("number of steps", str(len(times)))])[0])
            names = self._listed(facts, "filename numbers")
            if not len(names) and "filename start number" in facts:
                if not 0 <= n_steps <= MAX_STEPS:
                    raise FormatError(f"has a time set of {n_steps} steps")
                start = _numbers([facts["filename start number"]])[0]
                step = _numbers([facts.get("filename increment", "1")])[0]
                names = start + step * np.arange(n_steps)
            if len(times) != n_steps or n_steps == 0:
                raise FormatError(
                    f"has {len(times)} times in time set {number:g}; expected {n_steps}"
                )
            yield int(number), TimeSet(times, tuple(int(one) for one in names))

    def _listed(self, facts: dict[str, str], key: str) -> Floats:
        if f"{key} file" in facts:
            path = self.file(FileSeries(facts[f"{key} file"].strip('"'), None), 0)
            with os_errors_naming(path):
                return _numbers(path.read_text("latin-1").split())
        return _numbers(facts.get(key, "").split())


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
            before, values = sections[section][-1]
            sections[section][-1] = before, f"{values} {line}"
    return sections


def _words(text: str) -> list[str]:
    """Split a value at spaces outside quotation marks, which are removed."""
    return [word.strip('"') for word in re.findall(r'"[^"]*"|\S+', text)]


def _numbers(words: list[str]) -> Floats:
    try:
        numbers = np.array([float(word) for word in words], np.float64)
    except ValueError as error:
        raise FormatError(f"has a section TIME with a bad number ({error})") from error
    if not np.isfinite(numbers).all():
        raise FormatError("has a section TIME with a number that is not finite")
    return numbers
