"""The settings at which our methods are compared with other codecs."""

from dataclasses import dataclass
from typing import Any

from meshreel.codec.methods import METHOD_NAMES
from meshreel.paper.sweeps import Setting, sweep, variants

CODED_METHODS = METHOD_NAMES
DEFAULT_METHODS = ("reel", "pca-qp", "v2v")

# Steps, and pairs of tune and effort, of `reel`, which the paper's sweep does not contain.
_STEPS: tuple[float, ...] = (1.6e-3, 8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5)
_PROFILES: tuple[tuple[str, int], ...] = (("visual", 5), ("visual", 9), ("geometry", 9))

# Error bounds of `grid` in percent of the diagonal; larger bounds suit other methods.
_GRID_ERRORS = (1e-3, 3e-4, 1e-4)
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
        """The name of the curve in reports; each tune is a curve."""
        tune = dict(self.options).get("tune", "visual")
        return self.method if tune == "visual" else f"{self.method}-{tune}"

    @property
    def params(self) -> str:
        """The options as text; empty if all are defaults."""
        return " ".join(f"{_SHORT.get(name, name)} {value}" for name, value in self.options)


def method_sweep(method: str, n_frames: int, n_verts: int, *, quick: bool) -> list[MethodSetting]:
    """The settings of a method for a sequence of this size."""
    if method == "reel":
        steps, profiles = (_STEPS[1:6:2], _PROFILES[:1]) if quick else (_STEPS, _PROFILES)
        return [
            MethodSetting("reel", (("step", step), ("tune", tune), ("effort", effort)))
            for tune, effort in profiles
            for step in steps
        ]
    if method == "grid":
        return [MethodSetting("grid", (("max_error", error),)) for error in _GRID_ERRORS]
    defaults = variants(n_frames, (method,))
    settings = sweep(n_frames, n_verts, (method,), quick=quick) or defaults
    return [_from_paper(setting) for setting in settings] or [MethodSetting(method)]


def _from_paper(setting: Setting) -> MethodSetting:
    options = {name: value for name, value in setting.options().items() if name != "method"}
    if not setting.anchors:  # methods without anchors reject the option
        del options["anchors"]
    return MethodSetting(setting.method, tuple(options.items()))
