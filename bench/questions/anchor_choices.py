"""Sets of anchors that the study compares with farthest points."""

from collections.abc import Callable
from functools import partial

import numpy as np

from meshreel.arrays import Integers
from meshreel.codec.bitstream.layout import Laplacian
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.model.sequence import MeshSequence
from meshreel.paper.anchor_exchange import exchange_anchors
from meshreel.paper.anchors import choose_anchors, first_of_components
from meshreel.paper.laplacian import adjacency_matrix, neighbors_of
from meshreel.paper.mesh_model import MeshModel
from meshreel.paper.stream import read
from meshreel.paper.sweeps import ANCHORS, BITS, MODES
from meshreel.runtime.extras import PEERS

N_NOISE_COLUMNS = 512
"""Columns of white noise, whose squared error approximates a trace."""

N_ROUNDS = 5
"""Rounds in which vertices with large errors become anchors."""

SPACING = 6
"""Edges between anchors that are chosen in the same round."""


def table_stream(sequence: MeshSequence, anchors: Integers, bits: int = BITS) -> bytes:
    """Encode a sequence as `pca-qp` does for the tables, with these anchors."""
    modes = min(MODES, sequence.n_frames)
    return encode(sequence, "pca-qp", n_modes=modes, bits=bits, anchors=anchors.tolist())


def random_anchors(sequence: MeshSequence, farthest: Integers, seed: int) -> Integers:
    """As many random vertices."""
    rng = np.random.default_rng(seed)
    return choose_anchors(sequence.faces, sequence.n_verts, ANCHORS, rng)


def low_frequency_anchors(sequence: MeshSequence, farthest: Integers) -> Integers:
    """Pivots of a QR decomposition of as many low graph frequencies (Q-DEIM).

    References
    ----------
    Z. Drmac, S. Gugercin, "A new selection operator for the discrete empirical interpolation
    method", SIAM Journal on Scientific Computing 38(2), 2016.
    """
    mesh = _mesh_model(sequence, farthest)
    frequencies = mesh.graph_fourier_basis(len(farthest))
    qr = PEERS.load("linalg").qr
    *_, pivots = qr(frequencies.T, mode="economic", pivoting=True)
    ranked = pivots[~np.isin(pivots, mesh.isolated)].astype(np.int64)
    return first_of_components(ranked, sequence.faces, sequence.n_verts, len(farthest))


def white_noise_anchors(sequence: MeshSequence, farthest: Integers) -> Integers:
    """Anchors that minimize the error of white noise in the deltas: an A-optimal design.

    They depend on the mesh alone. The expected squared error is the trace of the covariance.

    References
    ----------
    F. Pukelsheim, "Optimal design of experiments", 1993.
    """
    rng = np.random.default_rng(0)
    noise = rng.standard_normal((sequence.n_verts, N_NOISE_COLUMNS))
    return exchange_anchors(_mesh_model(sequence, farthest), [noise])


def large_error_anchors(sequence: MeshSequence, farthest: Integers) -> Integers:
    """Farthest points for one half; the other half are vertices with the largest decoded errors.

    They are added in rounds, each after decoding with all anchors before, and not close together.

    References
    ----------
    O. Sorkine, D. Cohen-Or, D. Irony, S. Toledo, "Geometry-aware bases for shape approximation",
    IEEE TVCG 11(2), 2005.
    """
    adjacency = adjacency_matrix(sequence.faces, sequence.n_verts)
    isolated = _mesh_model(sequence, farthest).isolated
    anchors = choose_anchors(sequence.faces, sequence.n_verts, ANCHORS / 2)
    per_round = -(-(len(farthest) - len(anchors)) // N_ROUNDS)
    while len(anchors) < len(farthest):
        vertices = decode(table_stream(sequence, anchors)).vertices
        errors = np.square(vertices - sequence.vertices, dtype=np.float64).sum(axis=(0, 2))
        for _ in range(min(per_round, len(farthest) - len(anchors))):
            errors[anchors] = errors[isolated] = -1.0
            anchors = np.append(anchors, np.argmax(errors))
            near = anchors[-1:]
            for _ in range(SPACING):
                near = np.union1d(near, neighbors_of(adjacency, near)[1])
            errors[near] = 0.0
    return np.sort(anchors)


def optimized_anchors(sequence: MeshSequence, farthest: Integers) -> Integers:
    """Anchors of ``choices="anchor-set=optimized"``."""
    data = encode(
        sequence,
        "pca-qp",
        n_modes=min(MODES, sequence.n_frames),
        bits=BITS,
        anchors=ANCHORS,
        choices="anchor-set=optimized",
    )
    return read(data).anchors


def _mesh_model(sequence: MeshSequence, anchors: Integers) -> MeshModel:
    return MeshModel(sequence.faces, sequence.n_verts, anchors, Laplacian.NORMALIZED)


ANCHOR_CHOICES: dict[str, Callable[[MeshSequence, Integers], Integers]] = {
    "random 1": partial(random_anchors, seed=1),
    "random 2": partial(random_anchors, seed=2),
    "random 3": partial(random_anchors, seed=3),
    "low frequencies": low_frequency_anchors,
    "white noise": white_noise_anchors,
    "large errors": large_error_anchors,
    "optimized": optimized_anchors,
}
"""Functions of a sequence and its farthest points, by name."""
