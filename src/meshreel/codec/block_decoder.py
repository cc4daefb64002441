"""The blocks of a stream to frames, one block after another or any of them."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import Stream
from meshreel.codec.corrections import Corrections, corrected
from meshreel.codec.frame_products import FramesOf, ProductFrames, product_frames
from meshreel.codec.methods import (
    Basis,
    Laplacian,
    Method,
    Order,
    choice_of_code,
    method_of_code,
)
from meshreel.codec.stored_blocks import StoredBlock, stored_block
from meshreel.codec.surface.payloads import SURFACE_SECTIONS, read_start, read_surface
from meshreel.connectivity.coder import decode_connectivity, decode_order
from meshreel.entropy.exact import decode_exact
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.paper.blocks import Dictionaries, read_coded_block
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.payloads import read_anchor_vertices
from meshreel.paper.pipeline import synthesise
from meshreel.reel.agreed.blocks import read_corrections, read_field_block
from meshreel.reel.agreed.field_mesh import FieldMesh
from meshreel.reel.agreed.fields import FieldBlock, KeyFields, Layout, key_fields, synthesise_fields
from meshreel.runtime.profiling import staged
from meshreel.runtime.threads import chunks, in_threads
from meshreel.sequence import Faces
from meshreel.subspace.trajectories import BoundingFrame, from_matrices
from meshreel.surface import PLAIN, Surface

Vertices = npt.NDArray[np.floating]
Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

CHUNK_BYTES = 1 << 22
"""Size of the float64 frames that are expanded at a time: they should stay in the cache."""


@dataclass(frozen=True)
class DecodedBlock:
    """A block whose frames are one product away.

    Attributes
    ----------
    start, n_frames : int
        Where its frames belong.
    frames_of : FramesOf
        Coordinate matrices of a slice of its frames, in the order in which vertices go out; what
        is corrected or exact is not so yet.
    frame : BoundingFrame
    exact : float array of shape (T_b, N, 3), or None
        Positions of some vertices, in place of those that are computed.
    exact_places : integer array of shape (N,)
        Which vertices these are, as they go out.
    corrections : Corrections or None
        Of vertices as they go out.
    """

    start: int
    n_frames: int
    frames_of: FramesOf
    frame: BoundingFrame
    exact: Vertices | None
    exact_places: Integers
    corrections: Corrections | None

    @property
    def stop(self) -> int:
        """Frame behind its last one."""
        return self.start + self.n_frames

    @property
    def modes(self) -> ProductFrames | None:
        """Fields and their time vectors, of which frames are the product; some have none."""
        return self.frames_of if isinstance(self.frames_of, ProductFrames) else None

    @cached_property
    def _final_frames_of(self) -> FramesOf:
        if self.corrections is None:
            return self.frames_of
        return corrected(self.frames_of, self.corrections, None)

    @staged("frames")
    def fill(
        self, target: Vertices, first: int, report: Callable[[int], None] | None = None
    ) -> None:
        """Fill an array of shape (T, V, 3) with frames of this block, on all cores.

        Parameters
        ----------
        target : float array of shape (T, V, 3)
        first : int
            Number of the first of them within the block.
        report : callable, optional
            Told how many frames are done.
        """

        def fill(piece: slice) -> None:
            matrices = self._final_frames_of(slice(first + piece.start, first + piece.stop))
            target[piece] = from_matrices(matrices, self.frame, target.dtype)

        pieces = chunks(len(target), max(1, CHUNK_BYTES // (24 * target.shape[1])))
        done = None if report is None else (lambda number: report(pieces[number - 1].stop))
        # Damaged values may overflow; whoever takes the frames looks for what is not finite.
        with np.errstate(over="ignore", invalid="ignore"):
            in_threads(fill, pieces, done)
        if self.exact is not None:
            target[:, self.exact_places] = self.exact[first : first + len(target)]


class BlockDecoder:
    """Decodes the blocks of a stream, and keeps what they share.

    Parameters
    ----------
    stream : Stream
    n_modes : int, optional
        Of `reel`, only the first so many modes of each block move; the others rest at their mean
        over the block. Corrections are left out.

    Raises
    ------
    InvalidInputError
        If `n_modes` is below 1, or not for this stream.
    """

    def __init__(self, stream: Stream, n_modes: int | None = None) -> None:
        self.stream = stream
        self.method = method_of_code(stream.header.method)
        _check_modes(n_modes, self.method)
        self._n_modes = n_modes
        self._field_mesh: FieldMesh | None = None
        self._key: tuple[int, Layout, KeyFields] | None = None
        self._dictionaries = Dictionaries(self.stored, self.method)

    @cached_property
    def _mesh(self) -> MeshModel:
        return read_mesh(self.stream, self.method)

    @cached_property
    def _given_order(self) -> tuple[Integers, Faces]:
        """The internal number of each vertex that goes out, and the faces that go out."""
        mesh = self._mesh
        if choice_of_code(Order, self.stream.header.order) is Order.DROP:
            return np.arange(mesh.n_verts), mesh.faces
        payload = self.stream.only(Section.ORDER)
        internal_to_given, faces = decode_order(payload, mesh.faces, mesh.n_verts)
        return np.argsort(internal_to_given), faces

    @property
    def faces(self) -> Faces:
        """Of shape (M, 3), as they go out.

        Raises
        ------
        CorruptStreamError
            If connectivity or order are damaged.
        """
        return self._given_order[1]

    @cached_property
    def surface(self) -> Surface:
        """What the mesh carries beside positions and triangles.

        Raises
        ------
        CorruptStreamError, TruncatedStreamError
            If it is damaged, or does not fit the faces.
        """
        leading = self.stream.leading
        sections = [(one.id, one.payload) for one in leading if one.id in SURFACE_SECTIONS]
        if not sections:  # then the faces need not be decoded for it
            return PLAIN
        return read_surface(sections, self.faces, self.stream.header.n_verts)

    @cached_property
    def start_s(self) -> float:
        """Time of the first frame, in seconds; raises as `surface`."""
        starts = [one.payload for one in self.stream.leading if one.id is Section.START]
        return read_start(starts[0]) if starts else 0.0

    @property
    def dtype(self) -> np.dtype[np.floating]:
        """Number type of the positions that go out."""
        return np.dtype(np.float32 if self.stream.header.vertex_type == 4 else np.float64)

    @property
    def frame(self) -> BoundingFrame:
        """Where the model lies, and how large it is."""
        return BoundingFrame(self.stream.header.origin, self.stream.header.scale)

    def stored(self, number: int) -> StoredBlock:
        """A block as it lies in the stream; raises as `stored_block`."""
        return stored_block(self.stream, self.method, number)

    def block(self, number: int) -> DecodedBlock:
        """A block of the stream, decoded.

        Raises
        ------
        CorruptStreamError
            If it is damaged.
        """
        stored = self.stored(number)
        order, mesh = self._given_order[0], self._mesh
        with np.errstate(over="ignore", invalid="ignore"):
            frames_of: FramesOf
            if self.method.basis is Basis.JOINT:
                frames_of, exact = self._field_frames(number, stored, order), None
            else:
                basis = self._dictionaries.of(number)
                block = read_coded_block(stored, mesh, self.method, basis)
                frames_of = synthesise(block, mesh, self.method, order)
                exact = self._exact(stored)
        return DecodedBlock(
            start=stored.start,
            n_frames=stored.n_frames,
            frames_of=frames_of,
            frame=self.frame,
            exact=exact,
            exact_places=np.argsort(order)[mesh.isolated],
            corrections=self._corrections(stored, order),
        )

    def _field_frames(self, number: int, stored: StoredBlock, order: Integers) -> ProductFrames:
        block, field_mesh = self._read_fields(stored)
        key = self._key_of(number, block.layout)
        basis, fields = synthesise_fields(block, field_mesh, key)
        if key is None:
            self._key = number, block.layout, key_fields(block.layout, field_mesh, fields)
        if self._n_modes is not None:
            basis = resting_after(basis, self._n_modes)
        return product_frames(basis, fields[:, :, order])

    def _corrections(self, stored: StoredBlock, order: Integers) -> Corrections | None:
        """Corrections of vertices as they go out; they belong to all modes together."""
        if self.method.basis is not Basis.JOINT or self._n_modes is not None:
            return None
        found = read_corrections(stored, self._mesh.n_verts)
        return found and replace(found, vertices=np.argsort(order)[found.vertices])

    def _read_fields(self, stored: StoredBlock) -> tuple[FieldBlock, FieldMesh]:
        block, self._field_mesh = read_field_block(stored, self._mesh, self._field_mesh)
        return block, self._field_mesh

    def _key_of(self, number: int, layout: Layout) -> KeyFields | None:
        """The fields that a block refers to, decoded now or kept from before."""
        if not layout.reference:
            return None
        wanted = number - layout.reference
        if self._key is None or self._key[0] != wanted:
            if wanted < 0:
                raise CorruptStreamError(f"block {number} refers to one before the first")
            block, field_mesh = self._read_fields(self.stored(wanted))
            if block.layout.reference:
                raise CorruptStreamError(
                    f"block {number} refers to block {wanted}, which refers to another itself"
                )
            _, fields = synthesise_fields(block, field_mesh)
            self._key = wanted, block.layout, key_fields(block.layout, field_mesh, fields)
        _, key_layout, key = self._key
        if key_layout.stencil_size != layout.stencil_size:
            raise CorruptStreamError(
                f"block {number} has stencils of {layout.stencil_size}; that which it refers to "
                f"has {key_layout.stencil_size}"
            )
        return key

    def _exact(self, stored: StoredBlock) -> Vertices | None:
        """Positions of isolated vertices."""
        if not len(self._mesh.isolated):
            return None
        shape = (stored.n_frames, len(self._mesh.isolated), 3)
        return decode_exact(stored.payload(Section.EXACT), shape, self.dtype)


def read_mesh(stream: Stream, method: Method) -> MeshModel:
    """Connectivity, anchors and what follows from them, in internal order."""
    header = stream.header
    faces = decode_connectivity(stream.only(Section.CONNECTIVITY), header.n_verts, header.n_faces)
    anchors = np.zeros(0, np.int64)
    if method.has_anchors:
        anchors = read_anchor_vertices(stream.only(Section.ANCHOR_VERTICES), header.n_verts)
    return MeshModel(faces, header.n_verts, anchors, choice_of_code(Laplacian, header.laplacian))


def resting_after(basis: Floats, n_modes: int) -> Floats:
    """Time vectors of shape (3, T, K), of which those behind the first stay at their mean.

    Few modes so begin with the mean shape of the block, and not with nothing.
    """
    means = basis[:, :, n_modes:].mean(axis=1, keepdims=True)
    rest = np.broadcast_to(means, basis[:, :, n_modes:].shape)
    return np.concatenate([basis[:, :, :n_modes], rest], axis=2)


def _check_modes(n_modes: int | None, method: Method) -> None:
    if n_modes is None:
        return
    if method.basis is not Basis.JOINT:
        raise InvalidInputError(
            f"a stream of method {method.name} is decoded with all its modes; leave n_modes= out"
        )
    if not 1 <= n_modes < float("inf") or int(n_modes) != n_modes:
        raise InvalidInputError(f"n_modes must be a whole number of at least 1; got {n_modes}")
