"""The words of a family of d3plot files, and their layout: geometry and the sections of a state.

The files are addressed as if they were one file.
"""

import os
import re
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import FormatError
from meshreel.formats.file_errors import check_input_file, os_errors_naming
from meshreel.formats.surfaces.cells import Cells
from meshreel.runtime.counting import counted

END = -999999.0
"""Value of the word after the last state of a file."""

FILE_TYPE = 11
"""Word with the type of the file."""

FILE_TYPES = {1: "d3plot", 2: "d3drlf", 5: "d3part"}
"""Supported types, whose layout is the same."""

CHUNK = 1 << 16


class Words:
    """The words of a root file and its numbered members, in order.

    Parameters
    ----------
    root : Path
        The first file; members have its name followed by digits, as in ``d3plot01``.

    Attributes
    ----------
    float_type : dtype
        float32 or float64.
    n_words : int
        Total of all files.
    starts : tuple of int
        First word of each file, and `n_words`.

    Raises
    ------
    FormatError
        If the root is not a d3plot file of a supported type.
    InvalidInputError
        If a file cannot be read.
    """

    def __init__(self, root: Path) -> None:
        self._paths = [root, *members(root)]
        for path in self._paths:
            check_input_file(path)
        with os_errors_naming(root), root.open("rb") as file:
            self._integer_type = _word_type(file.read(8 * (FILE_TYPE + 1)))
        self._float_type = np.dtype(f"{self._integer_type.byteorder}f{self._integer_type.itemsize}")
        self.float_type: np.dtype[Any] = self._float_type.newbyteorder("=")
        sizes = [path.stat().st_size // self._integer_type.itemsize for path in self._paths]
        self.starts: tuple[int, ...] = (0, *accumulate(sizes))
        self.n_words: int = self.starts[-1]

    def integers(self, start: int, count: int) -> Integers:
        """Read consecutive words as integers; raises as `floats`."""
        return self._read(start, count, self._integer_type).astype(np.int64, copy=False)

    def floats(self, start: int, count: int) -> npt.NDArray[np.floating]:
        """Read consecutive words as floats, of the precision of the file.

        Raises
        ------
        FormatError
            If the files end before.
        """
        return self._read(start, count, self._float_type).astype(self.float_type, copy=False)

    def text(self, start: int, n_bytes: int) -> str:
        """Read text from a word on, without its padding."""
        n_words = -(-n_bytes // self._integer_type.itemsize)
        words = self._read(start, n_words, self._integer_type)
        data = words.astype(self._integer_type).tobytes()[:n_bytes]  # concatenation swaps bytes
        return data.decode("latin-1").replace("\0", " ").strip()

    def words_of(self, n_bytes: int) -> int:
        """Return the number of words that a number of bytes takes."""
        return n_bytes // self._integer_type.itemsize

    def end_of_file(self, position: int) -> int:
        """Return the end of the file that contains a position: the first word of the next file."""
        return next(start for start in self.starts if start > position)

    def is_padding(self, start: int) -> bool:
        """Whether all words from here to the end of the file are 0."""
        stop = self.end_of_file(start)
        return not any(
            self._read(first, min(CHUNK, stop - first), self._integer_type).any()
            for first in range(start, stop, CHUNK)
        )

    def _read(self, start: int, count: int, dtype: np.dtype[Any]) -> npt.NDArray[Any]:
        if count < 0 or start < 0 or start + count > self.n_words:
            raise FormatError(
                f"needs {start + count} words; its files have {self.n_words}: one is missing, "
                "truncated, or compressed by FEMZIP, which is not supported"
            )
        pieces = []
        for path, first, stop in zip(self._paths, self.starts, self.starts[1:], strict=False):
            begin, end = max(start, first), min(start + count, stop)
            if begin < end:
                with os_errors_naming(path):
                    offset = (begin - first) * dtype.itemsize
                    pieces.append(np.fromfile(path, dtype, end - begin, offset=offset))
        words = np.concatenate(pieces) if pieces else np.empty(0, dtype)
        if len(words) != count:
            raise FormatError("became shorter while it was read; start again")
        return words


def members(root: Path) -> list[Path]:
    """Return the numbered files that continue a root file, in order: d3plot01, d3plot02."""
    return [path for _, path in sorted((int(end), path) for end, path in _matches(root, r"\d{2,}"))]


def adapted_roots(root: Path) -> list[Path]:
    """Return the root files of adapted meshes, in order: d3plotaa, d3plotab."""
    return [path for _, path in sorted(_matches(root, "[a-z]{2}"))]


def _matches(root: Path, ending: str) -> list[tuple[str, Path]]:
    """Return endings and paths of the files next to a root file that add an ending to its name."""
    pattern = re.compile(f"{re.escape(root.name)}({ending})")
    with os_errors_naming(root.parent):
        names = os.listdir(root.parent)
    return [
        (match[1], root.with_name(match[0])) for match in map(pattern.fullmatch, names) if match
    ]


def other_files(root: Path) -> list[Path]:
    """Return all files that continue a root file: its members, and adapted meshes with theirs."""
    adapted = adapted_roots(root)
    return [*members(root), *adapted, *(file for first in adapted for file in members(first))]


def _word_type(data: bytes) -> np.dtype[Any]:
    """Return the integer type of a file from the word with its file type."""
    file_types = []
    for code in ("<i4", ">i4", "<i8", ">i8"):
        dtype = np.dtype(code)
        words = np.frombuffer(data, dtype, len(data) // dtype.itemsize)
        if len(words) > FILE_TYPE:
            value = int(words[FILE_TYPE])
            if value in FILE_TYPES or value - 1000 in FILE_TYPES:
                return dtype
            file_types.append(value)
    if file_types and -12 < file_types[0] < 0:
        raise FormatError(
            "was written with *DATABASE_EXTENT_BINARY_COMP, which is not supported; run LS-DYNA "
            "without it"
        )
    raise FormatError(
        f"is not a d3plot file: its file type is {file_types[0] if file_types else '(none)'}; "
        f"{', '.join(f'{number} ({name})' for number, name in FILE_TYPES.items())} are supported"
    )


N_CONTROL = 64

CONTROL = {
    "ndim": 15, "numnp": 16, "nglbv": 18, "it": 19, "iu": 20, "iv": 21, "ia": 22, "nel8": 23,
    "nummat8": 24, "nv3d": 27, "nel2": 28, "nummat2": 29, "nv1d": 30, "nel4": 31, "nummat4": 32,
    "nv2d": 33, "neiph": 34, "neips": 35, "maxint": 36, "nmsph": 37, "narbs": 39, "nelt": 40,
    "nummatt": 41, "nv3dt": 42, "ioshl1": 43, "ioshl2": 44, "ioshl3": 45, "ioshl4": 46,
    "ialemat": 47, "ncfdv1": 48, "ncfdv2": 49, "nadapt": 50, "npefg": 54, "nel48": 55, "idtdt": 56,
    "extra": 57, "nel20": 64, "nt3d": 65, "quadr": 74, "cubic": 75, "penout": 78, "engout": 79,
}  # fmt: skip
"""Control words by their names in the database manual of LS-DYNA."""

SIZES = (
    "numnp", "nglbv", "it", "iu", "ia", "nel8", "nv3d", "nel2", "nv1d", "nel4", "nv2d", "neiph",
    "neips", "nmsph", "narbs", "nelt", "nv3dt", "ialemat", "nadapt", "npefg", "nel48", "idtdt",
    "extra", "nel20", "nt3d", "penout", "engout",
)  # fmt: skip
"""Control words that cannot be negative."""

SOLIDS, THICK_SHELLS, BEAMS, SHELLS = "solids", "thick shells", "beams", "shells"

CONNECTIVITY = {
    SOLIDS: ("nel8", 9),
    THICK_SHELLS: ("nelt", 9),
    BEAMS: ("nel2", 6),
    SHELLS: ("nel4", 5),
}
"""Number and width of the rows of each kind of element, in their order in the geometry."""

N_SIZES, N_NUMBERING = 10, 16
"""Words in the header of the numbering section, without and with part numbers."""

RIGID = 20
"""Material type of rigid shells, which have no results if material types are stored."""

TITLES = {90000: 0, 90001: 1, 90002: 1, 90020: 1, 90021: 1}
"""Types of title tables, and whether they have a list of numbers and titles."""

OTHER_TABLES = range(90_000, 1_000_000)
"""Possible types of tables after the geometry; as floats they are too small for a time."""

PART_TITLES = 90001
TITLE_BYTES = 72

ELEMENT_RESULTS = {"stress": 6, "plastic_strain": 1, "thickness": 1, "internal_energy": 1}
"""Results of elements and their numbers of components."""

TETRA, HEXAHEDRON, WEDGE, PYRAMID, TEN_NODE_TETRA = 10, 12, 13, 14, 24
TRIANGLE, QUAD = 5, 9


@dataclass(frozen=True)
class Section:
    """A table in each state."""

    start: int
    """First word, counted from the first of the state."""
    n_rows: int
    n_columns: int


@dataclass(frozen=True)
class ElementColumns:
    """Columns of a result in the rows of a section of elements."""

    n_points: int
    """Number of integration points."""
    width: int
    """Columns of each point."""
    first: int
    """First column of the result."""


class D3plotLayout:
    """Geometry of a d3plot file, and the place of each result in its states.

    Attributes
    ----------
    sections : dict of str to Section
        Tables of a state by name, in order.
    state_words : int
        Length of a state.
    results : dict of str to dict of str to ElementColumns
        Columns of results in the sections of elements, by result and kind of element.
    states : dict of float to int
        First word of each complete state by its time, ascending.
    n_leftover_words : int
        Words of an incomplete state at the end.

    Raises
    ------
    FormatError
        If the file is truncated or damaged, or has contents that are not supported.
    """

    def __init__(self, words: Words) -> None:
        self.words = words
        self.control: dict[str, int] = _read_control(words)
        control = self.control
        self._check_supported()
        self._position = N_CONTROL + control["extra"]
        self._n_rigid_shells, self._material_types = 0, np.empty(0, np.int64)
        if control["ndim"] == 5:
            self._n_rigid_shells, n_materials = self._next_integers(2).tolist()
            self._material_types = self._next_integers(n_materials)
        self._position += control["ialemat"]

        # Numbers of words: per SPH particle, and of airbags in the geometry and in each state.
        n_sph = particle_words = particle_state_words = 0
        if control["nmsph"]:
            flags = words.integers(self._position, int(self._next_integers(1)[0]))
            self._position += len(flags) - 1
            n_sph = 1 + int(np.abs(flags[1:]).sum())
        if control["npefg"]:
            n_bags, version = control["npefg"] % 1000, control["npefg"] // 1000
            n_geometry, n_values, n_particles, n_state = self._next_integers(4).tolist()
            self._position += (version == 4) + 9 * (n_geometry + n_values + n_state)
            particle_words = n_bags * n_geometry
            particle_state_words = n_bags * n_state + n_particles * n_values

        self._read_geometry()
        # Of the tables that follow, only further nodes of ten-node solids are read.
        self._position += 2 * control["nadapt"] + 2 * control["nmsph"] + particle_words
        if control["has_ten_nodes"]:
            self._last_nodes = self._next_integers(2 * control["nel8"]).reshape(-1, 2) - 1
        if self._last_nodes.max(initial=-1) >= self.n_nodes:
            raise FormatError(
                f"has ten-node solids with node numbers above {self.n_nodes}; it is damaged"
            )
        self._position += 5 * control["nel48"] + 13 * control["nel20"]
        if self._position > words.n_words:
            raise FormatError(
                f"needs {self._position} words of geometry; its files have {words.n_words}: "
                "one is missing or truncated"
            )

        self._titles = self._read_titles()
        self.sections: dict[str, Section] = {}
        self.state_words: int = self._place_sections(n_sph, particle_state_words)
        self.results: dict[str, dict[str, ElementColumns]] = self._find_results()
        self.n_leftover_words: int = 0
        self.states: dict[float, int] = self._find_states()

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return self.control["numnp"]

    @cached_property
    def counts(self) -> dict[str, int]:
        """Number of elements of each kind that has faces, in the order of `cells`."""
        sizes = {SOLIDS: "nel8", THICK_SHELLS: "nelt", SHELLS: "nel4"}
        return {kind: self.control[name] for kind, name in sizes.items()}

    @cached_property
    def cells(self) -> Cells:
        """Solids, thick shells and shells, with node indices from 0."""
        types, corners = [], []
        for kind in (SOLIDS, THICK_SHELLS):
            kinds, nodes = _solid_cells(self._connectivity[kind][:, :8])
            nodes = np.pad(nodes, ((0, 0), (0, 2)), constant_values=-1)
            if kind == SOLIDS and len(self._last_nodes):
                has_ten = (self._last_nodes >= 0).all(axis=1)
                kinds[has_ten], nodes[has_ten, 8:] = TEN_NODE_TETRA, self._last_nodes[has_ten]
                nodes[has_ten, :8] = self._connectivity[kind][has_ten, :8]
            types.append(kinds)
            corners.append(nodes)
        shells = np.full((self.counts[SHELLS], 10), -1, np.int64)
        shells[:, :4] = self._connectivity[SHELLS][:, :4]
        is_triangle = shells[:, 2] == shells[:, 3]
        shells[is_triangle, 3] = -1
        types.append(np.where(is_triangle, TRIANGLE, QUAD))
        corners.append(shells)
        table = np.concatenate(corners)
        is_used = table >= 0
        return Cells(np.concatenate(types), is_used.sum(axis=1), table[is_used])

    @cached_property
    def part_numbers(self) -> Integers:
        """Part index of each of the cells, from 0."""
        return np.concatenate([self._connectivity[kind][:, -1] for kind in self.counts])

    @cached_property
    def part_names(self) -> tuple[str, ...]:
        """Titles of all parts; a part without a title is called "part ID".

        Raises
        ------
        FormatError
            If an element belongs to a part beyond the number of parts.
        """
        n_parts = max(len(self._part_ids), int(self.part_numbers.max(initial=-1)) + 1)
        n_materials = sum(self.control[f"nummat{digit}"] for digit in "824t")
        # Some programs declare no materials; no file has more of them than words.
        limit = max(len(self._part_ids), self._n_elements, min(n_materials, self.words.n_words))
        if n_parts > limit:
            raise FormatError(
                f"has an element of part {n_parts}, but at most {counted(limit, 'part')}; it is "
                "damaged"
            )
        ids = [*self._part_ids, *range(len(self._part_ids) + 1, n_parts + 1)]
        titles = [self._titles.get(number, "") for number in ids]
        return tuple(
            title if title and titles.count(title) == 1 else f"{title or 'part'} {number}"
            for title, number in zip(titles, ids, strict=True)
        )

    def lost_nodes(self, is_alive: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
        """Return which nodes belong to deleted cells, and to no others and no beam."""
        is_lost = np.zeros(self.n_nodes, bool)
        is_kept = np.repeat(is_alive, self.cells.counts)
        is_lost[self.cells.points[~is_kept]] = True
        is_lost[self.cells.points[is_kept]] = False
        beams = self._connectivity[BEAMS][:, :3]
        is_lost[beams[(beams >= 0) & (beams < self.n_nodes)]] = False
        return is_lost

    def coordinates(self) -> npt.NDArray[np.floating]:
        """Read the initial positions of all nodes, of shape (N, 3)."""
        return self.words.floats(self._first_coordinate, 3 * self.n_nodes).reshape(-1, 3)

    def read(self, state: int, name: str) -> npt.NDArray[np.floating]:
        """Read a table of a state, of shape (rows, columns).

        Parameters
        ----------
        state : int
            First word of the state.
        """
        section = self.sections[name]
        values = self.words.floats(state + section.start, section.n_rows * section.n_columns)
        return values.reshape(section.n_rows, section.n_columns)

    def read_elements(self, state: int, name: str) -> npt.NDArray[np.floating]:
        """Read a result of all cells in a state, of shape (N, C); NaN for those without it.

        Solids have the mean of their integration points, shells the value of their middle surface.
        """
        n_columns, tables = ELEMENT_RESULTS[name], []
        for kind, n_cells in self.counts.items():
            values = np.full((n_cells, n_columns), np.nan, self.words.float_type)
            if (columns := self.results[name].get(kind)) is not None:
                table = self.read(state, kind)
                points = range(columns.n_points if kind == SOLIDS else 1)
                starts = [columns.first + point * columns.width for point in points]
                parts = [table[:, start : start + n_columns] for start in starts]
                has_row = self.has_shell_results if kind == SHELLS else slice(None)
                values[has_row] = np.mean(parts, axis=0) if len(parts) > 1 else parts[0]
            tables.append(values)
        return np.concatenate(tables)

    def is_alive(self, state: int) -> npt.NDArray[np.bool_]:
        """Return which of the cells exist in a state."""
        n_cells = len(self.cells.types)
        if "deleted nodes" in self.sections:
            is_deleted = self.read(state, "deleted nodes")[:, 0] == 0
            n_lost = np.cumsum(np.append(0, is_deleted[self.cells.points]))
            stops = np.cumsum(self.cells.counts)
            is_intact: npt.NDArray[np.bool_] = n_lost[stops] == n_lost[stops - self.cells.counts]
            return is_intact
        if "deleted elements" not in self.sections:
            return np.ones(n_cells, bool)
        # Beams come last.
        exists: npt.NDArray[np.bool_] = self.read(state, "deleted elements")[:n_cells, 0] != 0
        return exists

    @cached_property
    def has_shell_results(self) -> npt.NDArray[np.bool_]:
        """Whether each shell has a row of results: rigid shells may have none."""
        numbers = self._connectivity[SHELLS][:, -1]
        if not len(self._material_types):
            return np.ones(len(numbers), bool)
        if numbers.max(initial=-1) >= len(self._material_types):
            raise FormatError("has a shell of a part without a material type; it is damaged")
        has_results: npt.NDArray[np.bool_] = self._material_types[numbers] != RIGID
        return has_results

    def _check_supported(self) -> None:
        control = self.control
        negative = [name for name in SIZES if control[name] < 0]
        if negative:
            raise FormatError(f"has a negative size {negative[0]}; it is damaged")
        problems = {
            f"reduced rigid bodies, packed or 2D geometry, or roads (NDIM {control['ndim']})": (
                control["ndim"] not in (4, 5)
            ),
            f"multi-physics results (NCFDV1 {control['ncfdv1']})": control["ncfdv1"] != 0,
            f"discrete elements (NPEFG {control['npefg']})": control["npefg"] >= 1_000_000,
            "state data of quadratic or cubic solids": control["quadr"] > 0 or control["cubic"] > 0,
        }
        if unsupported := [name for name, is_present in problems.items() if is_present]:
            raise FormatError(
                f"contains {' and '.join(unsupported)}, which is not supported; run LS-DYNA "
                "without, or export frames from LS-PrePost"
            )

    def _next_integers(self, count: int) -> Integers:
        numbers = self.words.integers(self._position, count)
        self._position += count
        return numbers

    def _read_geometry(self) -> None:
        """Read elements and part numbers.

        Programs place further nodes of ten-node solids before or after the other elements; the
        sizes in the numbering section show where.
        """
        self._first_coordinate = self._position
        self._last_nodes = np.empty((0, 2), np.int64)
        self._read_elements(ten_nodes=0)
        if self.control["has_ten_nodes"] and not self._numbering_fits():
            self._position = self._first_coordinate
            self._read_elements(ten_nodes=2 * self.control["nel8"])
            self.control["has_ten_nodes"] = 0
        for kind, rows in self._connectivity.items():
            nodes = rows[:, :-1]
            if kind != BEAMS and nodes.size and (rows.min() < 0 or nodes.max() >= self.n_nodes):
                raise FormatError(
                    f"has {kind} with node numbers outside 1..{self.n_nodes}; it is damaged or "
                    "compressed by FEMZIP, which is not supported"
                )
        if not self._numbering_fits():
            raise FormatError("has user numbers of another number of elements; it is damaged")

        # The user's part numbers, if the numbering section has them.
        numbering = self._next_integers(self.control["narbs"])
        self._part_ids: list[int] = []
        if len(numbering) >= N_NUMBERING and numbering[0] < 0:
            first, n_parts = N_NUMBERING + int(numbering[5:10].sum()), int(numbering[15])
            self._part_ids = numbering[first : first + max(0, n_parts)].tolist()

    def _read_elements(self, *, ten_nodes: int) -> None:
        self._position += 3 * self.n_nodes
        self._connectivity: dict[str, Integers] = {}
        for kind, (name, width) in CONNECTIVITY.items():
            rows = self._next_integers(self.control[name] * width)
            self._connectivity[kind] = rows.reshape(-1, width) - 1
            if kind == SOLIDS and ten_nodes:
                self._last_nodes = self._next_integers(ten_nodes).reshape(-1, 2) - 1

    def _numbering_fits(self) -> bool:
        """Whether the numbering section, if any, has the sizes of the geometry."""
        if self.control["narbs"] < N_SIZES:
            return True
        if self._position + N_SIZES > self.words.n_words:
            return False
        sizes = [self.control[name] for name in ("numnp", "nel8", "nel2", "nel4", "nelt")]
        declared_sizes: list[int] = self.words.integers(self._position, N_SIZES)[5:].tolist()
        return declared_sizes == sizes

    def _read_titles(self) -> dict[int, str]:
        """Return titles of parts by their number; the position moves to the states."""
        titles: dict[int, str] = {}
        if not self._is_end(self._position):
            return titles
        self._position += 1
        while self._position < self.words.n_words:
            kind = int(self.words.integers(self._position, 1)[0])
            if kind in OTHER_TABLES and kind not in TITLES:  # states are in the next file
                self._position = self.words.end_of_file(self._position)
                return titles
            if kind not in TITLES:
                break
            self._position += 1
            n_words = self.words.words_of(TITLE_BYTES)
            if not TITLES[kind]:
                self._position += n_words
                continue
            for _ in range(int(self._next_integers(1)[0])):
                number = int(self._next_integers(1)[0])
                if kind == PART_TITLES:
                    titles[number] = self.words.text(self._position, TITLE_BYTES)
                self._position += n_words
        if self._position < self.words.n_words and self._is_end(self._position):
            self._position += 1
        return titles

    def _place_sections(self, n_sph: int, particle_words: int) -> int:
        control, nodes = self.control, self.control["numnp"]
        thermal, residual = control["it"] % 10, control["idtdt"] // 10 % 10
        sizes = {
            "time": (1, 1),
            "global": (control["nglbv"], 1),
            "coordinates": (nodes * (control["iu"] != 0), 3),
            "temperature": (nodes * (thermal in (1, 2)), 1),
            "temperatures of shell layers": (nodes * (thermal == 3), 3),
            "heat_flux": (nodes * (thermal in (2, 3)), 3),
            "mass_scaling": (nodes * (control["it"] // 10 == 1), 1),
            "temperature_rate": (nodes * (control["idtdt"] % 10 == 1), 1),
            "residual_force": (nodes * (residual == 1), 3),
            "residual_moment": (nodes * (residual == 1), 3),
            "contact penetrations": (nodes * control["penout"], 3),
            "contact_energy": (nodes * (control["engout"] == 1), 1),
            "velocity": (nodes * (control["iv"] != 0), 3),
            "acceleration": (nodes * (control["ia"] != 0), 3),
            "thermal results of solids": (control["nel8"], control["nt3d"]),
            SOLIDS: (control["nel8"], control["nv3d"]),
            THICK_SHELLS: (control["nelt"], control["nv3dt"]),
            BEAMS: (control["nel2"], control["nv1d"]),
            SHELLS: (control["nel4"] - self._n_rigid_shells, control["nv2d"]),
            "deleted nodes": (nodes * (control["deletion"] == 1), 1),
            "deleted elements": (self._n_elements * (control["deletion"] == 2), 1),
            "SPH": (control["nmsph"], n_sph),
            "particles": (particle_words, 1),
        }
        position = 0
        for name, (n_rows, n_columns) in sizes.items():
            if n_rows < 0 or n_columns < 0:
                raise FormatError(f"has a negative number of {name}; it is damaged")
            if n_rows * n_columns:
                self.sections[name] = Section(position, n_rows, n_columns)
            position += n_rows * n_columns
        n_results = int(self.has_shell_results.sum())
        if SHELLS in self.sections and self.sections[SHELLS].n_rows != n_results:
            raise FormatError(
                f"has results of {self.sections[SHELLS].n_rows} shells; {n_results} of its shells "
                "are not rigid; it is damaged"
            )
        return position

    def _find_results(self) -> dict[str, dict[str, "ElementColumns"]]:
        """Find the columns of results: stresses, plastic strain and others of integration points.

        Shells have thickness and internal energy after those of all integration points.
        """
        control = self.control
        results: dict[str, dict[str, ElementColumns]] = {name: {} for name in ELEMENT_RESULTS}
        for kind in self.counts.keys() & self.sections.keys():
            is_solid = kind == SOLIDS
            min_flag = 999 if is_solid else 1000
            n_stress, n_strain = 6 * (control["ioshl1"] >= min_flag), control["ioshl2"] >= min_flag
            width = n_stress + n_strain + control["neiph" if is_solid else "neips"]
            n_points = control["maxint"]
            if is_solid:
                n_points = control["nv3d"] // width if width else 0
            if n_points and n_stress:
                results["stress"][kind] = ElementColumns(n_points, width, 0)
            if n_points and n_strain:
                results["plastic_strain"][kind] = ElementColumns(n_points, width, n_stress)
            if kind == SHELLS and control["ioshl4"] == 1000:
                first = n_points * width + 8 * (control["ioshl3"] == 1000)
                has_strain = control["nv2d"] - first - 4 > 1
                if control["idtdt"] >= 100:
                    has_strain = control["idtdt"] // 10_000 % 10 == 1
                for name, column in (("thickness", 0), ("internal_energy", 3 + 12 * has_strain)):
                    if first + column < control["nv2d"]:
                        results[name][kind] = ElementColumns(1, 0, first + column)
        return results

    @property
    def _n_elements(self) -> int:
        return sum(self.counts.values()) + self.control["nel2"]

    def _find_states(self) -> dict[float, int]:
        """Return the first word of each state by time; states do not begin after the end mark."""
        states: dict[float, int] = {}
        position, last_time = self._position, -np.inf
        while position < self.words.n_words:
            if self._is_end(position) or self.words.is_padding(position):
                position = self.words.end_of_file(position)
                continue
            if position + self.state_words > self.words.n_words:
                self.n_leftover_words = self.words.n_words - position
                break
            time = float(self.words.floats(position, 1)[0])
            if not last_time < time < np.inf:
                raise FormatError(
                    f"has a state at time {time:g} after one at {last_time:g}; its states are not "
                    f"{self.state_words} words long, as its control words say"
                )
            states[time], last_time = position, time
            position += self.state_words
        return states

    def _is_end(self, position: int) -> bool:
        return position < self.words.n_words and float(self.words.floats(position, 1)[0]) == END


def _read_control(words: Words) -> dict[str, int]:
    """Return the control words by name, with words that have two meanings separated."""
    first = words.integers(0, N_CONTROL)
    extra = int(first[CONTROL["extra"]])
    extra_numbers = words.integers(N_CONTROL, extra) if extra > 0 else first[:0]
    numbers = np.concatenate([first, extra_numbers]).tolist()
    control = {name: numbers[word] if word < len(numbers) else 0 for name, word in CONTROL.items()}
    control["has_ten_nodes"] = int(control["nel8"] < 0)
    control["nel8"] = abs(control["nel8"])
    # A negative number of integration points means that states list deleted nodes or elements.
    points = control["maxint"]
    control["deletion"] = 0 if points >= 0 else 1 if points > -10_000 else 2
    control["maxint"] = abs(points) - 10_000 * (control["deletion"] == 2)
    return control


def _solid_cells(nodes: Integers) -> tuple[Integers, Integers]:
    """Return cell types and corners, padded with -1, of solids that repeat nodes if degenerate.

    Parameters
    ----------
    nodes : int64 array of shape (N, 8)
    """
    types, corners = np.full(len(nodes), HEXAHEDRON), nodes.copy()
    equals_next = nodes[:, 1:] == nodes[:, :-1]  # whether each node equals the next one
    is_apex = equals_next[:, 4] & equals_next[:, 5] & equals_next[:, 6]
    shapes = (
        (equals_next[:, 2] & equals_next[:, 6], WEDGE, (0, 1, 2, 4, 5, 6)),
        (equals_next[:, 4] & equals_next[:, 6], WEDGE, (0, 4, 1, 3, 6, 2)),
        (is_apex, PYRAMID, (0, 1, 2, 3, 4)),
        (is_apex & equals_next[:, 2], TETRA, (0, 1, 2, 4)),
        (is_apex & equals_next[:, 3], TETRA, (0, 1, 2, 3)),
    )  # later ones are special cases of earlier ones
    for is_shape, kind, order in shapes:
        types[is_shape] = kind
        corners[is_shape] = -1
        corners[is_shape, : len(order)] = nodes[is_shape][:, order]
    return types, corners
