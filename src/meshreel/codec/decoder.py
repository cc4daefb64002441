"""The bytes of a stream to a mesh sequence."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.header import Header
from meshreel.bitstream.layout import Section
from meshreel.bitstream.reader import Stream, read_stream
from meshreel.codec import payloads
from meshreel.codec.blocks import StoredBlock, frame_sources
from meshreel.codec.mesh_model import MeshModel
from meshreel.codec.methods import (
    Basis,
    Laplacian,
    Method,
    Order,
    choice_of_code,
    method_of_code,
)
from meshreel.codec.pipeline import FramesOf
from meshreel.connectivity.coder import decode_connectivity, decode_order
from meshreel.entropy.floats import decode_floats
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.progress import Progress, silent
from meshreel.sequence import Faces, MeshSequence
from meshreel.subspace.trajectories import BoundingFrame, from_matrices
from meshreel.threads import chunks, in_threads

Vertices = npt.NDArray[np.floating]
Integers = npt.NDArray[np.int64]

CHUNK_BYTES = 1 << 22
"""Size of the float64 frames that are expanded at a time: they should stay in the cache."""


def decode(
    data: bytes,
    *,
    frames: slice | None = None,
    n_modes: int | None = None,
    progress: Progress = silent,
) -> MeshSequence:
    """The sequence that a `.reel` stream holds.

    Parameters
    ----------
    data : bytes
        A whole stream, from `encode` or a file.
    frames : slice, optional
        Frames to give back, as Python slices count them, without a step; only the blocks that
        hold some of them are decoded. Default: all.
    n_modes : int, optional
        Stop after so many modes of each block: a coarser animation, sooner. Default: all. Streams
        of `reel` only; corrections are left out then.
    progress : callable, optional
        Called with the stage and the share done, 0..1.

    Raises
    ------
    InvalidInputError
        If `frames` names no frame or has a step, or `n_modes` is below 1 or not for this stream.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the bytes are not a whole stream that this build reads.
    """
    progress("connectivity", 0.0)
    stream = read_stream(bytes(data))
    header, method = stream.header, method_of_code(stream.header.method)
    wanted = _frame_range(frames, header.n_frames)
    _check_modes(n_modes, method)
    mesh = read_mesh(stream, method)
    order, faces = _given_order(stream, mesh)
    vertices = np.empty((len(wanted), header.n_verts, 3), _number_type(header))
    # Damaged values may overflow; MeshSequence tells what is not finite.
    with np.errstate(over="ignore", invalid="ignore"):
        for stored, frames_of in frame_sources(stream, mesh, method, wanted, order, n_modes):
            start = max(stored.start, wanted.start)
            stop = min(stored.start + stored.n_frames, wanted.stop)
            target = vertices[start - wanted.start : stop - wanted.start]
            before = start - wanted.start

            def report(done: int, before: int = before) -> None:
                progress("frames", (before + done) / len(wanted))

            _fill(target, start - stored.start, frames_of, header, report)
            if method.basis is not Basis.JOINT:
                _fill_exact(target, start - stored.start, stored, mesh, order)
    progress("frames", 1.0)
    return _sequence(vertices, faces, header)


def read_mesh(stream: Stream, method: Method) -> MeshModel:
    """Connectivity, anchors and what follows from them, in internal order."""
    header = stream.header
    faces = decode_connectivity(stream.only(Section.CONNECTIVITY), header.n_verts, header.n_faces)
    anchors = np.zeros(0, np.int64)
    if method.has_anchors:
        anchors = payloads.read_anchor_vertices(
            stream.only(Section.ANCHOR_VERTICES), header.n_verts
        )
    return MeshModel(faces, header.n_verts, anchors, choice_of_code(Laplacian, header.laplacian))


def _check_modes(n_modes: int | None, method: Method) -> None:
    if n_modes is None:
        return
    if method.basis is not Basis.JOINT:
        raise InvalidInputError(
            f"a stream of method {method.name} is decoded with all its modes; leave n_modes out"
        )
    if not 1 <= n_modes < float("inf") or int(n_modes) != n_modes:
        raise InvalidInputError(f"n_modes must be a whole number of at least 1; got {n_modes}")


def _frame_range(frames: slice | None, n_frames: int) -> range:
    start, stop, step = (frames or slice(None)).indices(n_frames)
    if step != 1:
        raise InvalidInputError(f"frames must have no step; got {frames}")
    if start >= stop:
        raise InvalidInputError(
            f"frames {frames and frames.start}:{frames and frames.stop} name no frame; "
            f"the stream has frames 0:{n_frames}"
        )
    return range(start, stop)


def _given_order(stream: Stream, mesh: MeshModel) -> tuple[Integers, Faces]:
    """The internal number of each vertex that goes out, and the faces that go out."""
    if choice_of_code(Order, stream.header.order) is Order.DROP:
        return np.arange(mesh.n_verts), mesh.faces
    internal_to_given, faces = decode_order(stream.only(Section.ORDER), mesh.faces, mesh.n_verts)
    return np.argsort(internal_to_given), faces


def _fill(
    target: Vertices,
    first: int,
    frames_of: FramesOf,
    header: Header,
    report: Callable[[int], None],
) -> None:
    """Fill `target` with frames of a block, from its frame `first` on; reports how many are."""
    frame = BoundingFrame(header.origin, header.scale)

    def fill(piece: slice) -> None:
        matrices = frames_of(slice(first + piece.start, first + piece.stop))
        target[piece] = from_matrices(matrices, frame, target.dtype)

    pieces = chunks(len(target), max(1, CHUNK_BYTES // (24 * header.n_verts)))
    in_threads(fill, pieces, lambda done: report(pieces[done - 1].stop))


def _fill_exact(
    target: Vertices, first: int, stored: StoredBlock, mesh: MeshModel, order: Integers
) -> None:
    """Put isolated vertices where they were."""
    if len(mesh.isolated):
        shape = (stored.n_frames, len(mesh.isolated), 3)
        exact = decode_floats(stored.payload(Section.EXACT), shape, target.dtype)
        target[:, np.argsort(order)[mesh.isolated]] = exact[first : first + len(target)]


def _sequence(vertices: Vertices, faces: Faces, header: Header) -> MeshSequence:
    try:
        return MeshSequence(vertices, faces, header.fps, header.name)
    except InvalidInputError as error:
        raise CorruptStreamError(f"the stream decodes to an invalid mesh: {error}") from error


def _number_type(header: Header) -> type[np.float32] | type[np.float64]:
    return np.float32 if header.vertex_type == 4 else np.float64
