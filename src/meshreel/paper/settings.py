"""Options of the paper's variants as the pipeline takes them, and what excludes what."""

from collections.abc import Sequence

from meshreel.codec.config import EncoderConfig
from meshreel.errors import InvalidInputError
from meshreel.paper.options import BITS_RANGE, DEFAULT_ANCHORS, DEFAULT_ENERGY
from meshreel.paper.variants import Allocation, Basis, Decoding, Variant, variant_named


def energy_share(config: EncoderConfig) -> float:
    """Energy to keep where the number of modes is left open."""
    return DEFAULT_ENERGY if config.energy is None else config.energy


def bits_of(config: EncoderConfig) -> int | Sequence[int]:
    """Bits of the largest coefficient or of each row; the variant's own where none are given."""
    return variant_named(config.method).bits if config.bits is None else config.bits


def allocation_of(config: EncoderConfig) -> Allocation:
    """How a single number of bits is spread over rows."""
    return Allocation(config.allocation)


def anchor_share(config: EncoderConfig) -> float:
    """Share of the vertices that are anchors; 0 is one for each component."""
    if variant_named(config.method).decoding is not Decoding.ANCHORED:
        return 0.0
    return DEFAULT_ANCHORS if config.anchors is None else config.anchors


def check(config: EncoderConfig) -> None:
    """Nothing if the options of the variant fit each other; each by itself is in range.

    Raises
    ------
    InvalidInputError
        If they do not, or a list of bits has some that are out of range.
    """
    variant = variant_named(config.method)
    if config.n_modes is not None and config.energy is not None:
        raise InvalidInputError("n_modes= and energy= exclude each other; give one")
    if config.energy is not None and variant.basis is Basis.GRAPH:
        raise InvalidInputError(
            f"method {variant.name} keeps a number of low frequencies, not a share of the energy; "
            "give n_modes="
        )
    _check_bits(config, variant)
    if config.anchors and variant.decoding is not Decoding.ANCHORED:
        raise InvalidInputError(
            f"method {variant.name} decodes with {variant.decoding.value}, without anchors; leave "
            "anchors out, or choose pca-qp"
        )


def _check_bits(config: EncoderConfig, variant: Variant) -> None:
    if isinstance(config.bits, Sequence):
        if variant.basis is Basis.GRAPH or not config.bits:
            raise InvalidInputError(
                f"method {variant.name} takes one number of bits"
                if config.bits
                else "bits is an empty list; give a number, or one for each row"
            )
        for row, number in enumerate(config.bits):
            if number != 0:
                BITS_RANGE.check(number, f"bits of row {row}", "or 0")
    elif variant.basis is Basis.GRAPH and allocation_of(config) is Allocation.CONSTANT:
        raise InvalidInputError(f"method {variant.name} has one step; leave allocation at energy")
