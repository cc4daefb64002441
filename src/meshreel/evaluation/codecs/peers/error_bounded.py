"""Error-bounded compressors of float arrays: zfp and SZ3."""

from dataclasses import dataclass
from importlib import import_module

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.evaluation.codecs.peers.protocol import Shape, interleaved, planar
from meshreel.metrics.reference import bounding_box_reference
from meshreel.sequence import MeshSequence, Vertices


@dataclass(frozen=True)
class Zfp:
    """zfp at a fixed accuracy, on frames by coordinates.

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
        """Bounds of a coordinate's error, as shares of the diagonal."""
        return (1e-2, 1e-3) if quick else (3e-2, 1e-2, 3e-3, 1e-3, 3e-4)

    def params(self, setting: float) -> str:
        """The bound."""
        return f"bound {setting:g}"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One zfp stream."""
        zfpy = import_module("zfpy")

        tolerance = _tolerance(sequence, setting)
        return bytes(zfpy.compress_numpy(planar(sequence.vertices), tolerance=tolerance))

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the order given."""
        zfpy = import_module("zfpy")

        return interleaved(zfpy.decompress_numpy(data), shape)


@dataclass(frozen=True)
class Sz3:
    """SZ3 with an absolute bound, Lorenzo and regression predictors.

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
        """Bounds of a coordinate's error, as shares of the diagonal."""
        return (2e-3, 5e-4) if quick else (4e-3, 2e-3, 1e-3, 5e-4, 2e-4, 1e-4)

    def params(self, setting: float) -> str:
        """The bound."""
        return f"bound {setting:g}"

    def encode(self, sequence: MeshSequence, setting: float) -> bytes:
        """One SZ3 stream."""
        pysz = import_module("pysz")
        config = pysz.szConfig()
        config.errorBoundMode = pysz.szErrorBoundMode.ABS
        config.absErrorBound = _tolerance(sequence, setting)
        config.cmprAlgo = pysz.szAlgorithm.LORENZO_REG
        compressed, _ = pysz.sz.compress(planar(sequence.vertices), config)
        return bytes(compressed)

    def decode(self, data: bytes, shape: Shape, dtype: npt.DTypeLike) -> Vertices:
        """Positions in the order given."""
        pysz = import_module("pysz")

        n_frames, n_verts, _ = shape
        compressed = np.frombuffer(data, np.uint8)
        rows, _ = pysz.sz.decompress(compressed, np.dtype(dtype), (n_frames, 3 * n_verts))
        return interleaved(rows, shape)


def _tolerance(sequence: MeshSequence, share: float) -> float:
    """A share of the sequence's diagonal, in model units."""
    diagonal = bounding_box_reference(sequence.vertices).diagonal
    if not 0 < diagonal < np.inf:
        raise InvalidInputError("the sequence has no extent that a bound could be a share of")
    return float(share * diagonal)
