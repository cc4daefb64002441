"""Effective options of the paper's variants, and checks of their compatibility."""

from collections.abc import Sequence

from meshreel.codec.paper_options import (
    BITS_RANGE,
    DEFAULT_ANCHORS,
    DEFAULT_ENERGY,
    FINE_BITS,
    Allocation,
    PaperOptions,
)
from meshreel.errors import InvalidInputError, Keyword
from meshreel.paper.choices import PaperChoices, choices_of
from meshreel.paper.variants import Basis, Decoding, Signal, variant_named

EXTRA_ANCHOR_BITS = 4
"""Bits of an anchor position beyond those of a coefficient of the deltas (docs/codec.md)."""


def energy_share(config: PaperOptions) -> float:
    """Fraction of the energy that determines the default number of modes."""
    return DEFAULT_ENERGY if config.energy is None else config.energy


def bits_of(config: PaperOptions) -> int | Sequence[int]:
    """Bits of the largest coefficient or of each row; the variant's default if not given."""
    return variant_named(config.method).bits if config.bits is None else config.bits


def allocation_of(config: PaperOptions) -> Allocation:
    """How a single number of bits is allocated to rows."""
    return Allocation(config.allocation)


def choices(config: PaperOptions) -> PaperChoices:
    """The choices that the paper leaves open."""
    return choices_of(config.choices)


def anchors_of(config: PaperOptions) -> float | Sequence[int]:
    """The anchors as vertices, or as a fraction of the vertices; 0 is one per component."""
    if variant_named(config.method).decoding is not Decoding.ANCHORED:
        return 0.0
    return DEFAULT_ANCHORS if config.anchors is None else config.anchors


def anchor_bits(config: PaperOptions) -> int:
    """Bits of the largest position of an anchor, or of its largest coefficient."""
    paper_choices, variant = choices(config), variant_named(config.method)
    if paper_choices.anchor_bits is not None:
        return paper_choices.anchor_bits
    if variant.decoding is not Decoding.ANCHORED or paper_choices.anchor_values == "coefficients":
        return FINE_BITS
    bits = bits_of(config)
    largest = max(bits) if isinstance(bits, Sequence) else bits
    return min(largest + EXTRA_ANCHOR_BITS, int(BITS_RANGE.high))


def check(config: PaperOptions) -> None:
    """Check that the options of the variant are compatible.

    Raises
    ------
    InvalidInputError
        If options exclude each other, one has no effect, or a list has values out of range.
    """
    variant = variant_named(config.method)
    if config.n_modes is not None and config.energy is not None:
        raise InvalidInputError(
            Keyword("n_modes"), " and ", Keyword("energy"), " exclude each other; give one"
        )
    if config.energy is not None and variant.basis is Basis.GRAPH:
        raise InvalidInputError(
            f"method {variant.name} keeps a number of low frequencies, not a share of the energy; "
            "give ",
            Keyword("n_modes"),
        )
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
        raise InvalidInputError(f"method {variant.name} has one step; keep allocation=energy")
    paper_choices = choices(config)
    reasons = ineffective_choices(config, paper_choices)
    for name in paper_choices.changed:
        if name in reasons:
            raise InvalidInputError(f"choice {name} has no effect: {reasons[name]}; omit it")
    has_anchors = isinstance(config.anchors, Sequence) or bool(config.anchors)
    if has_anchors and variant.decoding is not Decoding.ANCHORED:
        raise InvalidInputError(
            f"method {variant.name} decodes with {variant.decoding.value}, without anchors; omit "
            "anchors, or choose pca-qp"
        )


def ineffective_choices(config: PaperOptions, paper_choices: PaperChoices) -> dict[str, str]:
    """Choices that have no effect on streams of these options, and why."""
    variant, reasons = variant_named(config.method), dict[str, str]()
    if variant.decoding is not Decoding.ANCHORED:
        for name in ("anchor_values", "anchor_set", "anchor_seed"):
            reasons[name] = f"method {variant.name} has no anchors"
    if not variant.has_anchors:
        reasons["anchor_bits"] = f"method {variant.name} has no anchors"
    if variant.basis is Basis.GRAPH:
        reasons["anchor_values"] = "method gft codes positions of its anchors"
        reasons["dictionary_bits"] = "method gft codes no dictionary"
        reasons["centering"] = "method gft computes no autocorrelation"
    elif variant.signal is not Signal.DELTAS:
        reasons["centering"] = f"method {variant.name} codes positions relative to the center"
    if variant.basis is not Basis.TRACKED:
        for name in ("dictionary", "rotation"):
            reasons[name] = f"method {variant.name} does not track its dictionary; choose blocks"
    if variant.signal is not Signal.DELTAS or variant.basis is Basis.GRAPH:
        reasons["quantize"] = f"method {variant.name} does not project deltas on eigen-trajectories"
    elif isinstance(config.bits, Sequence) or allocation_of(config) is Allocation.CONSTANT:
        reasons["quantize"] = "deltas of all frames have one step; give one number of bits"
    if isinstance(config.anchors, Sequence):
        reasons["anchor_set"] = "anchors lists the vertices"
    if paper_choices.anchor_set != "random" or isinstance(config.anchors, Sequence):
        reasons["anchor_seed"] = "it is the seed of anchor_set=random"
    return reasons
