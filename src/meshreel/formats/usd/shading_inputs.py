"""Inputs of shaders: their values, or the outputs of other shaders that give them."""

import math
from dataclasses import dataclass
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.extras import USD


@dataclass(frozen=True)
class Source:
    """Where an input has its value from; neither, if the file says nothing.

    Attributes
    ----------
    value : object
        None if another shader gives it.
    shader : UsdShade.Shader, optional
    output : str
        The output of that shader.
    is_moving : bool
        Whether the value differs with time.
    """

    value: Any = None
    shader: Any = None
    output: str = ""
    is_moving: bool = False

    @property
    def path(self) -> str:
        """Of the shader that gives it; empty if none does."""
        return str(self.shader.GetPath()) if self.shader else ""


def source_of(shader: Any, name: str) -> Source:
    """Where an input of a shader has its value from, through the interfaces of materials."""
    shading = USD.load("UsdShade")
    given = shader.GetInput(name)
    producers = given.GetValueProducingAttributes() if given else []
    if not producers:
        return Source()
    (first, *_) = producers
    if shading.Utils.GetType(first.GetName()) == shading.AttributeType.Output:
        output = shading.Utils.GetBaseNameAndType(first.GetName())[0]
        return Source(None, shading.Shader(first.GetPrim()), str(output))
    earliest = USD.load("Usd").TimeCode.EarliestTime()
    return Source(first.Get(earliest), is_moving=first.ValueMightBeTimeVarying())


def numbers(source: Source, default: tuple[float, ...], name: str) -> tuple[float, ...]:
    """So many numbers as the default, which is taken where the file says nothing.

    Raises
    ------
    FormatError
        If it is something else.
    """
    value = source.value
    if value is None:
        return default
    try:
        found = tuple(float(one) for one in (value if len(default) > 1 else [value]))
    except (TypeError, ValueError):
        found = ()
    if len(found) != len(default) or not all(map(math.isfinite, found)):
        raise FormatError(f"{name} is no {len(default)} finite numbers; got {str(value)[:60]!r}")
    return found
