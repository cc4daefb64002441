"""Options of the paper's variants alone: their defaults and ranges."""

from collections.abc import Mapping, Sequence

from meshreel.codec.choices import Laplacian
from meshreel.codec.option import Option, Range
from meshreel.codec.rounding_options import ROUNDING
from meshreel.paper.variants import (
    DEFAULT_BITS,
    FINE_BITS,
    VARIANTS,
    Allocation,
    Basis,
    Signal,
    Variant,
)

GROUP = "The paper's methods"

DEFAULT_ENERGY = 0.99995
DEFAULT_ANCHORS = 0.01

DEFAULT_FREQUENCIES = 0.05
"""Share of the graph frequencies that `gft` keeps."""

ENERGY = Option(
    "energy",
    float,
    "Share of the shape's energy to keep, up to 1; chooses the number of modes.",
    default_text=str(DEFAULT_ENERGY),
    range=Range(0, 1, is_open=True),
    unit="a share of the energy",
    group=GROUP,
    more="What is left out makes a KG error of sqrt(1 - energy), by default 0.7 %.",
)
BITS_RANGE = Range(2, 24, is_whole=True)
BITS = Option(
    "bits",
    int | Sequence[int],
    f"Bits of the largest coefficient, {BITS_RANGE.words}; or of each row, 0 to leave it out.",
    default_text=f"{DEFAULT_BITS}; pca: {FINE_BITS}",
    range=BITS_RANGE,
    group=GROUP,
    metavar="N[,N...]",
)
ALLOCATION = Option(
    "allocation",
    str,
    "How one number of bits is spread over the rows.",
    default=Allocation.ENERGY.value,
    names=tuple(allocation.value for allocation in Allocation),
    group=GROUP,
    more="energy: all share the step of the largest, so that bits follow a row's energy; constant: "
    "each takes that many bits of its own range.",
)
ANCHORS = Option(
    "anchors",
    float | Sequence[int],
    "Share of the vertices sent as anchors, 0 to 1, where the method has them; or their numbers.",
    default_text=str(DEFAULT_ANCHORS),
    range=Range(0, 1),
    unit="a share of the vertices (0.01 = 1 %)",
    group=GROUP,
    metavar="SHARE or N,N...",
    more="Every connected component gets at least one: with 0 this is decoding by L alone "
    "(Eq. 11).",
)
CHOICES = Option(
    "choices",
    str | Mapping[str, object],
    "What the paper leaves open: values of anchor-values, anchor-set, anchor-seed, anchor-bits, "
    "dictionary-bits, quantize, dictionary and rotation, separated by commas.",
    group=GROUP,
    metavar="NAME=VALUE[,...]",
    more='Such as `"anchor-values=coefficients,anchor-bits=16"`, or a mapping; '
    "`meshreel.paper.PaperChoices` describes each.",
)
LAPLACIAN = Option(
    "laplacian",
    str,
    "The matrix that makes deltas.",
    default=Laplacian.NORMALIZED.name.lower(),
    names=tuple(laplacian.name.lower() for laplacian in Laplacian),
    group=GROUP,
    more="normalized: I - D^-1 C (Eq. 3), which measured better; combinatorial: D - C (Eq. 1); "
    "cotangent: I - D^-1 W with the cotangent weights of the first frame, which is sent too.",
)
N_ITERATIONS = Option(
    "n_iterations",
    int,
    "Orthogonal iterations from block to block (blocks).",
    default=4,
    range=Range(1, is_whole=True),
    group=GROUP,
    flag="--iterations",
)


def _options_of(variant: Variant) -> tuple[Option, ...]:
    of_deltas = (LAPLACIAN,) if variant.signal is Signal.DELTAS else ()
    of_tracking = (N_ITERATIONS,) if variant.basis is Basis.TRACKED else ()
    return (*ROUNDING, ENERGY, BITS, ALLOCATION, ANCHORS, CHOICES, *of_deltas, *of_tracking)


OPTIONS = {variant.name: _options_of(variant) for variant in VARIANTS}
"""By the name of the method."""
