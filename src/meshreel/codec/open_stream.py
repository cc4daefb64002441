"""An open stream and the parts that its blocks share: mesh, order, surface, time."""

from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import Stream
from meshreel.codec.choices import Laplacian, Order, choice_of_code
from meshreel.codec.error_bounds import read_promise
from meshreel.codec.memory import DEFAULT_LIMIT, MemoryLimit
from meshreel.codec.methods import BlockDecoder, method_of_code
from meshreel.codec.stored_blocks import StoredBlock, stored_block
from meshreel.codec.surface.payloads import SURFACE_SECTIONS, read_start, read_surface
from meshreel.codec.tracks import TrackHeader, read_track
from meshreel.connectivity.coder import decode_connectivity, decode_order
from meshreel.connectivity.permutation import inverse_permutation
from meshreel.errors import CorruptStreamError
from meshreel.sequence import Faces
from meshreel.subspace.trajectories import BoundingFrame
from meshreel.surface import PLAIN, Surface

Integers = npt.NDArray[np.int64]
Vertices = npt.NDArray[np.floating]


class OpenStream:
    """A stream whose parts are decoded on demand and cached.

    Parameters
    ----------
    stream : Stream
    limit : MemoryLimit, optional
        Of everything that is decoded at once: the mesh, a block, an array that is returned.

    Attributes
    ----------
    stream : Stream
    limit : MemoryLimit
    method : Method
    laplacian : Laplacian
        Laplacian of the deltas, if the method has deltas.
    order_kept : Order
        The order of vertices and faces that is kept.
    promise_percent : float or None
        Error bound that the stream promises, in percent of the diagonal; None if it has none.

    Raises
    ------
    CorruptStreamError
        If its promise is not a positive number.
    UnsupportedVersionError
        If this build does not know its method, Laplacian or order.
    """

    def __init__(self, stream: Stream, limit: MemoryLimit = DEFAULT_LIMIT) -> None:
        self.stream = stream
        self.limit = limit
        self.method = method_of_code(stream.header.method)
        self.laplacian = choice_of_code(Laplacian, stream.header.laplacian)
        self.order_kept = choice_of_code(Order, stream.header.order)
        self.promise_percent = _promise_of(stream)
        self._positions: tuple[int, Vertices] | None = None

    def blocks(self, n_modes: int | None = None) -> BlockDecoder:
        """The decoder of its blocks.

        Parameters
        ----------
        n_modes : int, optional
            Of `reel`, number of leading modes of each block that move; further ones, up to the
            16th at least, are held at their mean over the block. Corrections are omitted.

        Raises
        ------
        InvalidInputError
            If `n_modes` is below 1, or not for this stream.
        """
        return self.method.decoder(self, n_modes)

    def stored(self, number: int) -> StoredBlock:
        """A block as it is stored; raises as `stored_block`."""
        return stored_block(self.stream, self.method, number, self.limit)

    def positions(self, number: int) -> Vertices:
        """Positions of a block, of shape (T_b, V, 3), as they go out; those of the last are kept.

        Raises
        ------
        CorruptStreamError
            If the block is damaged.
        MemoryLimitError
            If it is larger than allowed.
        """
        if self._positions is None or self._positions[0] != number:
            block = self._all_modes.block(number)
            self.require_frames(range(block.start, block.stop))
            found = np.empty((block.n_frames, self.n_verts, 3), self.dtype)
            block.fill(found, 0)
            if not np.isfinite(found).all():
                raise CorruptStreamError(f"block {number} decodes to positions beyond all numbers")
            self.keep_positions(number, found)
        assert self._positions is not None
        return self._positions[1]

    def keep_positions(self, number: int, positions: Vertices) -> None:
        """Keep the positions of a block that are decoded already, for `positions`."""
        self._positions = number, positions

    def require_mesh(self) -> None:
        """Raise MemoryLimitError if decoding the mesh takes more than allowed."""
        header = self.stream.header
        self.limit.require_mesh(header.n_verts, header.n_faces)

    def require_frames(self, frames: range, more_bytes: int = 0) -> None:
        """Raise MemoryLimitError if positions of frames, and so much more, take more than allowed.

        Parameters
        ----------
        frames : range
        more_bytes : int, default 0
            Of their tracks.
        """
        needed = len(frames) * self.n_verts * 3 * self.dtype.itemsize + more_bytes
        tracks = ", with their tracks," if more_bytes else ""
        what = f"frames {frames.start}:{frames.stop} of {self.n_verts} vertices{tracks}"
        self.limit.require(needed, what)

    @cached_property
    def _all_modes(self) -> BlockDecoder:
        return self.blocks()

    @property
    def n_verts(self) -> int:
        """Number of vertices, V."""
        return self.stream.header.n_verts

    @cached_property
    def internal_faces(self) -> Faces:
        """Faces of shape (M, 3), in internal order; raises as `faces`."""
        self.require_mesh()
        header, payload = self.stream.header, self.stream.only(Section.CONNECTIVITY)
        return decode_connectivity(payload, header.n_verts, header.n_faces)

    @cached_property
    def _output_order(self) -> tuple[Integers, Faces]:
        if self.order_kept is Order.DROP:
            return np.arange(self.n_verts), self.internal_faces
        payload = self.stream.only(Section.ORDER)
        internal_to_given, faces = decode_order(payload, self.internal_faces, self.n_verts)
        return inverse_permutation(internal_to_given), faces

    @property
    def order(self) -> Integers:
        """Internal number of each output vertex; raises as `faces`."""
        return self._output_order[0]

    @property
    def faces(self) -> Faces:
        """Faces of shape (M, 3), in output order.

        Raises
        ------
        CorruptStreamError
            If connectivity or order are damaged.
        MemoryLimitError
            If the mesh is larger than allowed.
        """
        return self._output_order[1]

    @cached_property
    def surface(self) -> Surface:
        """Polygons, attributes, groups, parts and materials of the mesh.

        Raises
        ------
        CorruptStreamError, TruncatedStreamError
            If it is damaged, or does not fit the faces.
        """
        leading = self.stream.leading
        sections = [(one.id, one.payload) for one in leading if one.id in SURFACE_SECTIONS]
        if not sections:  # then the faces need not be decoded for it
            return PLAIN
        return read_surface(sections, self.faces, self.n_verts, self.limit)

    @cached_property
    def start_s(self) -> float:
        """Time of the first frame, in seconds; raises as `surface`."""
        starts = [one.payload for one in self.stream.leading if one.id is Section.START]
        return read_start(starts[0]) if starts else 0.0

    @cached_property
    def tracks(self) -> tuple[TrackHeader, ...]:
        """The tracks beside the positions; raises as `read_track`."""
        leading = self.stream.leading
        return tuple(read_track(one.payload) for one in leading if one.id is Section.TRACK)

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the output positions."""
        return np.dtype(np.float32 if self.stream.header.vertex_type == 4 else np.float64)

    @property
    def frame(self) -> BoundingFrame:
        """Centre and diagonal of the bounding box."""
        return BoundingFrame(self.stream.header.origin, self.stream.header.scale)


def _promise_of(stream: Stream) -> float | None:
    for stored in stream.leading:
        if stored.id is Section.PROMISE:
            return read_promise(stored.payload)
    return None
