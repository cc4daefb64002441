"""Options of the paper's variants: their defaults, ranges, and what excludes what."""

from collections.abc import Sequence

from meshreel.codec.choices import choice_named
from meshreel.codec.config import EncoderConfig
from meshreel.errors import InvalidInputError
from meshreel.paper.quantization import MAX_BITS, MIN_BITS
from meshreel.paper.variants import Allocation, Basis, Decoding, Variant, variant_named

DEFAULT_ENERGY = 0.99995
DEFAULT_ANCHORS = 0.01

DEFAULT_FREQUENCIES = 0.05
"""Share of the graph frequencies that `gft` keeps."""


def energy_share(config: EncoderConfig) -> float:
    """Energy to keep where the number of modes is left open."""
    return DEFAULT_ENERGY if config.energy is None else config.energy


def bits_of(config: EncoderConfig) -> int | Sequence[int]:
    """Bits of the largest coefficient or of each row; the variant's own where none are given."""
    return variant_named(config.method).bits if config.bits is None else config.bits


def allocation_of(config: EncoderConfig) -> Allocation:
    """How a single number of bits is spread over rows."""
    return choice_named(Allocation, config.allocation)


def anchor_share(config: EncoderConfig) -> float:
    """Share of the vertices that are anchors; 0 is one for each component."""
    if variant_named(config.method).decoding is not Decoding.ANCHORED:
        return 0.0
    return DEFAULT_ANCHORS if config.anchors is None else config.anchors


def check(config: EncoderConfig) -> None:
    """Nothing if the options of the variant are in range and do not exclude each other.

    Raises
    ------
    InvalidInputError
        If they are not.
    """
    variant, allocation = variant_named(config.method), allocation_of(config)
    if config.n_modes is not None and config.energy is not None:
        raise InvalidInputError("n_modes= and energy= exclude each other; give one")
    if config.energy is not None and not 0 < config.energy <= 1:
        raise InvalidInputError(f"energy must be in 0..1, above 0; got {config.energy}")
    if config.energy is not None and variant.basis is Basis.GRAPH:
        raise InvalidInputError(
            f"method {variant.name} keeps a number of low frequencies, not a share of the energy; "
            "give n_modes="
        )
    _check_bits(bits_of(config), variant, allocation)
    if not 0 <= anchor_share(config) <= 1:
        raise InvalidInputError(
            f"anchors is a share of the vertices, 0..1 (0.01 = 1 %); got {config.anchors}"
        )
    if config.anchors and variant.decoding is not Decoding.ANCHORED:
        raise InvalidInputError(
            f"method {variant.name} decodes with {variant.decoding.value}, without anchors; leave "
            "anchors out, or choose pca-qp"
        )


def _check_bits(bits: int | Sequence[int], variant: Variant, allocation: Allocation) -> None:
    if isinstance(bits, Sequence):
        if variant.basis is Basis.GRAPH or not bits:
            raise InvalidInputError(
                f"method {variant.name} takes one number of bits"
                if bits
                else "bits is an empty list; give a number, or one for each row"
            )
        for row, number in enumerate(bits):
            if number != 0:
                _check_bit_count(number, f"bits of row {row} must be 0 or")
        return
    if variant.basis is Basis.GRAPH and allocation is Allocation.CONSTANT:
        raise InvalidInputError(f"method {variant.name} has one step; leave allocation at energy")
    _check_bit_count(bits, "bits must be")


def _check_bit_count(bits: int, what: str) -> None:
    if not MIN_BITS <= bits <= MAX_BITS or int(bits) != bits:
        raise InvalidInputError(f"{what} {MIN_BITS}..{MAX_BITS}; got {bits}")
