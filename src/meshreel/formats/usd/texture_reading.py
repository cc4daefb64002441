"""Reading UsdUVTexture shaders, with their UV reader and transform."""

import math
from dataclasses import dataclass, replace
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.usd.shading_inputs import Source, read_numbers, source_of
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
class ScaledTexture:
    """A texture with scale and bias of its values.

    Attributes
    ----------
    scale, bias : tuple of 4 floats
    """

    texture: Texture
    scale: tuple[float, ...]
    bias: tuple[float, ...]
    color_space: str


def read_texture(source: Source, images: StageImages) -> ScaledTexture:
    """Return the texture connected to an input of a material.

    Raises
    ------
    FormatError
        If the source is not a texture, or its image cannot be read.
    """
    shader = source.shader
    kind = str(shader.GetShaderId() or "") if shader else ""
    if kind != "UsdUVTexture" or source.output not in CHANNELS:
        raise FormatError(f"{kind or 'a shader of unknown type'} is not supported")
    texture = Texture(
        images.index(source_of(shader, "file").value),
        channels=source.output,
        wrap_u=_wrap(shader, "wrapS"),
        wrap_v=_wrap(shader, "wrapT"),
    )
    return ScaledTexture(
        _with_coordinates(texture, source_of(shader, "st").shader),
        read_numbers(source_of(shader, "scale"), (1.0,) * 4, "its scale"),
        read_numbers(source_of(shader, "bias"), (0.0,) * 4, "its bias"),
        str(source_of(shader, "sourceColorSpace").value or "auto"),
    )


def _wrap(shader: Any, name: str) -> Wrap:
    wrap = str(source_of(shader, name).value or "useMetadata")
    if wrap not in WRAPS:
        raise FormatError(f"{name} is {wrap[:60]!r}; it must be one of {', '.join(WRAPS)}")
    return WRAPS[wrap]


def _with_coordinates(texture: Texture, shader: Any) -> Texture:
    """Return the texture with its primvar and transform, from the shader of its coordinates."""
    kind = str(shader.GetShaderId() or "") if shader else ""
    if kind == "UsdTransform2d":
        rotation = math.radians(
            read_numbers(source_of(shader, "rotation"), (0.0,), "its rotation")[0]
        )
        scale = read_numbers(source_of(shader, "scale"), (1.0, 1.0), "its scale")
        translation = read_numbers(source_of(shader, "translation"), (0.0, 0.0), "its translation")
        shader = source_of(shader, "in").shader
        kind = str(shader.GetShaderId() or "") if shader else ""
        texture = with_usd_transform(
            texture, rotation, (scale[0], scale[1]), (translation[0], translation[1])
        )
    if kind != UV_READER:
        raise FormatError(f"its coordinates come from {kind or 'no shader'}, not {UV_READER}")
    name = str(source_of(shader, "varname").value or "")
    if not name:
        raise FormatError(f"its {UV_READER} has no primvar name")
    return replace(texture, uv=name)


def with_usd_transform(
    texture: Texture, rotation: float, scale: tuple[float, float], translation: tuple[float, float]
) -> Texture:
    """Return the texture with a UV transform of USD, in which v points up; rotation in radians."""
    offset = (
        translation[0] - math.sin(rotation) * scale[1],
        1 - translation[1] - math.cos(rotation) * scale[1],
    )
    return replace(texture, offset=offset, rotation=rotation, scale=scale)


def usd_translation(texture: Texture) -> tuple[float, float]:
    """Return the translation of the UV transform in USD, in which v points up."""
    sine, cosine = math.sin(texture.rotation), math.cos(texture.rotation)
    scale_v = texture.scale[1]
    return texture.offset[0] + sine * scale_v, 1 - texture.offset[1] - cosine * scale_v
