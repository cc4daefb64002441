"""The blocks of streams without modes, of `lossless` and `grid`, to frames."""

from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import Section
from meshreel.codec.decoded_block import ExactBlock
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.stored_blocks import StoredBlock
from meshreel.kernel.mesh import Neighbours, neighbours
from meshreel.reel.agreed.blocks import POSITION_COLUMNS, read_exact_block, read_grid_positions

Vertices = npt.NDArray[np.floating]


class ExactBlockDecoder:
    """Decodes the positions in the blocks of `lossless`, in any order; no block needs another.

    Parameters
    ----------
    opened : OpenStream
    """

    def __init__(self, opened: OpenStream) -> None:
        self._opened = opened

    @cached_property
    def _graph(self) -> Neighbours:
        return neighbours(self._opened.internal_faces, self._opened.n_verts)

    def block(self, number: int) -> ExactBlock:
        """A block of the stream, decoded.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """
        stored = self._opened.stored(number)
        return ExactBlock(stored.start, self._positions(stored).take(self._opened.order, axis=1))

    def _positions(self, stored: StoredBlock) -> Vertices:
        opened = self._opened
        shape = opened.n_verts, POSITION_COLUMNS
        return read_exact_block(stored, shape, opened.dtype, self._graph)


class GridBlockDecoder(ExactBlockDecoder):
    """Decodes the positions in the blocks of `grid`, likewise."""

    def _positions(self, stored: StoredBlock) -> Vertices:
        opened = self._opened
        shape = stored.n_frames, opened.n_verts, POSITION_COLUMNS
        payload = stored.payload(Section.VALUES)
        return read_grid_positions(payload, shape, opened.dtype, opened.frame, self._graph)
