"""Laplacian matrices of a mesh, and delta coordinates."""

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array, diags_array

from meshreel.errors import InvalidInputError
from meshreel.geometry.connectivity import adjacency_matrix
from meshreel.sequence import Faces

Floats = npt.NDArray[np.float64]


def uniform_laplacian(faces: Faces, n_verts: int, *, normalized: bool = False) -> csr_array:
    """Uniform Laplacian, ``L = D - C`` with binary adjacency C (paper Eq. 1).

    Parameters
    ----------
    faces : integer array of shape (M, 3)
    n_verts : int
        Number of vertices, V.
    normalized : bool, default False
        Divide each row by the vertex's degree: ``L = I - D^-1 C``, whose deltas are those of
        paper Eq. 3. The paper calls both L; they differ wherever degrees do.

    Returns
    -------
    csr_array of shape (V, V), float64; rows sum to zero, and are empty for isolated vertices.
    """
    adjacency = adjacency_matrix(faces, n_verts)
    degrees = adjacency.sum(axis=1)
    laplacian = csr_array(diags_array(degrees) - adjacency)
    if not normalized:
        return laplacian
    inverse = np.divide(1.0, degrees, out=np.zeros_like(degrees), where=degrees > 0)
    return csr_array(diags_array(inverse) @ laplacian)


def delta_coordinates(laplacian: csr_array, columns: npt.NDArray[np.floating]) -> Floats:
    """Differential coordinates of every column, ``delta = L V`` (paper Eq. 4, paper Eq. 8).

    The Laplacian acts on vertices and the projection on frames, so the two commute: the deltas
    of projected trajectories are the projected deltas, for K columns instead of T.

    Parameters
    ----------
    laplacian : csr_array of shape (V, V)
    columns : float array of shape (V, K)
        A function on the vertices in each column, such as one coordinate of one frame.

    Returns
    -------
    float64 array of shape (V, K), in the units of the columns; unchanged by translation.

    Raises
    ------
    InvalidInputError
        If V differs between the two arguments.
    """
    if columns.shape[0] != laplacian.shape[1]:
        raise InvalidInputError(
            f"the Laplacian is of {laplacian.shape[1]} vertices; got {columns.shape[0]} rows"
        )
    return np.asarray(laplacian @ np.asarray(columns, np.float64))
