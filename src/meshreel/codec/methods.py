"""The choices a stream can be made with, and their codes in it.

Each variant of the paper is a row of choices: what is transformed, on which basis, and how it is
decoded; so is our own `reel`. The pipeline reads the choices, never the names.
"""

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import TypeVar

from meshreel.errors import InvalidInputError, UnsupportedVersionError

DEFAULT_BITS = 9
FINE_BITS = 16
TRACKED_BLOCK_FRAMES = 25


class Signal(Enum):
    """What is projected and quantised."""

    DELTAS = "delta coordinates"
    VERTICES = "vertex coordinates"
    FIELDS = "fields of modes"


class Basis(Enum):
    """What it is projected on."""

    TRAJECTORIES = "eigen-trajectories of each block"
    TRACKED = "eigen-trajectories, tracked from block to block by orthogonal iterations"
    GRAPH = "eigenvectors of the Laplacian, frame by frame"
    JOINT = "modes of all three coordinates together"


class Decoding(Enum):
    """How vertices come back."""

    ANCHORED = "least squares with anchors (Eq. 12)"
    LAPLACIAN = "L alone (Eq. 11)"
    PRODUCT = "the product of basis and coefficients"
    PREDICTED = "prediction over a hierarchy of the mesh, with learned weights"


@dataclass(frozen=True)
class Method:
    """A method: a row of the table of variants.

    Attributes
    ----------
    name : str
        What the user calls it.
    code : int
        What the stream calls it.
    signal : Signal
    basis : Basis
    decoding : Decoding
    is_serial : bool
        Whether the decoder builds and solves a system for each frame, as the paper's serial
        variants do, instead of one for all.
    bits : int
        Bits of the largest coefficient where the user gives none.
    block_frames : int or None
        Frames coded together where the user gives none; None is all.
    """

    name: str
    code: int
    signal: Signal
    basis: Basis
    decoding: Decoding
    is_serial: bool = False
    bits: int = DEFAULT_BITS
    block_frames: int | None = None

    @property
    def has_anchors(self) -> bool:
        """Whether anchors are chosen and sent once, for all blocks: each component needs one."""
        return self.decoding not in (Decoding.PRODUCT, Decoding.PREDICTED)

    @property
    def summary(self) -> str:
        """The choices in one line."""
        how = ", a system for each frame" if self.is_serial else ""
        return f"{self.signal.value} on {self.basis.value}; {self.decoding.value}{how}"


_D, _T, _A = Signal.DELTAS, Basis.TRAJECTORIES, Decoding.ANCHORED

METHODS = (
    Method("pca-qp", 0, _D, _T, _A),
    Method("pca", 1, _D, _T, Decoding.LAPLACIAN, bits=FINE_BITS),
    Method("pca-q", 2, _D, _T, Decoding.LAPLACIAN),
    Method("v2v", 3, Signal.VERTICES, _T, Decoding.PRODUCT),
    Method("pca-qs", 4, _D, _T, _A, is_serial=True),
    Method("blocks", 5, _D, Basis.TRACKED, _A, block_frames=TRACKED_BLOCK_FRAMES),
    Method("gft", 6, _D, Basis.GRAPH, _A, is_serial=True),
    Method("reel", 7, Signal.FIELDS, Basis.JOINT, Decoding.PREDICTED),
)


class Laplacian(IntEnum):
    """Which matrix the delta coordinates are made with."""

    NORMALIZED = 0
    COMBINATORIAL = 1


class Order(IntEnum):
    """What is kept of the order in which vertices and faces came."""

    KEEP = 0
    VERTICES = 1
    DROP = 2


class Allocation(Enum):
    """How a single number of bits is spread over the rows of coefficients."""

    ENERGY = "energy"
    CONSTANT = "constant"


def method_named(name: str) -> Method:
    """The method of this name.

    Raises
    ------
    InvalidInputError
        If there is none; says which there are.
    """
    for method in METHODS:
        if method.name == name:
            return method
    raise InvalidInputError(
        f"method {name!r} is unknown; choose {', '.join(method.name for method in METHODS)}"
    )


def method_of_code(code: int) -> Method:
    """The method of a stream.

    Raises
    ------
    UnsupportedVersionError
        If this build does not know it.
    """
    for method in METHODS:
        if method.code == code:
            return method
    raise UnsupportedVersionError(f"method {code} is unknown to this build; upgrade meshreel")


Choice = TypeVar("Choice", bound=Enum)
CodedChoice = TypeVar("CodedChoice", bound=IntEnum)


def choice_named(choices: type[Choice], name: str) -> Choice:
    """The member of an enumeration by its lower-case name.

    Raises
    ------
    InvalidInputError
        If there is none; says which there are.
    """
    for choice in choices:
        if choice.name.lower() == name:
            return choice
    allowed = ", ".join(choice.name.lower() for choice in choices)
    raise InvalidInputError(f"{choices.__name__.lower()} {name!r} is unknown; choose {allowed}")


def choice_of_code(choices: type[CodedChoice], code: int) -> CodedChoice:
    """The member of an enumeration by its code in a stream.

    Raises
    ------
    UnsupportedVersionError
        If this build does not know it.
    """
    if code in list(choices):
        return choices(code)
    raise UnsupportedVersionError(
        f"{choices.__name__.lower()} {code} is unknown to this build; upgrade meshreel"
    )
