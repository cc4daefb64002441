"""Cut a volume mesh open: hide the cells on one side of a plane."""

import re
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import InvalidInputError, Keyword
from meshreel.kernel.cells import cell_sizes
from meshreel.model.cells import Cells
from meshreel.model.sequence import Faces, FrameSource
from meshreel.model.surface import Domain, Surface

AXES = "xyz"
_TEXT = re.compile(r"(-?)([xyz])(?:=([+-]?[0-9.]+(?:e[+-]?[0-9]+)?)(%?))?", re.I)


@dataclass(frozen=True)
class Cut:
    """A plane perpendicular to an axis."""

    axis: int
    position: float
    """In model units, or in percent of the bounding box of the first frame."""
    is_percent: bool
    keeps_high: bool = False
    """Whether the cells above the plane stay, and not those below."""

    def select_cells(self, cells: Cells, points: npt.NDArray[np.floating]) -> Integers:
        """Return the cells whose center, the mean of their nodes, is on the visible side.

        Parameters
        ----------
        points : float array of shape (V, 3)
            The first frame; a cell is hidden in all frames or in none.

        Raises
        ------
        InvalidInputError
            If there is no such cell.
        """
        along = np.asarray(points[:, self.axis], np.float64)
        low, high = along.min(), along.max()
        limit = low + self.position / 100 * (high - low) if self.is_percent else self.position
        sums = np.add.reduceat(along[cells.nodes], cells.starts[:-1])
        centers = sums / np.diff(cells.starts)
        selected = np.flatnonzero(centers > limit if self.keeps_high else centers <= limit)
        if not len(selected):
            side = "above" if self.keeps_high else "below"
            axis = AXES[self.axis]
            raise InvalidInputError(
                f"no cell is {side} {axis} = {limit:.6g}; the mesh reaches from {axis} = {low:.6g} "
                f"to {high:.6g}; move the plane with ",
                Keyword("cut"),
            )
        return selected


def parse_cut(text: str) -> Cut:
    """Parse "x=40%", "x=0.2" or "x", which is 50%; "-x" keeps the other side.

    Raises
    ------
    InvalidInputError
        If the text is none of these.
    """
    match = _TEXT.fullmatch(text.strip())
    try:
        position = float(match[3] or 50) if match else np.nan
    except ValueError:
        position = np.nan
    if match is None or not np.isfinite(position):
        raise InvalidInputError(
            Keyword("cut"),
            " is an axis and a position: x=40% of the box, x=0.2 in model units, x for the "
            f"middle, or -x to keep the other side; got {text!r}",
        )
    is_percent = match[3] is None or match[4] == "%"
    return Cut(AXES.index(match[2].lower()), position, is_percent, match[1] == "-")


def cut_open(segment: FrameSource, cut: Cut) -> tuple[Faces, Surface, Integers]:
    """Return the triangles and the surface of the visible cells, and the cell of each polygon.

    Raises
    ------
    InvalidInputError
        If the mesh has no cells, or the cut hides all.
    """
    cells = segment.surface.cells
    if cells is None:
        raise InvalidInputError(
            Keyword("cut"), " shows the inside of cells; the mesh is a surface without cells"
        )
    selected = cut.select_cells(cells, segment.read(0, 1)[0])
    is_selected = np.zeros(cells.n_cells, bool)
    is_selected[selected] = True
    nodes = cells.nodes[np.repeat(is_selected, cell_sizes()[cells.types])]
    sides = Cells(cells.types[selected], nodes).surface(segment.n_verts)
    at_vertices = [
        attribute for attribute in segment.surface.attributes if attribute.domain is Domain.VERTEX
    ]
    surface = replace(
        segment.surface,
        face_sizes=sides.sizes,
        attributes=tuple(at_vertices),
        groups=(),
        parts=(),
        hard_edges=None,
    )
    return sides.triangles, surface, selected[sides.owners]
