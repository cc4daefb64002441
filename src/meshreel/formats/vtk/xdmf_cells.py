"""Conversion of XDMF topologies to VTK cells."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.vtk.cells import POLY_LINE, POLY_VERTEX, POLYGON, Cells

CELLS = {
    1: ("polyvertex", POLY_VERTEX, 0), 2: ("polyline", POLY_LINE, 0), 3: ("polygon", POLYGON, 0),
    4: ("triangle", 5, 3), 5: ("quadrilateral", 9, 4), 6: ("tetrahedron", 10, 4),
    7: ("pyramid", 14, 5), 8: ("wedge", 13, 6), 9: ("hexahedron", 12, 8),
    34: ("edge_3", 21, 3), 35: ("quadrilateral_9", 28, 9), 36: ("triangle_6", 22, 6),
    37: ("quadrilateral_8", 23, 8), 38: ("tetrahedron_10", 24, 10), 39: ("pyramid_13", 27, 13),
    40: ("wedge_15", 26, 15), 41: ("wedge_18", 32, 18), 48: ("hexahedron_20", 25, 20),
    49: ("hexahedron_24", 33, 24), 50: ("hexahedron_27", 29, 27),
}  # fmt: skip
"""Name, VTK type and point count of each XDMF cell type; count 0 is stored with each cell."""

SHORT_NAMES = {
    "tri": "triangle", "quad": "quadrilateral", "tet": "tetrahedron", "hex": "hexahedron",
}  # fmt: skip
BY_NAME = {name: (kind, n_points) for name, kind, n_points in CELLS.values()}


def read_cells(name: str, values: npt.NDArray[Any], n_points: int) -> Cells:
    """Return the cells of an XDMF topology.

    Parameters
    ----------
    name : str
        Topology type, such as "Triangle" or "Mixed".
    values : integer array of shape (N,) or (N, C)
    n_points : int
        Points of each polygon or line, if the topology declares it; otherwise 0.

    Raises
    ------
    FormatError
        If the type is unsupported, or the numbers do not fit it.
    """
    if values.dtype.kind not in "iu":
        raise FormatError(f"has a Topology of {values.dtype}; expected integers")
    head, _, tail = name.lower().partition("_")
    known = SHORT_NAMES.get(head, head) + (f"_{tail}" if tail else "")
    if known == "mixed":
        return _mixed(values.ravel().astype(np.int64))
    if known not in BY_NAME:
        raise FormatError(f"has a Topology of unsupported type {name[:40]!r}")
    kind, fixed = BY_NAME[known]
    width = fixed or n_points or (values.shape[1] if values.ndim == 2 else 1)
    if values.size % width:
        raise FormatError(f"has a Topology of {values.size} numbers; cells of {known} have {width}")
    n_cells = values.size // width
    counts = np.full(n_cells, width, np.int64)
    return Cells(np.full(n_cells, kind), counts, values.ravel().astype(np.int64))


def _mixed(values: npt.NDArray[np.int64]) -> Cells:
    """Parse cells that each begin with their type, and with their point count if it varies."""
    numbers, at = values.tolist(), 0
    kinds, counts, is_point = [], [], np.ones(len(values), bool)
    while at < len(numbers):
        if numbers[at] not in CELLS:
            raise FormatError(f"has a cell of unsupported type {numbers[at]}")
        _, kind, count = CELLS[numbers[at]]
        is_point[at] = False
        at += 1
        if count == 0:
            count = numbers[at] if at < len(numbers) else -1
            is_point[at : at + 1] = False
            at += 1
        if count < 0 or at + count > len(numbers):
            raise FormatError("has a Topology that ends within a cell")
        kinds.append(kind)
        counts.append(count)
        at += count
    return Cells(np.array(kinds, np.int64), np.array(counts, np.int64), values[is_point])
