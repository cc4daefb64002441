"""Materials of a stage that is being written."""

from typing import Any

from meshreel.formats.extras import USD
from meshreel.formats.usd.prim_names import different, prim_name


class Materials:
    """The materials of a stage, each made when it is first bound; they have names and no more.

    Parameters
    ----------
    stage : Usd.Stage
    root : str
        The path that they go under.
    taken : set of str
        Names of prims that are there already.
    """

    def __init__(self, stage: Any, root: str, taken: set[str]) -> None:
        self._stage = stage
        self._scope = f"{root}/{different('Materials', taken)}"
        self._names: set[str] = set()
        self._made: dict[str, Any] = {}

    def bind(self, prim: Any, label: str) -> None:
        """Bind the material of that label to a prim."""
        shading = USD.load("UsdShade")
        if not self._made:
            USD.load("UsdGeom").Scope.Define(self._stage, self._scope)
        if label not in self._made:
            name = different(prim_name(label), self._names)
            self._made[label] = shading.Material.Define(self._stage, f"{self._scope}/{name}")
            show_as(self._made[label].GetPrim(), label)
        shading.MaterialBindingAPI.Apply(prim).Bind(self._made[label])


def show_as(prim: Any, label: str) -> None:
    """Give a prim the name that people are shown, if it is another."""
    if prim.GetName() != label:
        prim.SetDisplayName(label)
