"""Which variants are run, with what settings; the one table of them."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

MODES, BITS, ANCHORS = 20, 8, 0.01
FEW_ANCHORS = 0.005
HIGH_BITS = 16  # of `pca`, whose coefficients the paper does not quantise coarsely
BLOCK_FRAMES = 25  # at most; the blocks of a sequence are of equal length up to one frame
BLOCK_MODES, VERTEX_BITS = 4, 11
"""Modes of each block, and bits of `v2v`. The paper does not print its own; with these q stands to
that of `pca-q` about as in its Table I, where it is 1.4 to 1.7 and 2.0 to 2.4 times as large."""

ROW_COUNTS = (2, 5, 10, 20, 30)
"""The k_l of the paper's Fig. 3."""

LOW_FREQUENCIES = (0.01, 0.02)  # shares of the vertices: points of gft beside its default


@dataclass(frozen=True)
class Setting:
    """One way to encode.

    Attributes
    ----------
    method : str
    n_modes : int or None
        Modes of each axis (graph frequencies for `gft`); None leaves it to the method.
    bits : int
    anchors : float
        Share of the vertices; 0 where the method is decoded without them.
    block_frames : int or None
        None codes all frames together.
    """

    method: str
    n_modes: int | None = MODES
    bits: int = BITS
    anchors: float = 0.0
    block_frames: int | None = None

    @property
    def key(self) -> str:
        """The stem of its files."""
        modes = "default" if self.n_modes is None else self.n_modes
        frames = "all" if self.block_frames is None else self.block_frames
        return (
            f"{self.method}_modes-{modes}_bits-{self.bits}_anchors-{self.anchors:g}_frames-{frames}"
        )

    @property
    def label(self) -> str:
        """Its name in tables and figures: the method, and its anchors where they are few."""
        return f"{self.method} 0.5 %" if self.anchors == FEW_ANCHORS else self.method

    def options(self) -> dict[str, Any]:
        """Keyword arguments of `meshreel.encode`."""
        return {name: value for name, value in asdict(self).items() if value is not None}


_VARIANTS = (
    Setting("pca", bits=HIGH_BITS),
    Setting("pca-q"),
    Setting("v2v", bits=VERTEX_BITS),
    Setting("pca-qs", anchors=ANCHORS),
    Setting("pca-qp", anchors=FEW_ANCHORS),
    Setting("pca-qp", anchors=ANCHORS),
    Setting("blocks", BLOCK_MODES, anchors=ANCHORS, block_frames=BLOCK_FRAMES),
    Setting("gft", None, anchors=ANCHORS),
)
METHOD_NAMES = tuple(dict.fromkeys(variant.method for variant in _VARIANTS))

# Modes and bits of the rate-distortion sweep. pca-qs is left out: it has the quality of pca-qp.
_SWEEP = {
    "pca": ((5, 10, 20, 40, 80), (HIGH_BITS,)),
    "pca-q": ((10, 20, 40), (6, 8, 10)),
    "v2v": ((5, 10, 20, 40, 80), (8, 10, 12, 14)),
    "pca-qp": ((5, 10, 20, 40, 80), (6, 8, 10)),
    "blocks": ((1, 2, 4, 8, 12), (6, 8, 10)),
}
_QUICK_SWEEP = {
    "pca": ((10, 20), (HIGH_BITS,)),
    "pca-q": ((10, 20), (8,)),
    "v2v": ((10, 20), (10, 12)),
    "pca-qp": ((10, 20), (6, 8)),
    "blocks": ((2, 4), (6, 8)),
}


def equal_blocks(n_frames: int) -> int:
    """Frames of each block, the paper's k_f = k / n_b, for n_b = ceil(k / 25) blocks."""
    n_blocks = -(-n_frames // BLOCK_FRAMES)
    return -(-n_frames // n_blocks)


def variants(n_frames: int, methods: Sequence[str] = METHOD_NAMES) -> list[Setting]:
    """The settings of the tables, for a sequence of so many frames."""
    return [_fitted(setting, n_frames) for setting in _VARIANTS if setting.method in methods]


def row_settings(n_frames: int, methods: Sequence[str] = METHOD_NAMES) -> list[Setting]:
    """The settings of Fig. 3; none where `pca-qp` is not among the methods."""
    if "pca-qp" not in methods:
        return []
    wanted = [Setting("pca-qp", modes, anchors=ANCHORS) for modes in ROW_COUNTS]
    return _distinct(_fitted(setting, n_frames) for setting in wanted)


def sweep(
    n_frames: int, n_verts: int, methods: Sequence[str] = METHOD_NAMES, *, quick: bool = False
) -> list[Setting]:
    """The settings of the rate-distortion plots."""
    table = _QUICK_SWEEP if quick else _SWEEP
    usual = {setting.method: setting for setting in _VARIANTS}
    points = [
        Setting(method, modes, bits, usual[method].anchors, usual[method].block_frames)
        for method, (mode_counts, bit_counts) in table.items()
        if method in methods
        for modes in mode_counts
        for bits in bit_counts
    ]
    if "gft" in methods and not quick:
        counts = [max(1, round(share * n_verts)) for share in LOW_FREQUENCIES]
        points += [Setting("gft", count, anchors=ANCHORS) for count in counts]
    return _distinct(_fitted(setting, n_frames) for setting in points)


def _fitted(setting: Setting, n_frames: int) -> Setting:
    """The setting for a sequence of so many frames: no more modes than frames in a block."""
    frames = setting.block_frames and equal_blocks(n_frames)
    modes = setting.n_modes
    if modes is not None and setting.method != "gft":
        modes = min(modes, frames or n_frames)
    return Setting(setting.method, modes, setting.bits, setting.anchors, frames)


def _distinct(settings: Iterable[Setting]) -> list[Setting]:
    return list(dict.fromkeys(settings))
