"""The settings of our own methods that are set against other codecs."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from meshreel.codec.methods import METHODS
from meshreel.evaluation.settings import Setting, checked_names, sweep, variants

CODED_METHODS = tuple(method.name for method in METHODS)
DEFAULT_METHODS = ("reel", "pca-qp", "v2v")

# Options of methods that the paper's sweep has no row for; without one, their defaults are run.
_STEPS = (1.6e-3, 8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5)
_MORE_SWEEPS: dict[str, tuple[dict[str, Any], ...]] = {
    "reel": tuple({"step": step} for step in _STEPS)
}
_SHORT = {"n_modes": "modes", "block_frames": "frames"}


@dataclass(frozen=True)
class MethodSetting:
    """A method with options of `meshreel.encode`.

    Attributes
    ----------
    method : str
    options : tuple of (name, value)
    """

    method: str
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def params(self) -> str:
        """The options in words; empty where all are left to the method."""
        return " ".join(f"{_SHORT.get(name, name)} {value}" for name, value in self.options)


def checked_coded_methods(names: Iterable[str]) -> tuple[str, ...]:
    """The methods of these names, in the order of `METHODS`, each once.

    Raises
    ------
    InvalidInputError
        If a name is unknown, or there is none.
    """
    return checked_names(names, CODED_METHODS, "method")


def method_sweep(method: str, n_frames: int, n_verts: int, *, quick: bool) -> list[MethodSetting]:
    """The settings of a method, for a sequence of so many frames and vertices."""
    if method in _MORE_SWEEPS:
        return [MethodSetting(method, tuple(row.items())) for row in _MORE_SWEEPS[method]]
    usual = variants(n_frames, (method,))
    found = sweep(n_frames, n_verts, (method,), quick=quick) or usual
    return [_of_paper(setting) for setting in found] or [MethodSetting(method)]


def _of_paper(setting: Setting) -> MethodSetting:
    options = {name: value for name, value in setting.options().items() if name != "method"}
    if not setting.anchors:  # methods without anchors refuse the option
        del options["anchors"]
    return MethodSetting(setting.method, tuple(options.items()))
