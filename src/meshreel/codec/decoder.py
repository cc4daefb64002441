"""The bytes of a stream to a mesh sequence."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.header import Header
from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import Stream, read_stream
from meshreel.codec import payloads
from meshreel.codec.mesh_model import MeshModel
from meshreel.codec.methods import Laplacian, Order, choice_of_code, method_of_code
from meshreel.codec.pipeline import CodedBlock, synthesise
from meshreel.connectivity.coder import decode_connectivity, decode_order
from meshreel.entropy.floats import decode_floats
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.progress import Progress, silent
from meshreel.sequence import Faces, MeshSequence
from meshreel.subspace.basis import expand
from meshreel.subspace.trajectories import BoundingFrame, from_matrices

Vertices = npt.NDArray[np.floating]
Integers = npt.NDArray[np.int64]

CHUNK_BYTES = 1 << 22
"""Size of the float64 frames that are expanded at a time: they should stay in the cache."""


@dataclass(frozen=True)
class _Block:
    """A block as it lies in the stream, and where its frames belong."""

    start: int
    n_frames: int
    n_modes: int
    sections: dict[Section, bytes]

    def payload(self, section: Section) -> bytes:
        if section not in self.sections:
            raise CorruptStreamError(
                f"the block of frames {self.start}..{self.start + self.n_frames - 1} has no "
                f"section {section.name}"
            )
        return self.sections[section]


def decode(
    data: bytes, *, frames: slice | None = None, progress: Progress = silent
) -> MeshSequence:
    """The sequence that a `.reel` stream holds.

    Parameters
    ----------
    data : bytes
        A whole stream, from `encode` or a file.
    frames : slice, optional
        Frames to give back, as Python slices count them, without a step; only the blocks that
        hold some of them are decoded. Default: all.
    progress : callable, optional
        Called with the stage and the share done, 0..1.

    Raises
    ------
    InvalidInputError
        If `frames` names no frame or has a step.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the bytes are not a whole stream that this build reads.
    """
    progress("connectivity", 0.0)
    stream = read_stream(bytes(data))
    header = stream.header
    method_of_code(header.method)
    first, last = _frame_range(frames, header.n_frames)
    mesh, order, faces = _mesh(stream)
    vertices = np.empty((last - first, header.n_verts, 3), _number_type(header))
    # Damaged values may overflow; MeshSequence tells what is not finite.
    with np.errstate(over="ignore", invalid="ignore"):
        for block in _blocks(stream):
            start, stop = max(block.start, first), min(block.start + block.n_frames, last)
            if start < stop:
                progress("frames", (start - first) / (last - first))
                target = vertices[start - first : stop - first]
                _decode_block(
                    block,
                    slice(start - block.start, stop - block.start),
                    mesh,
                    order,
                    header,
                    target,
                )
    progress("frames", 1.0)
    return _sequence(vertices, faces, header)


def _frame_range(frames: slice | None, n_frames: int) -> tuple[int, int]:
    start, stop, step = (frames or slice(None)).indices(n_frames)
    if step != 1:
        raise InvalidInputError(f"frames must have no step; got {frames}")
    if start >= stop:
        raise InvalidInputError(
            f"frames {frames and frames.start}:{frames and frames.stop} name no frame; "
            f"the stream has frames 0:{n_frames}"
        )
    return start, stop


def _mesh(stream: Stream) -> tuple[MeshModel, Integers, Faces]:
    """What follows from connectivity; the internal number of each vertex that goes out; faces."""
    header = stream.header
    internal = decode_connectivity(
        stream.only(Section.CONNECTIVITY), header.n_verts, header.n_faces
    )
    anchors = payloads.read_anchor_vertices(stream.only(Section.ANCHOR_VERTICES), header.n_verts)
    mesh = MeshModel(internal, header.n_verts, anchors, choice_of_code(Laplacian, header.laplacian))
    if choice_of_code(Order, header.order) is Order.DROP:
        return mesh, np.arange(header.n_verts), internal
    internal_to_given, faces = decode_order(stream.only(Section.ORDER), internal, header.n_verts)
    return mesh, np.argsort(internal_to_given), faces


def _blocks(stream: Stream) -> Iterator[_Block]:
    """The blocks of a stream, checked to hold all its frames.

    Raises
    ------
    CorruptStreamError
        If their frames are not as many as the header announces.
    """
    blocks, start = [], 0
    for sections in stream.blocks():
        n_frames, n_modes = payloads.read_block(sections[Section.BLOCK])
        blocks.append(_Block(start, n_frames, n_modes, sections))
        start += n_frames
    if start != stream.header.n_frames:
        raise CorruptStreamError(
            f"the blocks hold {start} frames; the header announces {stream.header.n_frames}"
        )
    yield from blocks


def _decode_block(
    block: _Block,
    frames: slice,
    mesh: MeshModel,
    order: Integers,
    header: Header,
    target: Vertices,
) -> None:
    """Fill `target` with frames of a block, vertices in the order that goes out."""
    n_modes = block.n_modes
    basis, coefficients = synthesise(
        CodedBlock(
            payloads.read_basis(block.payload(Section.BASIS), n_modes, block.n_frames),
            payloads.read_anchors(block.payload(Section.ANCHORS), n_modes, len(mesh.anchors)),
            payloads.read_coefficients(
                block.payload(Section.COEFFICIENTS), n_modes, header.n_verts
            ),
        ),
        mesh,
    )
    basis, coefficients = basis[:, frames], coefficients[:, :, order]
    frame = BoundingFrame(header.origin, header.scale)
    chunk = max(1, CHUNK_BYTES // (24 * header.n_verts))
    for start in range(0, len(target), chunk):
        part = slice(start, start + chunk)
        target[part] = from_matrices(expand(basis[:, part], coefficients), frame, target.dtype)
    if len(mesh.isolated):
        shape = (block.n_frames, len(mesh.isolated), 3)
        exact = decode_floats(block.payload(Section.EXACT), shape, target.dtype)
        target[:, np.argsort(order)[mesh.isolated]] = exact[frames]


def _sequence(vertices: Vertices, faces: Faces, header: Header) -> MeshSequence:
    try:
        return MeshSequence(vertices, faces, header.fps, header.name)
    except InvalidInputError as error:
        raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from error


def _number_type(header: Header) -> type[np.float32] | type[np.float64]:
    return np.float32 if header.vertex_type == 4 else np.float64
