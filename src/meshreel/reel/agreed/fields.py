"""The method `reel`: mode fields, predicted over the mesh by weights that follow earlier ones.

A mode is one field on the mesh with a basis vector over time for each axis. The fields of a block
are predicted vertex after vertex over a hierarchy of the mesh, in closed loop; the core does it.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.kernel.frames import time_vectors
from meshreel.kernel.predict import Prepared, decode_values, prepared_weights
from meshreel.reel.agreed.mesh import FieldMesh
from meshreel.runtime.profiling import staged

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Layout:
    """Parameters of a block that the decoder has to know.

    Attributes
    ----------
    step : float32
        Of the fields.
    stencil_size : int
        Vertices that predict one.
    n_learned : int
        Modes, the first ones, that predictor weights follow.
    reference : int
        How many blocks before this one its key block is, whose fields its weights follow first;
        0: it has none, and can be a key block itself.
    is_single : bool
        Frames are summed up over the modes in IEEE single precision, and not in double.
    """

    step: np.float32
    stencil_size: int
    n_learned: int
    reference: int = 0
    is_single: bool = False


@dataclass(frozen=True)
class FieldBlock:
    """A block of frames as integers.

    Attributes
    ----------
    layout : Layout
    basis : int32 array of shape (K, C, T)
        C columns, of positions x, y and z. Residuals of the temporal basis, as they are coded:
        the coarsest times are differences.
    fields : int32 array of shape (K, V)
        Residuals of the fields, in coding order.
    """

    layout: Layout
    basis: npt.NDArray[np.int32]
    fields: npt.NDArray[np.int32]

    @property
    def n_modes(self) -> int:
        """K."""
        return int(self.fields.shape[0])


@dataclass
class KeyFields:
    """Fields of a key block.

    Attributes
    ----------
    values : float64 array of shape (V, K)
        In coding order and in steps of the block, which are comparable between blocks of any
        length.
    """

    values: Floats
    _prepared: tuple[int, Prepared | None] | None = None

    def prepared(self, mesh: FieldMesh, n_learned: int) -> Prepared | None:
        """What the weights of blocks that refer to it begin with; kept, so that it is found once.

        None for a large mesh.
        """
        if self._prepared is None or self._prepared[0] != n_learned:
            found = prepared_weights(mesh.hierarchy, n_learned, self.values)
            self._prepared = n_learned, found
        return self._prepared[1]


@staged("fields")
def decode_fields(block: FieldBlock, mesh: FieldMesh, key: KeyFields | None = None) -> Floats:
    """Decoded fields of shape (V, K), in coding order and in steps.

    The key is of the block that this one refers to.
    """
    n_learned = block.layout.n_learned
    if key is None:
        return decode_values(mesh.hierarchy, block.fields, n_learned)
    prepared = key.prepared(mesh, n_learned)
    return decode_values(mesh.hierarchy, block.fields, n_learned, key.values, prepared)


@staged("temporal basis")
def decode_basis(coded: npt.NDArray[np.integer]) -> Floats:
    """Temporal basis of shape (C, T, K), each vector of length 1 (or 0), for integers (K, C, T)."""
    return time_vectors(coded)
