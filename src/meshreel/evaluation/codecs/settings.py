"""The settings of our own methods that are set against other codecs."""

from dataclasses import dataclass
from typing import Any

from meshreel.codec.methods import METHOD_NAMES
from meshreel.paper.sweeps import Setting, sweep, variants

CODED_METHODS = METHOD_NAMES
DEFAULT_METHODS = ("reel", "pca-qp", "v2v")

# Options of `reel`, which the paper's sweep has no row for.
_STEPS: tuple[float, ...] = (1.6e-3, 8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5)
_WAYS: tuple[tuple[str, int], ...] = (("visual", 5), ("visual", 9), ("geometry", 9))

# Of grids, in percent of the diagonal: they are not for coarser ones.
_LARGEST_ERRORS = (1e-3, 3e-4, 1e-4)
_SHORT = {"n_modes": "modes", "block_frames": "frames"}


@dataclass(frozen=True)
class MethodSetting:
    """A method with options of `meshreel.encode`.

    Attributes
    ----------
    options : tuple of (name, value)
    """

    method: str
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """The method in reports: a curve for each tune."""
        tune = dict(self.options).get("tune", "visual")
        return self.method if tune == "visual" else f"{self.method}-{tune}"

    @property
    def params(self) -> str:
        """The options in words; empty where all are left to the method."""
        return " ".join(f"{_SHORT.get(name, name)} {value}" for name, value in self.options)


def method_sweep(method: str, n_frames: int, n_verts: int, *, quick: bool) -> list[MethodSetting]:
    """The settings of a method, for a sequence of so many frames and vertices."""
    if method == "reel":
        return _reel_sweep(quick=quick)
    if method == "grid":
        return [MethodSetting("grid", (("max_error", error),)) for error in _LARGEST_ERRORS]
    usual = variants(n_frames, (method,))
    found = sweep(n_frames, n_verts, (method,), quick=quick) or usual
    return [_of_paper(setting) for setting in found] or [MethodSetting(method)]


def _reel_sweep(*, quick: bool) -> list[MethodSetting]:
    steps, ways = (_STEPS[1:6:2], _WAYS[:1]) if quick else (_STEPS, _WAYS)
    return [
        MethodSetting("reel", (("step", step), ("tune", tune), ("effort", effort)))
        for tune, effort in ways
        for step in steps
    ]


def _of_paper(setting: Setting) -> MethodSetting:
    options = {name: value for name, value in setting.options().items() if name != "method"}
    if not setting.anchors:  # methods without anchors refuse the option
        del options["anchors"]
    return MethodSetting(setting.method, tuple(options.items()))
