"""A mesh sequence to the bytes of a stream."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.bitstream.header import Header
from meshreel.bitstream.layout import Section, VertexType
from meshreel.bitstream.writer import write_stream
from meshreel.codec import payloads
from meshreel.codec.blocks import tracked_from, write_coded_block, write_field_block
from meshreel.codec.config import (
    DEFAULT_ALLOCATION,
    DEFAULT_ITERATIONS,
    DEFAULT_LAPLACIAN,
    DEFAULT_METHOD,
    DEFAULT_ORDER,
    EncoderConfig,
)
from meshreel.codec.mesh_model import MeshModel, choose_anchors
from meshreel.codec.methods import Basis, Order
from meshreel.codec.pipeline import Quantized, analyse, modes_needed
from meshreel.codec.reel import FieldChoices, FieldMesh, analyse_fields
from meshreel.connectivity.coder import CodedConnectivity, encode_connectivity
from meshreel.entropy.floats import encode_floats
from meshreel.progress import Progress, silent
from meshreel.sequence import Faces, MeshSequence
from meshreel.subspace.trajectories import BoundingFrame, bounding_frame, to_matrices


def encode(
    sequence: MeshSequence,
    method: str = DEFAULT_METHOD,
    *,
    n_modes: int | None = None,
    energy: float | None = None,
    bits: int | Sequence[int] | None = None,
    allocation: str = DEFAULT_ALLOCATION,
    anchors: float | None = None,
    laplacian: str = DEFAULT_LAPLACIAN,
    order: str = DEFAULT_ORDER,
    block_frames: int | None = None,
    n_iterations: int = DEFAULT_ITERATIONS,
    step: float | None = None,
    progress: Progress = silent,
) -> bytes:
    """The bytes of a `.reel` stream that holds the sequence.

    Parameters
    ----------
    sequence : MeshSequence
    method : {"pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft", "reel"}
        Variant of the paper (`codec.methods.METHODS`). `pca-qp`, the default: deltas on the
        eigen-trajectories of each axis, least squares with anchors. `pca`, `pca-q`: without
        anchors, the first at 16 bits. `v2v`: vertices instead of deltas. `pca-qs`: as `pca-qp`,
        decoded one frame after another. `blocks`: eigen-trajectories of short blocks, tracked.
        `gft`: each frame's deltas on the low frequencies of the graph. `reel`: our own, several
        times smaller, with a `step` instead of bits; it is in the making, and later builds may
        refuse its streams.
    n_modes : int, optional
        Eigen-trajectories to keep of each axis (the paper's k_l); at most as many as a block has
        frames are used. Excludes `energy`. With `gft`, graph frequencies; default 5 % of the
        vertices.
    energy : float, optional
        Share of the shape's energy to keep, 0..1; it chooses the number of modes. What is left
        out makes a KG error of sqrt(1 - energy). Default 0.99995, that is 0.7 %.
    bits : int, or sequence of int, optional
        Bits of the largest coefficient, 2..24; or bits of each row, where 0 leaves the row out.
        Default 9 (`pca`: 16).
    allocation : {"energy", "constant"}
        How a single number of bits is spread over the rows: all share the step of the largest,
        so that bits follow a row's energy; or each takes that many bits of its own range.
    anchors : float, optional
        Share of the vertices sent as anchors, 0..1, where the method has them; default 0.01.
        Every connected component gets at least one: with 0 this is decoding by L alone (Eq. 11).
    laplacian : {"normalized", "combinatorial"}
        I - D^-1 C (Eq. 3), which measured better, or D - C (Eq. 1).
    order : {"keep", "vertices", "drop"}
        Keep vertices and faces in the order they came; or the vertices only; or neither, which
        gives the smallest stream.
    block_frames : int, optional
        Frames that are coded together. Default: all of them (`blocks`: 25).
    n_iterations : int, default 2
        Orthogonal iterations from one block to the next (`blocks`).
    step : float, optional
        Step of `reel` as it acts on a position, in diagonals of the bounding box; it sets rate and
        quality. Default 0.0003.
    progress : callable, optional
        Called with the stage and the share done, 0..1.

    Raises
    ------
    InvalidInputError
        If an option is out of range, or the mesh is too large for the method.

    References
    ----------
    G. Arvanitis, A. S. Lalos, K. Moustakas, "Fast Spatio-temporal Compression of Dynamic 3D
    Meshes".
    """
    config = EncoderConfig(
        method=method,
        n_modes=n_modes,
        energy=energy,
        bits=bits,
        allocation=allocation,
        anchors=anchors,
        laplacian=laplacian,
        order=order,
        block_frames=block_frames,
        n_iterations=n_iterations,
        step=step,
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
    mesh = _mesh_model(connectivity.internal_faces, sequence.n_verts, config)
    yield Section.CONNECTIVITY, connectivity.payload
    if config.order_choice is not Order.DROP:
        yield Section.ORDER, connectivity.order_payload
    if config.method_row.has_anchors:
        yield Section.ANCHOR_VERTICES, payloads.write_anchor_vertices(mesh.anchors)
    blocks = _Blocks(sequence, connectivity.internal_to_given, config)
    config = _with_modes_for_all(config, blocks, frame)
    before: Quantized | None = None
    choices = FieldChoices(config.step_or_default, config.n_modes)
    field_mesh = FieldMesh(mesh, choices.stencil_size)
    for start, vertices in blocks:
        progress("frames", start / sequence.n_frames)
        before = tracked_from(config.method_row, before, len(vertices))
        matrices = to_matrices(vertices, frame)
        if config.method_row.basis is Basis.JOINT:
            fields = analyse_fields(matrices, field_mesh, choices)
            yield from write_field_block(fields, field_mesh)
        else:
            block = analyse(matrices, mesh, config, before)
            yield from write_coded_block(block, len(vertices), config.method_row, before)
            before = block.basis
        if len(mesh.isolated):
            yield Section.EXACT, encode_floats(vertices[:, mesh.isolated])
    progress("frames", 1.0)


def _mesh_model(faces: Faces, n_verts: int, config: EncoderConfig) -> MeshModel:
    anchors = np.zeros(0, np.int64)
    if config.method_row.has_anchors:
        anchors = choose_anchors(faces, n_verts, config.anchor_share)
    return MeshModel(faces, n_verts, anchors, config.laplacian_choice)


@dataclass(frozen=True)
class _Blocks:
    """The blocks of a sequence in internal vertex order, made when asked for."""

    sequence: MeshSequence
    internal_to_given: npt.NDArray[np.int64]
    config: EncoderConfig

    def __iter__(self) -> Iterator[tuple[int, npt.NDArray[np.floating]]]:
        """First frame and positions of each block."""
        size = self.config.frames_in_block(self.sequence.n_frames)
        for start in range(0, self.sequence.n_frames, size):
            yield start, self.sequence.vertices[start : start + size, self.internal_to_given]


def _with_modes_for_all(
    config: EncoderConfig, blocks: _Blocks, frame: BoundingFrame
) -> EncoderConfig:
    """The configuration, with the number of modes that a tracked basis has in all its blocks."""
    if config.method_row.basis is not Basis.TRACKED or config.n_modes is not None:
        return config
    needed = max(modes_needed(to_matrices(vertices, frame), config) for _, vertices in blocks)
    return replace(config, n_modes=needed, energy=None)
