"""Reader for d3plot, the binary results of LS-DYNA, and its families of files.

Shells, solids and thick shells are one mesh, with or without deleted elements. Each frame is read
from the files when it is needed, one table of a state at a time.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, Keyword, Message
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.field_tracks import Field
from meshreel.formats.frames.steps import DataArray, Step, StepFrames
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.solvers.d3plot_files import (
    BEAMS,
    ELEMENT_RESULTS,
    SHELLS,
    SOLIDS,
    D3plotLayout,
    Words,
    adapted_roots,
    other_files,
)
from meshreel.formats.surfaces.cells import Cells, CellSurface, cell_mesh
from meshreel.model.geometry.polygons import ragged_indices
from meshreel.model.notes import NoteKind
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.runtime.counting import counted

NODE_RESULTS = (
    "temperature", "heat_flux", "mass_scaling", "temperature_rate", "residual_force",
    "residual_moment", "contact_energy", "velocity", "acceleration",
)  # fmt: skip
"""Sections of a state that are tracks of vertices."""

SECTION_NAMES = {"global": "global results", BEAMS: "results of beams"}
"""What notes call sections that are not read, unless it is their name."""

UNNAMED = {
    "time": "the times of the frames",
    "coordinates": "the positions",
    "deleted nodes": "elements that do not exist",
    "deleted elements": "elements that do not exist",
}
"""Sections that are neither tracks nor named in notes, and what becomes of them."""

ALIVE = "alive"
"""Name of the track that is 1 for the elements that exist in a state, otherwise 0."""

DELETED = Message(
    "elements are deleted, with the nodes that only they have, which begins a new mesh each time; ",
    Keyword("keep_deleted"),
    f" keeps them in one mesh with a track {ALIVE!r}, which is usually smaller",
)

PARTS = "part"
"""Name of the groups of faces by part, and of the attribute of cells with their numbers."""


def read_d3plot(path: Path, reading: Reading) -> Sequence[SceneMesh]:
    """Return the mesh of a d3plot family; the states of adapted meshes are further frames.

    Raises
    ------
    FormatError
        If a file is truncated or damaged, or has contents that are not supported.
    InvalidInputError
        If a file cannot be read.
    """
    layouts = [_layout(path, reading)]
    for root in adapted_roots(path):
        with errors_naming(root.name):
            layouts.append(_layout(root, reading))
    states: list[tuple[float, D3plotLayout, int]] = []
    for layout in layouts:  # an adapted mesh repeats the last states before it
        first = min(layout.states, default=np.inf)
        states = [state for state in states if state[0] < first]
        states += [(time, layout, start) for time, start in layout.states.items()]
    if not states:
        raise FormatError(
            "contains no states; the files with the results (d3plot01, ...) must be next to it"
        )
    reader = _States([(layout, start) for _, layout, start in states], reading)
    frames = StepFrames(reader.step, reading.notes)
    times = np.array([time for time, _, _ in states], layouts[0].words.float_type)
    return [SceneMesh(path.stem, times, frames.frame, reader.surface, tracks=frames.tracks)]


def _layout(path: Path, reading: Reading) -> D3plotLayout:
    layout = D3plotLayout(Words(path))
    if len(layout.cells.types) == 0:
        raise FormatError("contains neither shells nor solids; there is no surface")
    control = layout.control
    without_faces = {"nel2": "beams", "nmsph": "SPH particles", "npefg": "particles of airbags"}
    names = [name for key, name in without_faces.items() if control[key] > 0]
    reading.notes.left_out("elements without faces", names)
    if control["narbs"]:
        reading.notes.left_out("user numbers of nodes and elements")
    read_as_linear = {"nel48": "8-node shells", "nel20": "20-node solids"}
    names = [name for key, name in read_as_linear.items() if control[key] > 0]
    reading.notes.left_out("nodes on edges of elements, read as free vertices", names)
    reading.notes.left_out("results", _unread_results(layout))
    if layout.n_leftover_words:
        reading.notes.changed(
            "the last state is incomplete and not read: "
            f"{counted(layout.n_leftover_words, 'word')} of {layout.state_words}"
        )
    return layout


def _unread_results(layout: D3plotLayout) -> list[str]:
    """Describe the tables of states, and their columns, that are not tracks."""
    control, unread = layout.control, []
    for name, section in layout.sections.items():
        if name not in layout.counts:
            is_read = name in NODE_RESULTS or name in UNNAMED
            unread += [] if is_read else [SECTION_NAMES.get(name, name)]
            continue
        results = {key: columns[name] for key, columns in layout.results.items() if name in columns}
        places = [columns.first for columns in results.values()]
        details = {
            "other integration points": any(columns.n_points > 1 for columns in results.values()),
            "history variables": control["neiph" if name == SOLIDS else "neips"] > 0,
            "force resultants": name == SHELLS and control["ioshl3"] == 1000,
            "element variables": "thickness" in results,
            "strains": "internal_energy" in results and places[-1] - places[-2] > 3,
        }
        if section.n_columns > sum(map(ELEMENT_RESULTS.__getitem__, results)):
            texts = [text for text, is_present in details.items() if is_present] or ["others"]
            unread.append(f"{', '.join(texts)} of {name}")
    return unread


class _States:
    """The states of one or several layouts, in order.

    Parameters
    ----------
    states : list of tuple of D3plotLayout and int
        Layout and first word of each state.
    """

    def __init__(self, states: list[tuple[D3plotLayout, int]], reading: Reading) -> None:
        self._states, self._notes = states, reading.notes
        self._keeps_deleted = reading.keep_deleted
        self._cached: tuple[D3plotLayout, bytes, CellSurface] | None = None

    def step(self, index: int) -> Step:
        """Return the elements that exist in a state, and its results as tracks."""
        layout, state = self._states[index]
        points = layout.coordinates
        if "coordinates" in layout.sections:
            points = partial(layout.read, state, "coordinates")
        dtype = layout.words.float_type
        arrays = [
            _result(
                Domain.VERTEX,
                name,
                partial(layout.read, state, name),
                Field(dtype, layout.sections[name].n_columns, kind=name, is_track=True),
            )
            for name in NODE_RESULTS
            if name in layout.sections
        ]
        arrays += [
            _result(
                Domain.FACE,
                name,
                partial(layout.read_elements, state, name),
                Field(dtype, n_columns, is_track=True),
            )
            for name, n_columns in ELEMENT_RESULTS.items()
            if layout.results[name]
        ]
        if self._keeps_deleted:
            alive = partial(layout.is_alive, state)
            arrays.append(_result(Domain.FACE, ALIVE, alive, Field(np.dtype("u1"), 1)))
        n_cells = len(layout.cells.types)
        return Step(layout.n_nodes, n_cells, self._surface(index), points, arrays)

    def surface(self, index: int) -> Surface:
        """Return the parts of the faces and cells of a state."""
        layout, _ = self._states[index]
        if "coordinates" not in layout.sections:
            self._notes.left_out("motion: the states contain no positions")
        surface = self._surface(index)
        surface.note_interior(self._notes)
        numbers = layout.part_numbers.astype(np.int32)
        groups = FaceGroups(PARTS, layout.part_names, numbers[surface.cells])
        cell_attributes: tuple[Attribute, ...] = ()
        if surface.volume is not None:
            values = numbers[surface.volume_rows, None]
            cell_attributes = (Attribute(PARTS, Kind.OTHER, Domain.CELL, values),)
        return Surface(attributes=cell_attributes, groups=(groups,))

    def _surface(self, index: int) -> CellSurface:
        """Return the surface of the cells that exist in a state, cached while they are equal."""
        layout, state = self._states[index]
        if self._keeps_deleted:
            is_alive = np.ones(len(layout.cells.types), bool)
        else:
            is_alive = layout.is_alive(state)
        if not is_alive.all():
            self._notes.add(NoteKind.SEGMENTS, "deleted elements", DELETED)
        key = np.packbits(is_alive).tobytes()
        if self._cached is None or self._cached[:2] != (layout, key):
            rows, cells = np.flatnonzero(is_alive), layout.cells
            if len(rows) == 0:
                raise FormatError("has a state in which all elements with faces are deleted")
            starts, counts = np.cumsum(cells.counts) - cells.counts, cells.counts[rows]
            points = cells.points[ragged_indices(starts[rows], counts)]
            surface = cell_mesh(Cells(cells.types[rows], counts, points), layout.n_nodes)
            if not is_alive.all():  # without the nodes that only deleted cells have
                surface = surface.without_points(layout.lost_nodes(is_alive))
            surface = replace(surface, cells=rows[surface.cells], volume_rows=rows)
            self._cached = layout, key, surface
        return self._cached[2]


def _result(
    domain: Domain, name: str, read: Callable[[], npt.NDArray[Any]], field: Field
) -> DataArray:
    return DataArray(domain, name, read, lambda: None, lambda: field, is_track=True)


FORMATS = (
    SequenceFormat(
        ".d3plot",
        "LS-DYNA d3plot",
        read_meshes=read_d3plot,
        other_files=other_files,
        read_options=frozenset({"keep_deleted"}),
    ),
)
