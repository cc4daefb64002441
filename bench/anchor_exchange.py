"""Exchange of anchors for vertices that leave a smaller error in the decoded positions.

R. D. Cook, C. J. Nachtsheim, "A comparison of algorithms for constructing exact D-optimal designs",
Technometrics 22(3), 1980: the modified algorithm of Fedorov. The criterion here is the error.
"""

import numpy as np
import numpy.typing as npt

from meshreel import paper
from meshreel.model.sequence import MeshSequence

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

CANDIDATES_PER_ANCHOR = 10
MAX_PASSES = 3
MIN_REDUCTION = 1e-3
"""Smallest reduction of the squared error by one exchange, in squared errors per anchor."""


def better_anchors(sequence: MeshSequence, stream: paper.PaperStream) -> Integers:
    """Anchors with which the quantized deltas of a stream decode with a smaller error.

    With exact anchors S, deltas ``L x + n`` decode to ``x + e``, ``(L^T L + S^T S) e = L^T n``
    (Eq. 12 of the paper). Candidates are farthest points.
    """
    (block,), laplacian, anchors = stream.blocks, stream.laplacian, stream.anchors
    assert block.basis is not None
    exact = paper.to_matrices(sequence.vertices, paper.bounding_frame(sequence.extent))
    deltas = paper.expand(block.basis, block.coefficients)
    noise = np.hstack([one.T - laplacian @ a.T for one, a in zip(deltas, exact, strict=True)])
    known = np.concatenate([anchors, stream.isolated])
    system = paper.ReconstructionSystem(laplacian, known)
    errors = system.solve(noise, np.zeros((len(known), noise.shape[1])))
    share = min(1.0, CANDIDATES_PER_ANCHOR * len(anchors) / stream.n_verts)
    points = paper.choose_anchors(stream.faces, stream.n_verts, share)
    candidates = np.union1d(anchors, points)
    return exchanged(anchors, candidates, system.responses(candidates), errors)


def exchanged(anchors: Integers, candidates: Integers, columns: Floats, errors: Floats) -> Integers:
    """Exchange each anchor in turn for the candidate that leaves the smallest squared error.

    An anchor at j instead of i subtracts ``R_U W R_U^T`` from ``R = (L^T L + S^T S)^-1``, with
    ``U = (j, i)`` and ``W = (R_UU + diag(1, -1))^-1``: no exchange needs another factorization.

    Parameters
    ----------
    anchors, candidates : int64 arrays, ascending
        The candidates include the anchors.
    columns : float64 array of shape (V, C)
        Columns of R of the candidates.
    errors : float64 array of shape (V, N)
    """
    if len(candidates) == len(anchors):
        return anchors
    inverse, products, of_candidates = columns[candidates], columns.T @ columns, errors[candidates]
    energies, mixed = of_candidates @ of_candidates.T, columns.T @ errors @ of_candidates.T
    squared_error, is_anchor = float(np.vdot(errors, errors)), np.isin(candidates, anchors)
    for _ in range(MAX_PASSES):
        before = np.flatnonzero(is_anchor)
        for anchor in before:
            others = np.flatnonzero(~is_anchor)
            pairs = np.stack([others, np.full_like(others, anchor)], axis=1)
            at = pairs[:, :, None], pairs[:, None, :]
            small = inverse[at] + np.diag([1.0, -1.0])
            # Singular if it leaves a component without an anchor.
            is_possible = np.abs(np.linalg.det(small)) > 1e-8
            w = np.linalg.inv(np.where(is_possible[:, None, None], small, np.eye(2)))
            changes = np.einsum("jpq,jqs,jrs,jpr->j", w, energies[at], w, products[at])
            changes -= 2 * np.einsum("jpq,jpq->j", w, mixed[at])
            changes[~is_possible] = np.inf
            best = int(np.argmin(changes))
            if changes[best] > -MIN_REDUCTION * squared_error / len(anchors):
                continue
            u, right = pairs[best], inverse[:, pairs[best]]
            left = right @ w[best]
            mixed -= products[:, u] @ w[best] @ energies[u]
            for matrix in (mixed, products, energies):
                matrix -= left @ matrix[u]
                matrix -= matrix[:, u] @ left.T
            inverse = inverse - left @ right.T
            squared_error += changes[best]
            is_anchor[u] = True, False
        if is_anchor[before].all():
            break
    return np.asarray(candidates[is_anchor])
