"""The seven variants of the paper, defined by signal, basis and decoding.

The pipeline depends on these properties, never on the names.
"""

from dataclasses import dataclass
from enum import Enum

from meshreel.codec.paper_options import DEFAULT_BITS, FINE_BITS


class Signal(Enum):
    """The signal that is projected and quantized."""

    DELTAS = "delta coordinates"
    VERTICES = "vertex coordinates"


class Basis(Enum):
    """The basis onto which the signal is projected."""

    TRAJECTORIES = "eigen-trajectories of each block"
    TRACKED = "eigen-trajectories, tracked from block to block by orthogonal iterations"
    GRAPH = "eigenvectors of the Laplacian, frame by frame"


class Decoding(Enum):
    """How vertices are reconstructed."""

    ANCHORED = "least squares with anchors (Eq. 12)"
    LAPLACIAN = "L alone (Eq. 11)"
    PRODUCT = "the product of basis and coefficients"


@dataclass(frozen=True)
class Variant:
    """A variant of the paper."""

    name: str
    """Name for users."""
    signal: Signal
    basis: Basis
    decoding: Decoding
    is_serial: bool = False
    """Whether the decoder factors and solves a system for each frame, like the paper's serial
    variants, instead of one for all.
    """
    bits: int = DEFAULT_BITS
    """Default bits of the largest coefficient."""

    @property
    def has_anchors(self) -> bool:
        """Whether anchors are stored; every component needs one to solve for its vertices."""
        return self.decoding is not Decoding.PRODUCT


_D, _T, _A = Signal.DELTAS, Basis.TRAJECTORIES, Decoding.ANCHORED


VARIANTS = (
    Variant("pca-qp", _D, _T, _A),
    Variant("pca", _D, _T, Decoding.LAPLACIAN, bits=FINE_BITS),
    Variant("pca-q", _D, _T, Decoding.LAPLACIAN),
    Variant("v2v", Signal.VERTICES, _T, Decoding.PRODUCT),
    Variant("pca-qs", _D, _T, _A, is_serial=True),
    Variant("blocks", _D, Basis.TRACKED, _A),
    Variant("gft", _D, Basis.GRAPH, _A, is_serial=True),
)

METHODS = tuple(variant.name for variant in VARIANTS)
"""Names of the seven variants for `meshreel.encode(method=)`."""


def variant_named(name: str) -> Variant:
    """The variant of this name, which must exist."""
    return next(variant for variant in VARIANTS if variant.name == name)
