"""Textures of a stage: UsdUVTexture, with what tells it where to look."""

import math
from dataclasses import dataclass, replace
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.usd.shading_inputs import Source, numbers, source_of
from meshreel.formats.usd.stage_images import StageImages
from meshreel.model.materials import Texture, Wrap

WRAPS = {
    "repeat": Wrap.REPEAT,
    "mirror": Wrap.MIRROR,
    "clamp": Wrap.CLAMP,
    "black": Wrap.BLACK,
    "useMetadata": Wrap.METADATA,
}
UV_READER = "UsdPrimvarReader_float2"
CHANNELS = ("rgb", "r", "g", "b", "a")


@dataclass(frozen=True)
class FoundTexture:
    """A texture, and how its values are scaled and moved.

    Attributes
    ----------
    scale, bias : tuple of 4 floats
    """

    texture: Texture
    scale: tuple[float, ...]
    bias: tuple[float, ...]
    color_space: str


def read_texture(source: Source, images: StageImages) -> FoundTexture:
    """The texture that gives an input of a material.

    Raises
    ------
    FormatError
        If it is something else than a texture, or its image cannot be had.
    """
    shader = source.shader
    kind = str(shader.GetShaderId() or "") if shader else ""
    if kind != "UsdUVTexture" or source.output not in CHANNELS:
        raise FormatError(f"{kind or 'a shader of an unknown kind'} is not read")
    texture = Texture(
        images.number(source_of(shader, "file").value),
        channels=source.output,
        wrap_u=_wrap(shader, "wrapS"),
        wrap_v=_wrap(shader, "wrapT"),
    )
    return FoundTexture(
        _placed(texture, source_of(shader, "st").shader),
        numbers(source_of(shader, "scale"), (1.0,) * 4, "its scale"),
        numbers(source_of(shader, "bias"), (0.0,) * 4, "its bias"),
        str(source_of(shader, "sourceColorSpace").value or "auto"),
    )


def _wrap(shader: Any, name: str) -> Wrap:
    told = str(source_of(shader, name).value or "useMetadata")
    if told not in WRAPS:
        raise FormatError(f"{name} is {told[:60]!r}; it must be one of {', '.join(WRAPS)}")
    return WRAPS[told]


def _placed(texture: Texture, shader: Any) -> Texture:
    """The texture with the coordinates that a shader gives, or another through a transform."""
    kind = str(shader.GetShaderId() or "") if shader else ""
    if kind == "UsdTransform2d":
        rotation = math.radians(numbers(source_of(shader, "rotation"), (0.0,), "its rotation")[0])
        scale = numbers(source_of(shader, "scale"), (1.0, 1.0), "its scale")
        moved = numbers(source_of(shader, "translation"), (0.0, 0.0), "its translation")
        shader = source_of(shader, "in").shader
        kind = str(shader.GetShaderId() or "") if shader else ""
        texture = downwards(texture, rotation, (scale[0], scale[1]), (moved[0], moved[1]))
    if kind != UV_READER:
        raise FormatError(f"its coordinates are of {kind or 'no shader'}, not of {UV_READER}")
    name = str(source_of(shader, "varname").value or "")
    if not name:
        raise FormatError(f"its {UV_READER} names no primvar")
    return replace(texture, uv=name)


def downwards(
    texture: Texture, rotation: float, scale: tuple[float, float], moved: tuple[float, float]
) -> Texture:
    """The texture, placed as coordinates with v upwards are scaled, turned and moved."""
    offset = (
        moved[0] - math.sin(rotation) * scale[1],
        1 - moved[1] - math.cos(rotation) * scale[1],
    )
    return replace(texture, offset=offset, rotation=rotation, scale=scale)


def upwards(texture: Texture) -> tuple[float, float]:
    """How coordinates with v upwards are moved once they are scaled and turned."""
    sine, cosine = math.sin(texture.rotation), math.cos(texture.rotation)
    height = texture.scale[1]
    return texture.offset[0] + sine * height, 1 - texture.offset[1] - cosine * height
