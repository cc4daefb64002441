"""Let every block of `blocks` choose the size of its subspace, and compare it with fixed sizes.

    python examples/adaptive_subspace.py
    python examples/adaptive_subspace.py walk.npz --errors 0.02,0.01,0.005

After A. S. Lalos, A. A. Vasilakis, A. Dimas, K. Moustakas, "Adaptive compression of animated meshes
by exploiting orthogonal iterations", The Visual Computer, 2017: orthogonal iterations start from
the subspace of the previous block and find the size that a block needs. How it changes is ours: it
grows by the direction of the largest residual while the error is above the given one, and loses its
last direction while the error is below 0.7 times that.
"""

import argparse
from collections.abc import Callable

import numpy as np

import meshreel
from meshreel import paper

Array = np.ndarray


def adaptive_subspace(error: float) -> Callable[[Array, Array | None], Array]:
    """Return a basis for `paper.experiment` with this largest error of a block.

    Parameters
    ----------
    error : float
        Norm of what the subspace omits, relative to that of the shape about its centroids.
    """

    def basis(matrices: Array, previous: Array | None) -> Array:
        R = paper.autocorrelation(matrices)
        shape = np.linalg.norm(matrices - matrices.mean(axis=2, keepdims=True))
        U = paper.eigen_trajectories(R, 1)[1] if previous is None else previous
        has_grown = False
        while True:
            U = paper.ritz_vectors(R, paper.advance_basis(R, U, n_iterations=2))
            residual = R - U @ (U.swapaxes(1, 2) @ R)
            omitted = np.sqrt(max(np.trace(residual, axis1=1, axis2=2).sum(), 0.0)) / shape
            if omitted > error and U.shape[2] < U.shape[1]:
                frame = np.linalg.norm(residual, axis=1).sum(axis=0).argmax()
                U = np.linalg.qr(np.concatenate([U, residual[:, :, [frame]]], axis=2)).Q
                has_grown = True
            elif omitted < 0.7 * error and U.shape[2] > 1 and not has_grown:
                U = U[:, :, :-1]
            else:
                return U

    return basis


def main() -> None:
    """Print rates and errors of fixed and of adaptive sizes."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("input", nargs="?", help="a sequence; default: a simulated flag")
    parser.add_argument("--modes", default="1,2,4,8", help="fixed sizes")
    parser.add_argument("--errors", default="0.1,0.05,0.02,0.01", help="largest errors of blocks")
    parser.add_argument("--frames", type=int, default=25, help="frames of a block")
    options = parser.parse_args()
    sequence = meshreel.load(options.input) if options.input else meshreel.simulate_flag(75)
    common = {"block_frames": options.frames, "bits": 8}
    print("subspace                modes    q_s  stored   bpvf   KG %    STED")
    for text in options.modes.split(","):
        result = paper.experiment(sequence, "blocks", n_modes=int(text), **common)
        print(row(f"{text} modes", result))
    for text in options.errors.split(","):
        basis = adaptive_subspace(float(text))
        print(
            row(f"error up to {text}", paper.experiment(sequence, "blocks", basis=basis, **common))
        )


def row(name: str, result: paper.Experiment) -> str:
    """A line of the table."""
    sizes = sorted({block.n_modes for block in result.stream.blocks})
    modes = str(sizes[0]) if len(sizes) == 1 else f"{sizes[0]} to {sizes[-1]}"
    rates, quality = result.rates, result.quality
    return (
        f"{name:20} {modes:>8} {rates.eq13.q_s:6.3f} {rates.stored.q_s:7.3f} "
        f"{result.rate_bpvf:6.3f} {quality.kg_error_percent:6.3f} {quality.sted:7.4f}"
    )


if __name__ == "__main__":
    main()
