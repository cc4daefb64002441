"""The method `reel`: mode fields, predicted over the mesh by weights that follow earlier ones.

A mode is one field on the mesh with a basis vector over time for each axis. The fields of a block
are predicted vertex after vertex over a hierarchy of the mesh, in closed loop; the core does it.
"""

from concurrent.futures import Future
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.codec.reel.normative.mesh import FieldMesh
from meshreel.kernel.basis import NO_REST, BasisCoding, Rests, basis_vectors, lengths_of
from meshreel.kernel.predict import Prepared, decode_values, prepared_weights
from meshreel.runtime.profiling import staged

NONE_REUSED = np.float32(0.0)


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
    n_reused : int
        Modes, the first ones, whose fields are those of the key block.
    finer : float32
        Steps of the vectors of these modes in one of a position; 0 where there are none.
    rests : Rests
        Times that are predicted from the one before; none with cosines.
    has_cosines : bool
        The temporal basis is coded as coefficients of cosines over time, and not by times.
    is_adaptive : bool
        Times of the temporal basis are predicted with weights that follow what is decoded; not
        with cosines.
    """

    step: np.float32
    stencil_size: int
    n_learned: int
    reference: int = 0
    is_single: bool = False
    n_reused: int = 0
    finer: np.float32 = NONE_REUSED
    rests: Rests = NO_REST
    has_cosines: bool = False
    is_adaptive: bool = False


@dataclass(frozen=True)
class FieldBlock:
    """A block of frames as integers.

    Attributes
    ----------
    layout : Layout
    basis : int32 array of shape (K, C, T)
        C columns, of positions x, y and z. Residuals of the temporal basis, as they are coded:
        the coarsest times are differences. With cosines, their coefficients.
    fields : int32 array of shape (K - n_reused, V)
        Residuals of the fields, in coding order; not of those that are reused.
    """

    layout: Layout
    basis: npt.NDArray[np.int32]
    fields: npt.NDArray[np.int32]

    @property
    def n_modes(self) -> int:
        """K."""
        return int(self.basis.shape[0])


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
    _prepared: dict[int, Prepared | None] = field(default_factory=dict)

    def is_prepared(self, n_learned: int) -> bool:
        """Whether `prepared` is found already."""
        return n_learned in self._prepared

    def prepared(self, mesh: FieldMesh, n_learned: int) -> Prepared | None:
        """What the weights of blocks that refer to it begin with; kept, so that it is found once.

        None for a large mesh.
        """
        if not self.is_prepared(n_learned):
            found = None
            if not mesh.is_large:
                found = prepared_weights(mesh.hierarchy, n_learned, self.values)
            self._prepared = {n_learned: found}  # those of the last number alone: they are large
        return self._prepared[n_learned]


@staged("fields")
def decoded_values(
    residuals: npt.NDArray[np.int32],
    layout: Layout,
    mesh: FieldMesh,
    key: KeyFields | None = None,
    weights: "Future[Prepared | None] | None" = None,
) -> Floats:
    """Decoded fields of shape (V, K), in coding order and in steps.

    Parameters
    ----------
    residuals : int32 array of shape (K - n_reused, V)
        As in `FieldBlock`.
    layout : Layout
    mesh : FieldMesh
    key : KeyFields, optional
        Of the block that this one refers to.
    weights : Future of Prepared, optional
        What the weights begin with; else they are found on the way.
    """
    return with_reused(_own(residuals, layout, mesh, key, weights), layout.n_reused, key)


def with_reused(own: Floats, n_reused: int, key: KeyFields | None) -> Floats:
    """Fields of shape (V, K) behind the first ones of the key block."""
    if key is None or not n_reused:
        return own
    return np.concatenate([key.values[:, :n_reused], own], axis=1)


def _own(
    residuals: npt.NDArray[np.int32],
    layout: Layout,
    mesh: FieldMesh,
    key: KeyFields | None,
    weights: "Future[Prepared | None] | None",
) -> Floats:
    if not len(residuals):
        return np.empty((mesh.n_verts, 0))
    if weights is not None:
        prepared = weights.result()
    else:
        prepared = None if key is None else key.prepared(mesh, layout.n_learned)
    values = None if key is None else key.values
    return decode_values(mesh.hierarchy, residuals, layout.n_learned, values, prepared)


def decode_basis(
    coded: npt.NDArray[np.integer], layout: Layout, key: KeyFields | None = None
) -> Floats:
    """Decode the temporal basis of a block, of shape (C, T, K), from integers (K, C, T).

    Vectors have length 1 (or 0). Those of reused modes do not: their lengths are such that rounding
    any of their integers does the same harm.
    """
    lengths = None
    if key is not None and layout.n_reused:
        lengths = lengths_of(key.values, layout.n_reused, float(layout.finer))
    return basis_vectors(
        coded, BasisCoding(layout.rests, layout.has_cosines, layout.is_adaptive), lengths
    )
