"""Values and connections of shader inputs."""

import math
from dataclasses import dataclass
from typing import Any

from meshreel.errors import FormatError
from meshreel.runtime.extras import USD


@dataclass(frozen=True)
class Source:
    """The value of a shader input, or the shader output connected to it; empty if undeclared.

    Attributes
    ----------
    value : object
        None if the input is connected to a shader.
    shader : UsdShade.Shader, optional
    output : str
        Name of the connected output.
    is_animated : bool
        Whether the value may change over time.
    """

    value: Any = None
    shader: Any = None
    output: str = ""
    is_animated: bool = False

    @property
    def path(self) -> str:
        """Path of the connected shader; empty if there is none."""
        return str(self.shader.GetPath()) if self.shader else ""


def source_of(shader: Any, name: str) -> Source:
    """Return the source of a shader input, through the interface inputs of materials."""
    shading = USD.load("UsdShade")
    shader_input = shader.GetInput(name)
    producers = shader_input.GetValueProducingAttributes() if shader_input else []
    if not producers:
        return Source()
    (first, *_) = producers
    if shading.Utils.GetType(first.GetName()) == shading.AttributeType.Output:
        output = shading.Utils.GetBaseNameAndType(first.GetName())[0]
        return Source(None, shading.Shader(first.GetPrim()), str(output))
    earliest = USD.load("Usd").TimeCode.EarliestTime()
    return Source(first.Get(earliest), is_animated=first.ValueMightBeTimeVarying())


def read_numbers(source: Source, default: tuple[float, ...], name: str) -> tuple[float, ...]:
    """Return the numbers of an input, as many as the default, or else the default.

    Raises
    ------
    FormatError
        If the value is something else.
    """
    value = source.value
    if value is None:
        return default
    try:
        numbers = tuple(float(one) for one in (value if len(default) > 1 else [value]))
    except (TypeError, ValueError):
        numbers = ()
    if len(numbers) != len(default) or not all(map(math.isfinite, numbers)):
        raise FormatError(f"{name} must be {len(default)} finite numbers; got {str(value)[:60]!r}")
    return numbers
