"""What the user sets, checked."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

from meshreel.codec.byte_sizes import bytes_of
from meshreel.codec.error_bounds import bound_of
from meshreel.codec.methods import (
    Allocation,
    Basis,
    Decoding,
    Laplacian,
    Method,
    Order,
    Signal,
    choice_named,
    method_named,
)
from meshreel.codec.surface.uv_grid import check_uv_bits
from meshreel.codec.targets import Aim, Target, target_of
from meshreel.counting import counted
from meshreel.errors import InvalidInputError
from meshreel.paper.quantization.uniform import MAX_BITS, MIN_BITS
from meshreel.reel.encoding.analysis import FieldChoices
from meshreel.reel.encoding.effort import DEFAULT_EFFORT, Tune, choices_for, tune_named

DEFAULT_METHOD = "reel"
DEFAULT_ENERGY = 0.99995
DEFAULT_ANCHORS = 0.01
DEFAULT_LAPLACIAN = "normalized"
DEFAULT_ORDER = "keep"
DEFAULT_ALLOCATION = "energy"
DEFAULT_ITERATIONS = 4
MAX_BLOCK_POSITIONS = 1 << 26
"""Positions that `reel` codes together at most, where nothing is said of memory."""

PROCESS_BYTES = 100e6
BYTES_OF_VERTEX = 4000.0
BYTES_OF_POSITION = 130.0
"""Memory of the program itself, of what is known of a vertex, and of a position of a block."""

DEFAULT_FREQUENCIES = 0.05
"""Share of the graph frequencies that `gft` keeps."""


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
    bits: int | Sequence[int] | None = None
    allocation: str = DEFAULT_ALLOCATION
    anchors: float | None = None
    laplacian: str = DEFAULT_LAPLACIAN
    order: str = DEFAULT_ORDER
    block_frames: int | None = None
    memory: float | str | None = None
    n_iterations: int = DEFAULT_ITERATIONS
    quality: float | None = None
    max_error: float | str | None = None
    kg: float | None = None
    sted: float | None = None
    bpvf: float | None = None
    size: float | str | None = None
    step: float | None = None
    tune: str | None = None
    effort: int | None = None
    unit: str | None = None
    uv_bits: int | None = None

    def __post_init__(self) -> None:
        self._read_texts()
        # Names that do not exist are refused now, before any work.
        row, _, _, allocation = (
            self.method_row,
            self.laplacian_choice,
            self.order_choice,
            self.allocation_choice,
        )
        if self.n_modes is not None and self.energy is not None:
            raise InvalidInputError("n_modes= and energy= exclude each other; give one")
        if self.n_modes is not None:
            _check_count("n_modes", self.n_modes)
        if self.energy is not None and not 0 < self.energy <= 1:
            raise InvalidInputError(f"energy must be in 0..1, above 0; got {self.energy}")
        if self.energy is not None and row.basis is Basis.GRAPH:
            raise InvalidInputError(
                f"method {row.name} keeps a number of low frequencies, not a share of the energy; "
                "give n_modes="
            )
        self._check_target()
        _check_bits(self.bits_or_default, row, allocation)
        if not 0 <= self.anchor_share <= 1:
            raise InvalidInputError(
                f"anchors is a share of the vertices, 0..1 (0.01 = 1 %); got {self.anchors}"
            )
        if self.anchors and row.decoding is not Decoding.ANCHORED:
            raise InvalidInputError(
                f"method {row.name} decodes with {row.decoding.value}, without anchors; leave "
                "anchors out, or choose pca-qp"
            )
        if self.block_frames is not None:
            _check_count("block_frames", self.block_frames)
        _check_count("n_iterations", self.n_iterations)
        if self.uv_bits is not None:
            check_uv_bits(self.uv_bits)

    def _read_texts(self) -> None:
        """Put numbers in place of sizes such as "100kB", and of lengths what they are in units."""
        for name in ("memory", "size"):
            if (given := getattr(self, name)) is not None:
                object.__setattr__(self, name, bytes_of(given, name))
        if self.max_error is not None:
            object.__setattr__(self, "max_error", bound_of(self.max_error, self.unit).plain)
            object.__setattr__(self, "unit", None)
        elif self.unit is not None:
            raise InvalidInputError("unit= says what a length in max_error= means; give both")

    def _check_target(self) -> None:
        """`reel` takes a target, the paper's methods take bits."""
        row = self.method_row
        for name, remedy in _foreign_options(row):
            if getattr(self, name) != _DEFAULTS[name]:
                raise InvalidInputError(
                    f"method {row.name} does not take {name}=; leave it out, or choose {remedy}"
                )
        if row.basis is Basis.JOINT:
            choices_for(self.effort_or_default, self.tune_choice, self.n_modes)

    @property
    def target(self) -> Target:
        """What `reel` is to meet."""
        return target_of(**{name: getattr(self, name) for name in _TARGETS})

    @property
    def tune_choice(self) -> Tune:
        """What `reel` spends its bits on."""
        return tune_named(self.tune, self.target)

    @property
    def effort_or_default(self) -> int:
        """Effort of `reel`, 1..9."""
        return DEFAULT_EFFORT if self.effort is None else self.effort

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
    def allocation_choice(self) -> Allocation:
        """How a single number of bits is spread over rows."""
        return choice_named(Allocation, self.allocation)

    @property
    def energy_share(self) -> float:
        """Energy to keep where the number of modes is left open."""
        return DEFAULT_ENERGY if self.energy is None else self.energy

    @property
    def bits_or_default(self) -> int | Sequence[int]:
        """Bits, the method's own where none are given."""
        return self.method_row.bits if self.bits is None else self.bits

    @property
    def memory_bytes(self) -> float | None:
        """Bytes that encoding may take; None where nothing is said."""
        return None if self.memory is None else float(self.memory)

    @property
    def field_choices(self) -> FieldChoices:
        """What the encoder of `reel` chooses, but for the step."""
        return choices_for(self.effort_or_default, self.tune_choice, self.n_modes)

    @property
    def anchor_share(self) -> float:
        """Share of the vertices that are anchors; 0 is one for each component."""
        if self.method_row.decoding is not Decoding.ANCHORED:
            return 0.0
        return DEFAULT_ANCHORS if self.anchors is None else self.anchors

    def frames_in_block(self, n_frames: int, n_verts: int) -> int:
        """Frames coded together, of a sequence of so many frames and vertices.

        `reel` cuts as little as memory allows: every cut sends all fields again.

        Raises
        ------
        InvalidInputError
            If memory does not allow one.
        """
        chosen = self.block_frames or self.method_row.block_frames or n_frames
        if self.memory is not None:
            chosen = min(chosen, self._frames_in_memory(n_verts, float(self.memory)))
        elif self.block_frames is None and self.method_row.basis is Basis.JOINT:
            n_blocks = -(-n_frames * n_verts // MAX_BLOCK_POSITIONS)
            chosen = -(-n_frames // n_blocks)
        return min(chosen, n_frames)

    def _frames_in_memory(self, n_verts: int, memory: float) -> int:
        needed = PROCESS_BYTES + n_verts * (BYTES_OF_VERTEX + BYTES_OF_POSITION)
        if memory < needed:
            raise InvalidInputError(
                f"memory of {memory / 1e6:.0f} MB is too little for {counted(n_verts, 'vertex')}; "
                f"at least {needed / 1e6:.0f} MB is needed"
            )
        return 1 + int((memory - needed) / (BYTES_OF_POSITION * n_verts))


_TARGETS = tuple(aim.value for aim in Aim)
_DEFAULTS = {option.name: option.default for option in fields(EncoderConfig)}


def _foreign_options(method: Method) -> Iterator[tuple[str, str]]:
    """The options that choose nothing with a method, each with a method that takes it."""
    if method.basis is not Basis.TRACKED:
        yield "n_iterations", "blocks"
    if method.basis is Basis.JOINT:
        for name in ("energy", "bits", "anchors", "allocation", "laplacian"):
            yield name, "a method of the paper such as pca-qp"
        return
    for name in (*_TARGETS, "tune", "effort"):
        yield name, "reel"
    if method.signal is not Signal.DELTAS:
        yield "laplacian", "a method that codes deltas, such as pca-qp"


def _check_bits(bits: int | Sequence[int], method: Method, allocation: Allocation) -> None:
    if isinstance(bits, Sequence):
        if method.basis is Basis.GRAPH or not bits:
            raise InvalidInputError(
                f"method {method.name} takes one number of bits"
                if bits
                else "bits is an empty list; give a number, or one for each row"
            )
        for row, number in enumerate(bits):
            if number != 0:
                _check_bit_count(number, f"bits of row {row} must be 0 or")
        return
    if method.basis is Basis.GRAPH and allocation is Allocation.CONSTANT:
        raise InvalidInputError(f"method {method.name} has one step; leave allocation at energy")
    _check_bit_count(bits, "bits must be")


def _check_bit_count(bits: int, what: str) -> None:
    if not MIN_BITS <= bits <= MAX_BITS or int(bits) != bits:
        raise InvalidInputError(f"{what} {MIN_BITS}..{MAX_BITS}; got {bits}")


def _check_count(name: str, value: int) -> None:
    if not 1 <= value < float("inf") or int(value) != value:
        raise InvalidInputError(f"{name} must be a whole number of at least 1; got {value}")
