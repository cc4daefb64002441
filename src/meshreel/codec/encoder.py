"""A mesh sequence to the bytes of a stream."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.header import Header
from meshreel.bitstream.layout import Section, VertexType
from meshreel.bitstream.writer import write_stream
from meshreel.codec import payloads
from meshreel.codec.config import (
    DEFAULT_ANCHORS,
    DEFAULT_BITS,
    DEFAULT_LAPLACIAN,
    DEFAULT_METHOD,
    DEFAULT_ORDER,
    EncoderConfig,
)
from meshreel.codec.mesh_model import MeshModel, choose_anchors
from meshreel.codec.methods import Order
from meshreel.codec.pipeline import analyse
from meshreel.connectivity.coder import CodedConnectivity, encode_connectivity
from meshreel.entropy.floats import encode_floats
from meshreel.progress import Progress, silent
from meshreel.sequence import MeshSequence
from meshreel.subspace.trajectories import BoundingFrame, bounding_frame, to_matrices


def encode(
    sequence: MeshSequence,
    method: str = DEFAULT_METHOD,
    *,
    n_modes: int | None = None,
    energy: float | None = None,
    bits: int = DEFAULT_BITS,
    anchors: float = DEFAULT_ANCHORS,
    laplacian: str = DEFAULT_LAPLACIAN,
    order: str = DEFAULT_ORDER,
    block_frames: int | None = None,
    progress: Progress = silent,
) -> bytes:
    """The bytes of a `.reel` stream that holds the sequence.

    Parameters
    ----------
    sequence : MeshSequence
    method : str, default "pca-qp"
        Delta coordinates projected on the eigen-trajectories of each axis, quantised, decoded by
        least squares with anchors.
    n_modes : int, optional
        Eigen-trajectories to keep of each axis (the paper's k_l); at most as many as a block has
        frames are used. Excludes `energy`.
    energy : float, optional
        Share of the shape's energy to keep, 0..1; it chooses the number of modes. What is left
        out makes a KG error of sqrt(1 - energy). Default 0.99995, that is 0.7 %.
    bits : int, default 9
        Bits of the largest delta coefficient, 2..24; all others share its step.
    anchors : float, default 0.01
        Share of the vertices sent as anchors, 0..1. Every connected component gets at least one:
        with 0 this is decoding by L alone (Eq. 11).
    laplacian : {"normalized", "combinatorial"}
        I - D^-1 C (Eq. 3), which measured better, or D - C (Eq. 1).
    order : {"keep", "vertices", "drop"}
        Keep vertices and faces in the order they came; or the vertices only; or neither, which
        gives the smallest stream.
    block_frames : int, optional
        Frames that are coded together. Default: all of them.
    progress : callable, optional
        Called with the stage and the share done, 0..1.

    Raises
    ------
    InvalidInputError
        If an option is out of range.

    References
    ----------
    G. Arvanitis, A. S. Lalos, K. Moustakas, "Fast Spatio-temporal Compression of Dynamic 3D
    Meshes": the method `pca-qp` is its PCA+qp.
    """
    config = EncoderConfig(
        method=method,
        n_modes=n_modes,
        energy=energy,
        bits=bits,
        anchors=anchors,
        laplacian=laplacian,
        order=order,
        block_frames=block_frames,
    )
    progress("connectivity", 0.0)
    connectivity = encode_connectivity(sequence.faces, sequence.n_verts, order=config.order)
    frame = bounding_frame(sequence.vertices)
    return write_stream(
        _header(sequence, config, frame),
        _sections(sequence, connectivity, frame, config, progress),
    )


def _header(sequence: MeshSequence, config: EncoderConfig, frame: BoundingFrame) -> Header:
    return Header(
        n_frames=sequence.n_frames,
        n_verts=sequence.n_verts,
        n_faces=sequence.n_faces,
        fps=sequence.fps,
        vertex_type=VertexType(sequence.vertices.dtype.itemsize),
        method=config.method_row.code,
        laplacian=config.laplacian_choice,
        order=config.order_choice,
        origin=frame.origin,
        scale=frame.scale,
        name=sequence.name,
    )


def _sections(
    sequence: MeshSequence,
    connectivity: CodedConnectivity,
    frame: BoundingFrame,
    config: EncoderConfig,
    progress: Progress,
) -> Iterator[tuple[Section, bytes]]:
    faces = connectivity.internal_faces
    mesh = MeshModel(
        faces,
        sequence.n_verts,
        choose_anchors(faces, sequence.n_verts, config.anchors),
        config.laplacian_choice,
    )
    yield Section.CONNECTIVITY, connectivity.payload
    if config.order_choice is not Order.DROP:
        yield Section.ORDER, connectivity.order_payload
    yield Section.ANCHOR_VERTICES, payloads.write_anchor_vertices(mesh.anchors)
    size = config.block_frames or sequence.n_frames
    for start in range(0, sequence.n_frames, size):
        progress("frames", start / sequence.n_frames)
        vertices = sequence.vertices[start : start + size, connectivity.internal_to_given]
        yield from _block_sections(vertices, mesh, frame, config)
    progress("frames", 1.0)


def _block_sections(
    vertices: npt.NDArray[np.floating], mesh: MeshModel, frame: BoundingFrame, config: EncoderConfig
) -> Iterator[tuple[Section, bytes]]:
    block = analyse(to_matrices(vertices, frame), mesh, config)
    yield Section.BLOCK, payloads.write_block(len(vertices), block.n_modes)
    yield Section.BASIS, payloads.write_basis(block.basis)
    yield Section.ANCHORS, payloads.write_anchors(block.anchors)
    yield Section.COEFFICIENTS, payloads.write_coefficients(block.coefficients)
    if len(mesh.isolated):
        yield Section.EXACT, encode_floats(vertices[:, mesh.isolated])
