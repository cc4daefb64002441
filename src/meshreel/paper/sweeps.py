"""Settings of the streams in the paper's evaluation: variants, alternatives and rate sweeps."""

import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any

from meshreel.codec.options import config_of
from meshreel.codec.paper_options import (
    TRACKED_BLOCK_FRAMES,
    Allocation,
    PaperOptions,
    equal_blocks,
)
from meshreel.errors import InvalidInputError
from meshreel.paper.choices import choices_of
from meshreel.paper.settings import ineffective_choices

METHOD_NAMES = ("pca", "pca-q", "v2v", "pca-qs", "pca-qp", "blocks", "gft")
WITHOUT_ANCHORS = METHOD_NAMES[:3]

MODES, BITS, ANCHORS = 20, 8, 0.01
FEW_ANCHORS = 0.005
HIGH_BITS = 16  # for `pca`, whose coefficients the paper does not quantize coarsely
BLOCK_MODES, VERTEX_BITS = 4, 11

ROW_COUNTS = (2, 5, 10, 20, 30)
"""The k_l of the paper's Fig. 3."""

COEFFICIENTS = "anchor-values=coefficients"
QUANTIZED_DELTAS = "quantize=deltas"
WHOLE_DICTIONARIES = "dictionary=whole"
FINE_ANCHORS = "anchor-bits=16"
NO_ROTATION = "rotation=none"
UNCENTERED = "centering=none"
RANDOM_ANCHORS = tuple(f"anchor-set=random,anchor-seed={seed}" for seed in (1, 2, 3))
RANDOM_COEFFICIENTS = tuple(f"{COEFFICIENTS},{choices}" for choices in RANDOM_ANCHORS)

CHOICE_NAMES = {
    COEFFICIENTS: "coefficients of anchors",
    QUANTIZED_DELTAS: "quantized deltas",
    WHOLE_DICTIONARIES: "whole dictionaries",
    FINE_ANCHORS: "anchors of 16 bits",
    NO_ROTATION: "without rotation",
    UNCENTERED: "without centering",
    **{text: f"random anchors {number}" for number, text in enumerate(RANDOM_ANCHORS, 1)},
    **{
        text: f"coefficients of random anchors {number}"
        for number, text in enumerate(RANDOM_COEFFICIENTS, 1)
    },
}
"""Names of the choices that the report compares."""


_DEFAULTS = {"choices": "", "laplacian": "normalized", "allocation": Allocation.ENERGY.value}
_USUAL = tuple(_DEFAULTS.values())


@dataclass(frozen=True)
class Setting:
    """A variant with its options."""

    method: str
    n_modes: int | None = MODES
    """Modes of each axis (graph frequencies for `gft`); None is the default of the method."""
    bits: int = BITS
    anchors: float = 0.0
    """Fraction of the vertices; 0 for methods without anchors."""
    block_frames: int | None = None
    """None codes all frames together."""
    choices: str = ""
    """As for `meshreel.encode`; empty for the defaults."""
    laplacian: str = "normalized"
    shared: str = ""
    """Choices common to all streams of a report; `choices` takes precedence."""
    allocation: str = Allocation.ENERGY.value
    """How bits are distributed over the rows, as for `meshreel.encode`."""

    @property
    def key(self) -> str:
        """The stem of its files."""
        modes = "default" if self.n_modes is None else self.n_modes
        frames = "all" if self.block_frames is None else self.block_frames
        others = [self._all_choices]
        others += [value for value in (self.laplacian, self.allocation) if value not in _USUAL]
        suffix = "".join(f"_{re.sub('[=,]', '-', text)}" for text in others if text)
        return (
            f"{self.method}_modes-{modes}_bits-{self.bits}_anchors-{self.anchors:g}"
            f"_frames-{frames}{suffix}"
        )

    @property
    def label(self) -> str:
        """Name in tables and figures: the method, and its differences from the defaults."""
        remarks = [CHOICE_NAMES.get(self.choices, self.choices)] if self.choices else []
        if self.anchors == FEW_ANCHORS:
            remarks.append("0.5 %")
        if self.laplacian != _DEFAULTS["laplacian"]:
            remarks.append(self.laplacian)
        return f"{self.method} ({', '.join(remarks)})" if remarks else self.method

    def options(self) -> dict[str, Any]:
        """Keyword arguments of `meshreel.encode`."""
        options = {name: value for name, value in asdict(self).items() if value is not None}
        del options["shared"]
        if self.method in WITHOUT_ANCHORS:
            del options["anchors"]
        options["choices"] = self._all_choices
        return {name: value for name, value in options.items() if value != _DEFAULTS.get(name)}

    def method_options(self) -> dict[str, Any]:
        """The options without the method."""
        return {name: value for name, value in self.options().items() if name != "method"}

    @property
    def _all_choices(self) -> str:
        parts = [choices_of(text or None).changed for text in (self.shared, self.choices)]
        return ",".join(f"{name}={value}" for name, value in (parts[0] | parts[1]).items())


@dataclass(frozen=True)
class TableSettings:
    """Modes, bits and anchors of the streams in Tables I and II."""

    modes: int = MODES
    """Rows of coefficients of each axis, the paper's k_l."""
    bits: int = BITS
    """Bits of quantized coefficients; `pca` has 16."""
    vertex_bits: int = VERTEX_BITS
    """Bits of `v2v`, which codes vertices instead of deltas."""
    block_modes: int = BLOCK_MODES
    """Rows in each block of `blocks`."""
    anchors: float = ANCHORS
    """Fraction of the vertices."""
    choices: str = ""
    """Applied to every variant on which it has an effect."""
    allocation: str = Allocation.ENERGY.value
    """"energy": one step for all rows; "constant": the given bits in every row. `gft`, which has
    one step, ignores it.
    """

    def setting(self, method: str) -> Setting:
        """The setting of a variant for a long sequence."""
        has_anchors = method not in WITHOUT_ANCHORS
        setting = Setting(
            method=method,
            n_modes={"blocks": self.block_modes, "gft": None}.get(method, self.modes),
            bits={"pca": HIGH_BITS, "v2v": self.vertex_bits}.get(method, self.bits),
            anchors=self.anchors if has_anchors else 0.0,
            block_frames=TRACKED_BLOCK_FRAMES if method == "blocks" else None,
            allocation=Allocation.ENERGY.value if method == "gft" else self.allocation,
        )
        options = choices_of(self.choices or None)
        unused = ineffective_choices(PaperOptions(method), options)
        shared = (
            f"{name}={value}" for name, value in options.changed.items() if name not in unused
        )
        return replace(setting, shared=",".join(shared))


AS_PRINTED = TableSettings(
    modes=8,
    bits=4,
    vertex_bits=10,
    block_modes=2,
    choices=FINE_ANCHORS,
    allocation=Allocation.CONSTANT.value,
)
"""They give the printed q of Samba within 13 %: if rows use all of their bits, 8 of 175 rows of 16,
4 and 10 bits take .7314, .1829 and .4571, 2 rows of 4 bits in each block of 25 frames .32."""

DEFAULTS = TableSettings()
PRESETS = {"usual": DEFAULTS, "printed": AS_PRINTED}

_ALTERNATIVES = (
    ("pca-q", QUANTIZED_DELTAS),
    ("pca-qp", COEFFICIENTS),
    ("pca-qp", FINE_ANCHORS),
    ("pca-qp", UNCENTERED),
    *(("pca-qp", choices) for choices in (*RANDOM_ANCHORS, *RANDOM_COEFFICIENTS)),
    ("blocks", COEFFICIENTS),
    ("blocks", WHOLE_DICTIONARIES),
    ("blocks", NO_ROTATION),
)

_MODES_AND_BITS: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "pca": ((5, 10, 20, 40, 80), (HIGH_BITS,)),
    "pca-q": ((10, 20, 40), (6, 8, 10)),
    "v2v": ((5, 10, 20, 40, 80), (8, 10, 12, 14)),
    "pca-qp": ((5, 10, 20, 40, 80), (6, 8, 10)),
    "blocks": ((1, 2, 4, 8, 12), (6, 8, 10)),
}
"""Modes and bits that `meshreel evaluate` measures; few of them if quick."""


def variants(
    n_frames: int, methods: Sequence[str] = METHOD_NAMES, table: TableSettings = DEFAULTS
) -> list[Setting]:
    """The settings of the tables for a sequence of this length."""
    settings = []
    for method in METHOD_NAMES:
        setting = table.setting(method)
        if method == "pca-qp" and table.anchors == ANCHORS:
            settings.append(replace(setting, anchors=FEW_ANCHORS))
        settings.append(setting)
    return [limit_modes(setting, n_frames) for setting in settings if setting.method in methods]


def alternatives(
    n_frames: int, methods: Sequence[str] = METHOD_NAMES, table: TableSettings = DEFAULTS
) -> list[Setting]:
    """Variants that each change one of the choices that the paper leaves open."""
    settings = []
    for method, choices in _ALTERNATIVES:
        if method in methods:
            setting = replace(table.setting(method), choices=choices)
            if choices == QUANTIZED_DELTAS:  # deltas of all frames have one step
                setting = replace(setting, allocation=_DEFAULTS["allocation"])
            settings.append(limit_modes(setting, n_frames))
    if "pca-qp" in methods:
        settings += [
            limit_modes(replace(table.setting("pca-qp"), laplacian=laplacian), n_frames)
            for laplacian in ("combinatorial", "cotangent")
        ]
    existing = {setting.key for setting in variants(n_frames, methods, table)}
    return [setting for setting in settings if setting.key not in existing]


def row_settings(n_frames: int, methods: Sequence[str] = METHOD_NAMES) -> list[Setting]:
    """The settings of Fig. 3; empty unless `pca-qp` is among the methods."""
    if "pca-qp" not in methods:
        return []
    settings = [Setting("pca-qp", modes, anchors=ANCHORS) for modes in ROW_COUNTS]
    return list(dict.fromkeys(limit_modes(setting, n_frames) for setting in settings))


def option_sweeps(*, quick: bool) -> dict[str, Callable[[int, int], list[dict[str, Any]]]]:
    """Options of `meshreel.encode` to measure, by method, given numbers of frames and vertices."""

    def options(method: str, n_frames: int, n_verts: int) -> list[dict[str, Any]]:
        default = DEFAULTS.setting(method)
        if method not in _MODES_AND_BITS:
            return [limit_modes(default, n_frames).method_options()]
        modes, bits = _MODES_AND_BITS[method]
        if quick:
            modes, bits = modes[1:3], bits[:2]
        settings = [
            limit_modes(replace(default, n_modes=count, bits=number, choices=choices), n_frames)
            for choices in (("", COEFFICIENTS) if default.anchors else ("",))
            for count in modes
            for number in bits
        ]
        return [setting.method_options() for setting in dict.fromkeys(settings)]

    return {method: partial(options, method) for method in METHOD_NAMES}


def check_table(table: TableSettings, methods: Sequence[str]) -> None:
    """Check that settings are in range and have an effect on at least one method.

    Raises
    ------
    InvalidInputError
        If one is not; the message names it.
    """
    settings = [table.setting(method) for method in methods]
    for setting in settings:
        config_of(**setting.options())
    effective = {
        name for setting in settings for name in choices_of(setting.shared or None).changed
    }
    if unused := sorted(set(choices_of(table.choices or None).changed) - effective):
        raise InvalidInputError(
            f"choice {unused[0]} has no effect on {', '.join(methods)}; omit it, or add a method"
        )


def limit_modes(setting: Setting, n_frames: int) -> Setting:
    """Limit the modes of a setting to the number of frames in a block."""
    frames = setting.block_frames and equal_blocks(n_frames)
    modes = setting.n_modes
    if modes is not None and setting.method != "gft":
        modes = min(modes, frames or n_frames)
    return replace(setting, n_modes=modes, block_frames=frames)
