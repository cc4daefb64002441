"""What the user sets, checked."""

from dataclasses import dataclass

from meshreel.codec.methods import Laplacian, Method, Order, choice_named, method_named
from meshreel.errors import InvalidInputError
from meshreel.quantization.uniform import MAX_BITS, MIN_BITS

DEFAULT_METHOD = "pca-qp"
DEFAULT_ENERGY = 0.99995
DEFAULT_BITS = 9
DEFAULT_ANCHORS = 0.01
DEFAULT_LAPLACIAN = "normalized"
DEFAULT_ORDER = "keep"


@dataclass(frozen=True)
class EncoderConfig:
    """The options of `meshreel.encode`; see there.

    Raises
    ------
    InvalidInputError
        If an option is out of range, or two exclude each other.
    """

    method: str = DEFAULT_METHOD
    n_modes: int | None = None
    energy: float | None = None
    bits: int = DEFAULT_BITS
    anchors: float = DEFAULT_ANCHORS
    laplacian: str = DEFAULT_LAPLACIAN
    order: str = DEFAULT_ORDER
    block_frames: int | None = None

    def __post_init__(self) -> None:
        if self.n_modes is not None and self.energy is not None:
            raise InvalidInputError("n_modes and energy exclude each other; give one")
        if self.n_modes is not None:
            _check_count("n_modes", self.n_modes)
        if self.energy is not None and not 0 < self.energy <= 1:
            raise InvalidInputError(f"energy must be in 0..1, above 0; got {self.energy}")
        if not MIN_BITS <= self.bits <= MAX_BITS or int(self.bits) != self.bits:
            raise InvalidInputError(f"bits must be {MIN_BITS}..{MAX_BITS}; got {self.bits}")
        if not 0 <= self.anchors <= 1:
            raise InvalidInputError(
                f"anchors is a share of the vertices, 0..1 (0.01 = 1 %); got {self.anchors}"
            )
        if self.block_frames is not None:
            _check_count("block_frames", self.block_frames)
        # Names that do not exist are refused now, before any work.
        _ = self.method_row, self.laplacian_choice, self.order_choice

    @property
    def method_row(self) -> Method:
        """The row of the table of methods."""
        return method_named(self.method)

    @property
    def laplacian_choice(self) -> Laplacian:
        """The Laplacian by its code."""
        return choice_named(Laplacian, self.laplacian)

    @property
    def order_choice(self) -> Order:
        """The order by its code."""
        return choice_named(Order, self.order)

    @property
    def energy_share(self) -> float:
        """Energy to keep where the number of modes is left open."""
        return DEFAULT_ENERGY if self.energy is None else self.energy


def _check_count(name: str, value: int) -> None:
    if value < 1 or int(value) != value:
        raise InvalidInputError(f"{name} must be a whole number of at least 1; got {value}")
