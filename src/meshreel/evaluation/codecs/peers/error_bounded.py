"""Error-bounded compressors of float arrays: zfp and SZ3."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.evaluation.codecs.peers.arrays import sz3_array, sz3_bytes, zfp_array, zfp_bytes
from meshreel.evaluation.codecs.peers.protocol import Shape, interleaved, planar
from meshreel.metrics.reference import bounding_box_reference
from meshreel.model.sequence import MeshSequence, Vertices


@dataclass(frozen=True)
class Zfp:
    """zfp with fixed accuracy, on an array of frames by coordinates.

    References
    ----------
    P. Lindstrom, "Fixed-rate compressed floating-point arrays", TVCG 20(12), 2014.
    """

    name: str = "zfp"
    summary: str = "zfp, fixed accuracy, on a (T, 3 V) array; its bound is seldom reached"
    package: str = "zfpy"
    extra: str = "peers"
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """Error bounds per coordinate, as fractions of the diagonal."""
        return (1e-2, 1e-3) if quick else (3e-2, 1e-2, 3e-3, 1e-3, 3e-4)

    def params(self, setting: float) -> str:
        """The bound as text."""
        return f"bound {setting:g}"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One zfp stream."""
        return zfp_bytes(planar(sequence.vertices), _tolerance(sequence, setting))

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        return interleaved(zfp_array(data), shape)


@dataclass(frozen=True)
class Sz3:
    """SZ3 with an absolute error bound and Lorenzo and regression predictors.

    References
    ----------
    X. Liang et al., "SZ3: a modular framework for composing prediction-based error-bounded lossy
    compressors", IEEE Transactions on Big Data 9(2), 2023.
    """

    name: str = "sz3"
    summary: str = "SZ3, absolute error bound, Lorenzo and regression, on a (T, 3 V) array"
    package: str = "pysz"
    extra: str = "peers"
    has_faces: bool = False

    def sweep(self, *, quick: bool) -> tuple[float, ...]:
        """Error bounds per coordinate, as fractions of the diagonal."""
        return (2e-3, 5e-4) if quick else (4e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)

    def params(self, setting: float) -> str:
        """The bound as text."""
        return f"bound {setting:g}"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One SZ3 stream."""
        tolerance = _tolerance(sequence, setting)
        return sz3_bytes(planar(sequence.vertices), tolerance, "LORENZO_REG")

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the original order."""
        n_frames, n_verts, _ = shape
        return interleaved(sz3_array(data, (n_frames, 3 * n_verts), dtype), shape)


def _tolerance(sequence: MeshSequence, share: float) -> float:
    """A fraction of the sequence's diagonal, in model units."""
    diagonal = bounding_box_reference(sequence.vertices).diagonal
    if not 0 < diagonal < np.inf:
        raise InvalidInputError(
            "a relative error bound needs an extent; the sequence has no extent"
        )
    return float(share * diagonal)
