"""The number of modes to keep."""

import numpy as np
import numpy.typing as npt


def modes_for_energy(
    eigenvalues: npt.NDArray[np.float64], total: float, shape_energy: float, share: float
) -> int:
    """Smallest number of leading modes that keep a fraction of the shape's energy.

    The energy of R includes the translation of the whole model, which can be hundreds of times that
    of its shape and must not determine the accuracy of the shape. Relative to the energy about each
    frame's centroid, omitting 1 - share gives a KG error of sqrt(1 - share).

    Parameters
    ----------
    eigenvalues : float64 array of shape (..., K)
        Eigenvalues of R, descending along the last axis; leading axes (x, y, z) are summed.
    total : float
        Energy of all modes: the sum of the traces of R.
    shape_energy : float
        Squared distances of all vertices from their frame's centroid, in the same units.
    share : float
        Fraction of the shape's energy to keep, in 0..1.

    Returns
    -------
    int in 1..K
    """
    cumulative = np.cumsum(eigenvalues.reshape(-1, eigenvalues.shape[-1]).sum(axis=0))
    is_enough = total - cumulative <= (1 - share) * shape_energy
    return int(np.argmax(is_enough)) + 1 if is_enough.any() else int(eigenvalues.shape[-1])
