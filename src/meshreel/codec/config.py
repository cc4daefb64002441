"""Options of encoding, checked."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from meshreel.codec.byte_sizes import bytes_of
from meshreel.codec.choices import Laplacian, Order
from meshreel.codec.error_bounds import bound_of
from meshreel.codec.methods import Method, method_named
from meshreel.codec.option import Option
from meshreel.codec.options import (
    LOSSLESS_METHOD,
    all_options,
    check_names,
    methods_taking,
    options_of,
)
from meshreel.codec.targets import Aim, Target, target_of
from meshreel.counting import counted
from meshreel.errors import InvalidInputError

MAX_BLOCK_POSITIONS = 1 << 28
"""Positions that are coded together at most, where no number of frames is asked for."""


@dataclass(frozen=True)
class EncoderConfig:
    """The options of `meshreel.encode`, checked: the rows of `codec.options.all_options`.

    `python docs/option_texts.py --write` writes the fields.

    Raises
    ------
    InvalidInputError
        If an option is out of range, or two exclude each other.
    """

    method: str = "reel"
    quality: float | None = None
    max_error: float | str | None = None
    unit: str | None = None
    kg: float | None = None
    sted: float | None = None
    bpvf: float | None = None
    size: float | str | None = None
    step: float | None = None
    lossless: bool = False
    tune: str | None = None
    effort: int | None = None
    n_modes: int | None = None
    uv_bits: int | None = None
    order: str = "keep"
    block_frames: int | None = None
    memory: float | str | None = None
    energy: float | None = None
    bits: int | Sequence[int] | None = None
    allocation: str = "energy"
    anchors: float | Sequence[int] | None = None
    choices: str | Mapping[str, object] | None = None
    laplacian: str = "normalized"
    n_iterations: int = 4

    def __post_init__(self) -> None:
        for option in all_options():
            option.check(getattr(self, option.name))
        self._read_texts()
        chosen = [row for row in all_options() if getattr(self, row.name) != row.default]
        for option in chosen:
            if self.method not in (methods := methods_taking(option)):
                raise InvalidInputError(
                    f"method {self.method} does not take {option.name}=; leave it out, or choose "
                    f"{' or '.join(methods)}"
                )
        if self.lossless:
            self._become_lossless(chosen)
        object.__setattr__(self, "lossless", self.method == LOSSLESS_METHOD)
        self.method_row.check(self)

    def _become_lossless(self, chosen: Sequence[Option]) -> None:
        """Make it the method that `lossless` asks for, unless another option is to change bits."""
        taken = options_of(LOSSLESS_METHOD)
        if idle := [f"{option.name}=" for option in chosen if option not in taken]:
            have, them = ("has", "it") if len(idle) == 1 else ("have", "them")
            raise InvalidInputError(
                f"lossless= keeps every bit, so that {' and '.join(idle)} {have} no effect; leave "
                f"{them} out, or lossless="
            )
        object.__setattr__(self, "method", LOSSLESS_METHOD)

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

    @cached_property
    def target(self) -> Target:
        """The target of `reel`: a rate, an error or a step."""
        return target_of(**{name: getattr(self, name) for name in _TARGETS})

    @property
    def method_row(self) -> Method:
        """The method of this name."""
        return method_named(self.method)

    @property
    def laplacian_choice(self) -> Laplacian:
        """The Laplacian by its code."""
        return Laplacian[self.laplacian.upper()]

    @property
    def order_choice(self) -> Order:
        """The order by its code."""
        return Order[self.order.upper()]

    @property
    def memory_bytes(self) -> float | None:
        """Bytes that encoding may take; None where nothing is said."""
        return None if self.memory is None else float(self.memory)

    def frames_in_block(self, n_frames: int, n_verts: int, number_bytes: int) -> int:
        """Frames coded together, of a sequence of so many frames and vertices.

        `reel` cuts as little as memory allows: every cut sends all fields again.

        Parameters
        ----------
        n_frames, n_verts : int
        number_bytes : int
            Size of a coordinate.

        Raises
        ------
        InvalidInputError
            If memory does not allow one.
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
                f"at least {needed(1) / 1e6:.0f} MB is needed"
            )
        return bisect_right(range(1, chosen), memory, key=needed)

    def with_blocks_of(self, block_frames: int, n_verts: int, number_bytes: int) -> "EncoderConfig":
        """The options with blocks of so many frames at most, and as much memory as these need."""
        needed = self.method_row.block_bytes(block_frames, n_verts, number_bytes, is_whole=False)
        return replace(self, block_frames=block_frames, memory=needed)


_TARGETS = tuple(aim.value for aim in Aim)


def config_of(options: Mapping[str, Any]) -> EncoderConfig:
    """The options of these names, checked.

    Raises
    ------
    InvalidInputError
        If there is no such option, naming the nearest, or as `EncoderConfig`.
    """
    check_names(options, (option.name for option in all_options()))
    return EncoderConfig(**options)
