"""Decoder of the blocks of the paper's variants."""

from collections import OrderedDict
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from meshreel.arrays import Vertices
from meshreel.codec.bitstream.layout import Laplacian, Section
from meshreel.codec.memory import DEFAULT_LIMIT, OWN_STREAM, UNLIMITED, MemoryLimit
from meshreel.codec.open_stream import OpenStream, whole_stream
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.paper.blocks import (
    Dictionaries,
    StoredBlock,
    only_section,
    read_anchor_vertices,
    read_coded_block,
    read_curves,
    stored_block,
)
from meshreel.paper.coded_values import CodedBlock, Quantized
from meshreel.paper.exact_values import decode_exact
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.reconstruction_system import factor_bytes
from meshreel.paper.synthesis import DecodedBlock, synthesise
from meshreel.paper.variants import METHODS, Variant, variant_named
from meshreel.runtime.threads import fork_safe_lock

N_CACHED_BLOCKS = 3
"""Number of decoded blocks in the cache, so that seeking across a border is cheap."""

DENSE_BYTES = 16
"""Bytes per entry of a dense matrix and its eigenvectors."""


class PaperBlockDecoder:
    """Decodes the blocks of a stream in any order; the last tracked dictionary is kept.

    Parameters
    ----------
    n_modes : int, optional
        Rows of coefficients to use of each block (the paper's k_l). Default: all.
    """

    def __init__(self, opened: OpenStream, variant: Variant, n_modes: int | None = None) -> None:
        self._opened = opened
        self._variant = variant
        self._n_modes = n_modes
        self._dictionaries = Dictionaries(partial(stored_block, opened), variant)

    @cached_property
    def mesh(self) -> MeshModel:
        """Connectivity, anchors and Laplacian, in internal order; raises as `stored_mesh`."""
        return stored_mesh(self._opened, self._variant)

    def coded(self, stored: StoredBlock, number: int) -> CodedBlock:
        """The integers of a block, with its complete dictionary."""
        basis = self._dictionaries.of(number)
        return read_coded_block(stored, self.mesh, self._variant, basis)

    def all_coded(self) -> list[CodedBlock]:
        """The integers of every block, with complete dictionaries."""
        numbers = range(self._opened.n_blocks)
        return [self.coded(stored_block(self._opened, number), number) for number in numbers]

    def block(self, number: int) -> DecodedBlock:
        """A block of the stream, decoded.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        MemoryLimitError
            If it takes more memory than allowed.
        """
        stored = stored_block(self._opened, number)
        order = self._opened.file.stored_mesh[1].astype(np.int64)
        with np.errstate(over="ignore", invalid="ignore"):
            block = self.coded(stored, number).values
            if self._n_modes is not None:
                block = block.truncated(self._n_modes)
            if block.basis is None:  # the factors of the sparse solver may be dense, too
                n_bytes = DENSE_BYTES * self._opened.n_verts**2
                self._opened.limit.require(n_bytes, "the graph Fourier basis")
            # Decoded first: it rejects a wrong number of isolated vertices, before the synthesis,
            # whose time depends on that number.
            exact = self.exact(stored)
            frames_of = synthesise(block, self.mesh, self._variant, order)
        return DecodedBlock(
            start=stored.start,
            n_frames=stored.n_frames,
            frames_of=frames_of,
            frame=self._opened.frame,
            exact=exact,
            exact_vertices=np.argsort(order)[self.mesh.isolated],
        )

    def exact(self, stored: StoredBlock) -> Vertices | None:
        """Positions of the N isolated vertices of a block, of shape (T_b, N, 3); None without any.

        Raises
        ------
        CorruptStreamError
            If they are damaged.
        """
        if not len(self.mesh.isolated):
            return None
        shape = (stored.n_frames, len(self.mesh.isolated), 3)
        return decode_exact(stored.payload(Section.EXACT), shape, self._opened.dtype)


class DecodedFrames:
    """Frames of decoded blocks, with a cache of blocks; thread-safe.

    Parameters
    ----------
    starts : list of int
        First frame of each block, and the number of all frames.
    """

    def __init__(self, decoder: PaperBlockDecoder, starts: list[int]) -> None:
        self._decoder, self._starts = decoder, starts
        self._cache: OrderedDict[int, DecodedBlock] = OrderedDict()
        self._lock = fork_safe_lock()

    def load(self, block: int, track: int = 0) -> None:
        """Decode a block unless it is cached; raises as `PaperBlockDecoder.block`."""
        self._block(block)

    def fill(self, out: Vertices, first: int, track: int = 0) -> None:
        """Fill an array of shape (n, V, 3) with frames starting at `first`.

        Raises
        ------
        CorruptStreamError
            If a block is damaged, or a position is not finite.
        MemoryLimitError
            As `PaperBlockDecoder.block`.
        """
        stop = first + len(out)
        for number, (begin, end) in enumerate(pairwise(self._starts)):
            low, high = max(first, begin), min(stop, end)
            if low < high:
                self._block(number).fill(out[low - first : high - first], low - begin)
        if not np.isfinite(out).all():
            raise CorruptStreamError(
                f"frames {first}:{stop} decode to positions that are not finite"
            )

    def close(self) -> None:
        """Clear the cache."""
        self._cache.clear()

    def _block(self, number: int) -> DecodedBlock:
        with self._lock:
            if number not in self._cache:
                self._cache[number] = self._decoder.block(number)
            self._cache.move_to_end(number)
            while len(self._cache) > N_CACHED_BLOCKS:
                self._cache.popitem(last=False)
            return self._cache[number]


def stored_mesh(opened: OpenStream, variant: Variant) -> MeshModel:
    """The mesh model of a stream: connectivity and anchors, in internal order."""
    anchors, shape = np.zeros(0, np.int64), None
    if variant.has_anchors:
        system = f"the factored system of {opened.n_verts} vertices"
        opened.limit.require(factor_bytes(opened.n_verts), system)
        payload = only_section(opened, Section.ANCHOR_VERTICES)
        anchors = read_anchor_vertices(payload, opened.n_verts)
    if opened.laplacian is Laplacian.COTANGENT:
        shape = stored_shape(opened).values[:, 0].T
    is_trusted = opened.limit == UNLIMITED  # this process chose its number of graph frequencies
    return MeshModel(
        faces=opened.file.stored_mesh[0],
        n_verts=opened.n_verts,
        anchors=anchors,
        laplacian_choice=opened.laplacian,
        shape=shape,
        n_frames=opened.n_frames,
        basis_memory=OWN_STREAM if is_trusted else None,
    )


def stored_shape(opened: OpenStream) -> Quantized:
    """Positions of shape (3, 1, V) from which the cotangent weights of a stream are computed."""
    return read_curves(only_section(opened, Section.SHAPE), 1, opened.n_verts)


def open_paper_stream(
    data: bytes, limit: MemoryLimit = DEFAULT_LIMIT
) -> tuple[OpenStream, PaperBlockDecoder]:
    """Open a stream of one of the paper's methods, with the decoder of its blocks.

    Raises
    ------
    InvalidInputError
        If the stream has another method.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the bytes are not a complete stream that this build supports.
    MemoryLimitError
        If even the list of sections takes more memory than allowed.
    """
    opened = whole_stream(data, limit)
    if opened.method not in METHODS:
        raise InvalidInputError(
            f"the stream has method {opened.method}, not one of the paper's: "
            f"{', '.join(METHODS)}; encode the sequence with one of these, or use meshreel.decode"
        )
    return opened, PaperBlockDecoder(opened, variant_named(opened.method))


def coded_blocks(data: bytes) -> list[CodedBlock]:
    """The integers of every block of a stream, with complete dictionaries.

    Raises
    ------
    InvalidInputError, CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        As `open_paper_stream`.
    """
    _, decoder = open_paper_stream(bytes(data))
    return decoder.all_coded()
