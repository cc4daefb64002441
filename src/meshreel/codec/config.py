"""Encoding options: the fields of `EncoderConfig`, and their validation.

`encode`, the command line, batches and the documentation derive options, types, defaults and texts
from these fields. To add an option, add a field here and read it in the methods that support it.
"""

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from difflib import get_close_matches
from enum import Enum
from functools import cache, cached_property
from typing import TYPE_CHECKING, Annotated, Any

from meshreel.codec.bitstream.layout import Laplacian, Order
from meshreel.codec.error_bounds import METERS, bound_of
from meshreel.codec.memory import bytes_of
from meshreel.codec.methods import METHOD_NAMES, Method, method_named, own_name
from meshreel.codec.option import COUNT, Option, Range, options_of_fields
from meshreel.codec.targets import (
    ABOVE_ZERO,
    DEFAULT_QUALITY,
    DIAGONAL_OF_ALL,
    GROUP,
    QUALITIES,
    Target,
    TargetKind,
    target_of,
)
from meshreel.errors import InvalidInputError
from meshreel.runtime.counting import counted

if TYPE_CHECKING:
    from meshreel.model.surface import Surface

DEFAULT_METHOD = "reel"
LOSSLESS_METHOD = "lossless"

REEL = ("reel",)
BOUNDED = ("reel", "grid")
PAPER = ("pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft")
OF_DELTAS = tuple(name for name in PAPER if name != "v2v")
ROUNDING = tuple(name for name in METHOD_NAMES if name != LOSSLESS_METHOD)
"""Methods that support an option."""

PAPER_GROUP = "The paper's methods"

EFFORT_RANGE = Range(1, 9, is_whole=True)
DEFAULT_EFFORT = 5

UV_BITS_RANGE = Range(4, 24, is_whole=True)
"""A float32 of up to 1 represents every number of a grid of 24 bits."""

BITS_RANGE = Range(2, 24, is_whole=True)
DEFAULT_BITS, FINE_BITS = 9, 16
DEFAULT_ENERGY, DEFAULT_ANCHORS, DEFAULT_ITERATIONS = 0.99995, 0.01, 4
"""Defaults of the paper's methods; `pca` uses `FINE_BITS`."""

MAX_BLOCK_POSITIONS = 1 << 28
"""Most positions of a block if `block_frames` is not given."""


class Tune(Enum):
    """Error measure that the encoder optimizes."""

    VISUAL = "visual"
    GEOMETRY = "geometry"


class Allocation(Enum):
    """Distribution of bits over the rows of coefficients."""

    ENERGY = "energy"
    CONSTANT = "constant"


@dataclass(frozen=True)
class EncoderConfig:
    """The options of `meshreel.encode`, checked.

    Raises
    ------
    InvalidInputError
        If an option is out of range, or two exclude each other.
    """

    method: Annotated[
        str,
        Option(
            "Encoding method.",
            names=METHOD_NAMES,
            methods=METHOD_NAMES,
            more="`reel`: our own, several times smaller than the others, which are variants of "
            "the paper. `pca-qp`: deltas on the eigen-trajectories of each axis, least squares "
            "with anchors. `pca`, `pca-q`: without anchors, the first at 16 bits. `v2v`: vertices "
            "instead of deltas. `pca-qs`: as `pca-qp`, decoded frame by frame. `blocks`: "
            "eigen-trajectories of short blocks, tracked. `gft`: each frame's deltas on the low "
            "frequencies of the graph. `lossless`: bit-exact. `grid`: positions rounded to a grid "
            "within max_error=, then coded losslessly.",
        ),
    ] = DEFAULT_METHOD
    _: KW_ONLY
    quality: Annotated[
        float | None,
        Option(
            f"{QUALITIES.words}; every 12 points halve the error, which is relative to the model's "
            "size (the mean diagonal of the bounding boxes of single frames), and smaller on "
            "smooth surfaces.",
            default_text=f"{DEFAULT_QUALITY:g}, without another target",
            range=QUALITIES,
            group=GROUP,
            methods=REEL,
        ),
    ] = None
    max_error: Annotated[
        float | str | None,
        Option(
            "Largest distance of any vertex from the original, guaranteed. 0.1 or 0.1%: "
            f"percent {DIAGONAL_OF_ALL}; 0.5u: model units; 0.5mm: a length, see {{unit}}.",
            range=ABOVE_ZERO,
            unit="in percent",
            group=GROUP,
            metavar="BOUND",
            methods=BOUNDED,
        ),
    ] = None
    unit: Annotated[
        str | None,
        Option(
            "Length of one model unit, if {max_error} is a length.",
            names=tuple(METERS),
            group=GROUP,
            metavar="|".join(METERS),
            methods=BOUNDED,
        ),
    ] = None
    kg: Annotated[
        float | None,
        Option(
            "Smallest file of at most this KG error, relative to the shape's extent.",
            range=ABOVE_ZERO,
            unit="in percent",
            group=GROUP,
            metavar="PERCENT",
            more="In percent.",
            methods=REEL,
        ),
    ] = None
    sted: Annotated[
        float | None,
        Option("Smallest file of at most this STED.", range=ABOVE_ZERO, group=GROUP, methods=REEL),
    ] = None
    bpvf: Annotated[
        float | None,
        Option(
            "Best quality within this many bits per vertex and frame.",
            range=ABOVE_ZERO,
            unit="in bits per vertex and frame",
            group=GROUP,
            more="Counts the whole stream.",
            methods=REEL,
        ),
    ] = None
    size: Annotated[
        float | str | None,
        Option(
            "Best quality within this size, as in 100kB, 1MiB or 100000 (bytes).",
            range=ABOVE_ZERO,
            unit="in bytes",
            group=GROUP,
            metavar="SIZE",
            methods=REEL,
        ),
    ] = None
    step: Annotated[
        float | None,
        Option(
            "Quantization step of positions, in diagonals of the bounding box of all frames.",
            range=Range(0, 1, is_open=True),
            unit="in diagonals of the bounding box",
            group=GROUP,
            methods=BOUNDED,
        ),
    ] = None
    lossless: Annotated[
        bool,
        Option(
            "Decode positions and tracks bit for bit. Also keeps the order of vertices and faces, "
            "unless {order} is given.",
            group=GROUP,
            more='Equals method="lossless". `tracks` may still set bounds, or drop tracks.',
            methods=("reel", LOSSLESS_METHOD),
        ),
    ] = False
    tune: Annotated[
        str | None,
        Option(
            "Error measure to optimize. visual: how the surface looks; geometry: vertex positions.",
            default_text="the measure of the target, else visual",
            names=tuple(tune.value for tune in Tune),
            more="visual suits STED, geometry the KG error and the largest error.",
            methods=REEL,
        ),
    ] = None
    effort: Annotated[
        int | None,
        Option(
            f"{EFFORT_RANGE.words}: encoding time against size.",
            default_text=str(DEFAULT_EFFORT),
            range=EFFORT_RANGE,
            methods=REEL,
        ),
    ] = None
    n_modes: Annotated[
        int | None,
        Option(
            "Number of modes, 1 or more: a maximum for reel, else a number per axis.",
            range=COUNT,
            flag="--modes",
            more="Those of an axis are eigen-trajectories (the paper's k_l), at most as many as a "
            "block has frames; a shorter last block has fewer. Excludes `energy`. With `gft`, "
            "graph frequencies, at most one per vertex; default 5 % of the vertices. Many of a "
            "large mesh take minutes, and only `meshreel.paper.read` decodes them.",
            methods=ROUNDING,
        ),
    ] = None
    uv_bits: Annotated[
        int | None,
        Option(
            "Round texture coordinates to a grid of 2^N steps per texture width, N of "
            f"{UV_BITS_RANGE.words}; 12 is a texel of a 4096 texture. Default: exact.",
            range=UV_BITS_RANGE,
            metavar="N",
            methods=ROUNDING,
        ),
    ] = None
    order: Annotated[
        str | None,
        Option(
            "Which order to keep. keep: of vertices and faces; vertices: of the vertices; drop: "
            "neither, for the smallest file. Default: keep; drop for Draco frames, which have "
            "none.",
            names=tuple(order.name.lower() for order in Order),
            methods=METHOD_NAMES,
        ),
    ] = None
    block_frames: Annotated[
        int | None,
        Option(
            "Frames per block; fewer take less memory and more bytes. Default: all, as far as "
            "memory allows; above 1024 frames and 8 million positions, up to 512. Method blocks: "
            "up to 25.",
            range=COUNT,
            methods=METHOD_NAMES,
        ),
    ] = None
    memory: Annotated[
        float | str | None,
        Option(
            "Memory limit of encoding, as in 500MB or 1GiB; blocks are shortened to fit, and "
            "frames stay in their files. Default: blocks of up to 268 million positions.",
            range=ABOVE_ZERO,
            unit="in bytes",
            metavar="SIZE",
            more="Includes the program itself. Blocks of the default size take about 6 GB. "
            "Blocks of `lossless` and `grid` have up to 4 million positions, or 64 frames.",
            methods=METHOD_NAMES,
        ),
    ] = None
    energy: Annotated[
        float | None,
        Option(
            "Share of the shape's energy to keep, up to 1; chooses the number of modes.",
            default_text=str(DEFAULT_ENERGY),
            range=Range(0, 1, is_open=True),
            unit="a share of the energy",
            group=PAPER_GROUP,
            more="The omitted energy causes a KG error of sqrt(1 - energy), by default 0.7 %.",
            methods=PAPER,
        ),
    ] = None
    bits: Annotated[
        int | Sequence[int] | None,
        Option(
            f"Bits of the largest coefficient, {BITS_RANGE.words}; or of each row, 0 to omit it.",
            default_text=f"{DEFAULT_BITS}; pca: {FINE_BITS}",
            range=BITS_RANGE,
            group=PAPER_GROUP,
            metavar="N[,N...]",
            methods=PAPER,
        ),
    ] = None
    allocation: Annotated[
        str,
        Option(
            "How to distribute one number of bits over the rows.",
            names=tuple(allocation.value for allocation in Allocation),
            group=PAPER_GROUP,
            more="energy: all share the step of the largest, so that bits follow a row's energy; "
            "constant: each row spreads that many bits over its range.",
            methods=PAPER,
        ),
    ] = Allocation.ENERGY.value
    anchors: Annotated[
        float | Sequence[int] | None,
        Option(
            "Share of the vertices stored as anchors, 0 to 1, if the method has anchors; or their "
            "indices.",
            default_text=str(DEFAULT_ANCHORS),
            range=Range(0, 1),
            unit="a share of the vertices (0.01 = 1 %)",
            group=PAPER_GROUP,
            metavar="SHARE or N,N...",
            more="Every connected component gets at least one: 0 decodes by L alone (Eq. 11).",
            methods=PAPER,
        ),
    ] = None
    choices: Annotated[
        str | Mapping[str, object] | None,
        Option(
            "Choices that the paper leaves open, separated by commas: anchor-values, anchor-set, "
            "anchor-seed, anchor-bits, dictionary-bits, quantize, centering, dictionary, rotation.",
            group=PAPER_GROUP,
            metavar="NAME=VALUE[,...]",
            more='Such as `"anchor-values=coefficients,anchor-bits=16"`, or a mapping; '
            "`meshreel.paper.PaperChoices` describes each.",
            methods=PAPER,
        ),
    ] = None
    laplacian: Annotated[
        str,
        Option(
            "Laplacian matrix of the deltas.",
            names=tuple(laplacian.name.lower() for laplacian in Laplacian),
            group=PAPER_GROUP,
            more="normalized: I - D^-1 C (Eq. 3), with smaller measured errors; combinatorial: "
            "D - C (Eq. 1); cotangent: I - D^-1 W with the cotangent weights of the first frame, "
            "which is stored too.",
            methods=OF_DELTAS,
        ),
    ] = Laplacian.NORMALIZED.name.lower()
    n_iterations: Annotated[
        int,
        Option(
            "Orthogonal iterations from block to block (blocks).",
            range=COUNT,
            group=PAPER_GROUP,
            flag="--iterations",
            methods=("blocks",),
        ),
    ] = DEFAULT_ITERATIONS

    def __post_init__(self) -> None:
        object.__setattr__(self, "method", own_name(self.method))
        for option in all_options():
            option.check(getattr(self, option.name))
        self._parse_texts()
        chosen = self.chosen
        for option in chosen:
            if self.method not in option.methods:
                raise InvalidInputError(
                    f"method {self.method} does not take {option.name}=; omit it, or choose "
                    f"{' or '.join(option.methods)}"
                )
        if self.lossless:
            self._make_lossless(chosen)
        object.__setattr__(self, "lossless", self.method == LOSSLESS_METHOD)
        self.method_row.check(self)

    @property
    def chosen(self) -> list[Option]:
        """Options that differ from their defaults."""
        return [option for option in all_options() if getattr(self, option.name) != option.default]

    def _make_lossless(self, chosen: Sequence[Option]) -> None:
        """Set the method to lossless; raise if another option excludes it."""
        unused = [f"{one.name}=" for one in chosen if LOSSLESS_METHOD not in one.methods]
        if unused:
            verb, pronoun = ("has", "it") if len(unused) == 1 else ("have", "them")
            raise InvalidInputError(
                f"{' and '.join(unused)} {verb} no effect with lossless=; omit {pronoun}, or "
                "lossless="
            )
        object.__setattr__(self, "method", LOSSLESS_METHOD)

    def _parse_texts(self) -> None:
        """Replace sizes such as "100kB" by bytes, and lengths by model units."""
        for name in ("memory", "size"):
            if (size := getattr(self, name)) is not None:
                object.__setattr__(self, name, bytes_of(size, name))
        if self.max_error is not None:
            object.__setattr__(self, "max_error", bound_of(self.max_error, self.unit).plain)
            object.__setattr__(self, "unit", None)
        elif self.unit is not None:
            raise InvalidInputError("unit= applies to a length in max_error=; give both")

    @cached_property
    def target(self) -> Target:
        """Target of `reel`: a rate, an error or a step."""
        return target_of(**{name: getattr(self, name) for name in _TARGETS})

    @property
    def method_row(self) -> Method:
        """The method object."""
        return method_named(self.method)

    @property
    def laplacian_choice(self) -> Laplacian:
        """The Laplacian as an enumeration member."""
        return Laplacian[self.laplacian.upper()]

    def order_of(self, surface: "Surface") -> Order:
        """Return which order a stream of a mesh with this surface keeps.

        By default it is kept if it has a meaning, or polygons or parts depend on it.
        """
        if self.order is not None:
            return Order[self.order.upper()]
        needs_order = surface.is_ordered or surface.face_sizes is not None or surface.parts
        return Order.KEEP if needs_order else Order.DROP

    @property
    def memory_bytes(self) -> float | None:
        """Memory limit in bytes, or None."""
        return None if self.memory is None else float(self.memory)

    def frames_in_block(self, n_frames: int, n_verts: int, number_bytes: int) -> int:
        """Return the number of frames per block.

        Blocks of `reel` are as long as memory allows, because each stores its own fields.

        Parameters
        ----------
        number_bytes : int
            Size of a coordinate.

        Raises
        ------
        InvalidInputError
            If not even one frame fits into the memory limit.
        """
        chosen = self.block_frames or self.method_row.longest_block(n_frames, n_verts)
        chosen = min(chosen, n_frames)
        if self.memory is None:
            return chosen
        memory = float(self.memory)

        def needed(block_frames: int) -> float:
            is_whole = block_frames >= n_frames
            return self.method_row.block_bytes(
                block_frames, n_verts, number_bytes, is_whole=is_whole
            )

        if needed(chosen) <= memory:
            return chosen
        if memory < needed(1):
            raise InvalidInputError(
                f"memory of {memory / 1e6:.0f} MB is too little for {counted(n_verts, 'vertex')}; "
                f"allow at least {needed(1) / 1e6:.0f} MB"
            )
        return bisect_right(range(1, chosen), memory, key=needed)

    def with_blocks_of(self, block_frames: int, n_verts: int, number_bytes: int) -> "EncoderConfig":
        """Return these options with shorter blocks, and the memory that they need."""
        needed = self.method_row.block_bytes(block_frames, n_verts, number_bytes, is_whole=False)
        return replace(self, block_frames=block_frames, memory=needed)


_TARGETS = tuple(kind.value for kind in TargetKind)


@cache
def all_options() -> tuple[Option, ...]:
    """Return the fields of `EncoderConfig`."""
    return options_of_fields(EncoderConfig)


def option_named(name: str) -> Option:
    """Return the option of this name, which must exist."""
    return next(option for option in all_options() if option.name == name)


PRINTED_OPTIONS = {
    "k_l": "n_modes=",
    "n_c": "anchors=, as a share of the vertices (n_c / n)",
    "n_b": "block_frames=, the frames of each block (k / n_b)",
    "k_f": "block_frames=",
    "t_max": "n_iterations=, which is t_max - 1",
}
"""Options by their letters in the paper, and what to write instead."""


def check_names(names: Iterable[str], known: Iterable[str]) -> None:
    """Raise InvalidInputError, with the closest known name, unless all names are known."""
    allowed = list(known)
    for name in names:
        if name not in allowed:
            near = get_close_matches(name, allowed, 1)
            advice = f"did you mean {near[0]!r}?" if near else f"choose {', '.join(allowed)}"
            if name in PRINTED_OPTIONS:
                advice = f"the paper's {name} is {PRINTED_OPTIONS[name]}"
            raise InvalidInputError(f"option {name!r} is unknown; {advice}")


def config_of(options: Mapping[str, Any]) -> EncoderConfig:
    """Build an `EncoderConfig`; raises InvalidInputError for an unknown option too."""
    check_names(options, (option.name for option in all_options()))
    return EncoderConfig(**options)
