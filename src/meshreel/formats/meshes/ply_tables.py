"""The elements of a PLY file as tables of columns."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.meshes.ply_cells import BinaryCells, PlyCells, WordCells
from meshreel.formats.meshes.ply_header import PlyElement, PlyHeader, PlyProperty, read_ply_header
from meshreel.formats.meshes.ply_layout import ElementLayout, list_values, locate_element
from meshreel.formats.text.token_lines import split_lines
from meshreel.model.geometry.ragged import Integers, ragged_indices

STRIPS = "tristrips"
"""The element of triangle strips."""


@dataclass(frozen=True, eq=False)
class PlyTable:
    """The rows of an element.

    Parameters
    ----------
    element : PlyElement
    layout : ElementLayout
    cells : PlyCells
        What the layout is about.
    """

    element: PlyElement
    layout: ElementLayout
    cells: PlyCells

    def numbers(self, column: PlyProperty) -> npt.NDArray[Any]:
        """The number of each row, in the type that is declared."""
        return self.cells.take(self.layout.offsets[column.name], column.code)

    def lists(self, column: PlyProperty) -> tuple[Integers, npt.NDArray[Any]]:
        """The length of the list of each row, and the numbers of all lists, one after the other."""
        lengths, starts = list_values(self.layout, self.cells, column)
        width = self.cells.width(column.code)
        if (lengths[:1] == lengths).all() and 0 < lengths.max(initial=0) < len(lengths):
            places = [starts + width * number for number in range(lengths[0])]
            columns = [self.cells.take(place, column.code) for place in places]
            return lengths, np.stack(columns, axis=1).ravel()
        offsets = np.repeat(starts, lengths) + width * ragged_indices(0 * lengths, lengths)
        return lengths, self.cells.take(offsets, column.code)


def read_ply_tables(data: bytes) -> dict[str, PlyTable]:
    """The tables of the bytes of a PLY file, by the names of their elements.

    That of faces is left out if it is empty and there are triangle strips.

    Raises
    ------
    FormatError
        If the header is wrong, there is no table of vertices or of faces, or the declared rows are
        not all there.
    """
    header = read_ply_header(data)
    names = [element.name for element in header.elements]
    if "vertex" not in names or not {"face", STRIPS} & {*names}:
        raise FormatError(
            f"has elements {', '.join(names) or '(none)'}; a mesh needs 'vertex', and 'face' or "
            f"{STRIPS!r}"
        )
    cells = _cells(header, data)
    tables: dict[str, PlyTable] = {}
    start = 0
    for element in header.elements:
        layout = locate_element(element, cells, start)
        tables.setdefault(element.name, PlyTable(element, layout, cells))
        start = layout.end
    if STRIPS in tables and "face" in tables and tables["face"].element.n_rows == 0:
        del tables["face"]
    return tables


def _cells(header: PlyHeader, data: bytes) -> PlyCells:
    if header.encoding != "ascii":
        order = "<" if header.encoding == "binary_little_endian" else ">"
        return BinaryCells(data[header.body_start :], order)
    # The header goes through too, so that a wrong word is named with its line of the file.
    lines = split_lines(data)
    first = int(np.searchsorted(lines.starts, header.body_start))
    values = lines.floats(np.arange(first, len(lines.starts)))
    return WordCells(values, lambda cell: lines.place_of_word(first + cell))
