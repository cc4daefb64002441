"""Materials of groups of faces, with their textures and images, as in glTF."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Any, SupportsFloat

from meshreel.errors import InvalidInputError


class AlphaMode(StrEnum):
    """Use of the alpha component of a color."""

    OPAQUE = "opaque"
    MASK = "mask"
    BLEND = "blend"


class Wrap(StrEnum):
    """Wrap mode of a texture outside its image; BLACK and METADATA exist only in USD."""

    REPEAT = "repeat"
    MIRROR = "mirror"
    CLAMP = "clamp"
    BLACK = "black"
    METADATA = "metadata"


class Filter(StrEnum):
    """Filter of a texture for minification, or (NEAREST and LINEAR only) magnification."""

    NEAREST = "nearest"
    LINEAR = "linear"
    NEAREST_MIPMAP_NEAREST = "nearest mipmap nearest"
    LINEAR_MIPMAP_NEAREST = "linear mipmap nearest"
    NEAREST_MIPMAP_LINEAR = "nearest mipmap linear"
    LINEAR_MIPMAP_LINEAR = "linear mipmap linear"


@dataclass(frozen=True)
class Image:
    """An encoded image.

    Parameters
    ----------
    name : str
        Name in the file, possibly empty.
    mime_type : str
        Such as "image/png".
    data : bytes
        Contents of an image file.
    """

    name: str
    mime_type: str
    data: bytes

    def __repr__(self) -> str:
        return f"<Image {self.name!r}: {self.mime_type}, {len(self.data)} bytes>"


@dataclass(frozen=True)
class Texture:
    """An image on a surface.

    Parameters
    ----------
    image : int
        Index of an image of the surface.
    uv : str
        Name of the texture coordinates, an attribute of the surface.
    channels : str
        Channels of the image to use: "rgb" or "rgba" for a color, a single one for a number.
    wrap_u, wrap_v : Wrap
    magnified, shrunk : Filter, optional
        Filters for magnification and minification.
    offset, rotation, scale
        Transform of texture coordinates as in glTF's KHR_texture_transform, where v points down;
        the rotation is in radians.
    """

    image: int
    uv: str = "uv"
    channels: str = "rgb"
    wrap_u: Wrap = Wrap.REPEAT
    wrap_v: Wrap = Wrap.REPEAT
    magnified: Filter | None = None
    shrunk: Filter | None = None
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    @property
    def is_placed(self) -> bool:
        """Whether its texture coordinates are translated, rotated or scaled."""
        return (self.offset, self.rotation, self.scale) != ((0.0, 0.0), 0.0, (1.0, 1.0))


@dataclass(frozen=True)
class Material:
    """Appearance of a surface; numbers multiply the values of textures.

    Parameters
    ----------
    name : str
        The label of its faces in the groups "material"; unique.
    base_color : tuple of 4 floats
        Linear red, green, blue, and opacity.
    metallic, roughness : float
    emissive : tuple of 3 floats
        Linear, 1 is white; may be above 1.
    normal_scale, occlusion_strength : float
    alpha_mode : AlphaMode
    alpha_cutoff : float
        In mode MASK, opacities below it are invisible.
    double_sided, unlit : bool
    base_color_texture, metallic_texture, roughness_texture, normal_texture, occlusion_texture, \
emissive_texture : Texture, optional
    """

    name: str
    base_color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    metallic: float = 1.0
    roughness: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    alpha_mode: AlphaMode = AlphaMode.OPAQUE
    alpha_cutoff: float = 0.5
    double_sided: bool = False
    unlit: bool = False
    base_color_texture: Texture | None = None
    metallic_texture: Texture | None = None
    roughness_texture: Texture | None = None
    normal_texture: Texture | None = None
    occlusion_texture: Texture | None = None
    emissive_texture: Texture | None = None

    @property
    def textures(self) -> dict[str, Texture]:
        """The textures of the material, by slot (`SLOTS`)."""
        textures = {slot: getattr(self, f"{slot}_texture") for slot in SLOTS}
        return {slot: texture for slot, texture in textures.items() if texture is not None}

    def with_textures(self, textures: dict[str, Texture]) -> "Material":
        """The material with its textures replaced by these."""
        changes: dict[str, Any] = {f"{slot}_texture": textures.get(slot) for slot in SLOTS}
        return replace(self, **changes)


COLOR_SLOTS = ("base_color", "normal", "emissive")
SLOTS = ("base_color", "metallic", "roughness", "normal", "occlusion", "emissive")
"""Slots of textures; those not in `COLOR_SLOTS` have one component."""

DEFAULT_MATERIAL = Material("", metallic=0.0, double_sided=True)
"""Material of colored faces without one, in formats that require one."""

CLAY_MATERIAL = replace(DEFAULT_MATERIAL, base_color=(0.456, 0.456, 0.456, 1.0), roughness=0.4)
"""Material of faces without one nor colors, in viewers, in pictures and in formats of viewers."""


def select_materials(
    labels: Sequence[str], materials: Sequence[Material], images: Sequence[Image]
) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
    """The materials with these labels, and the images that they use, renumbered."""
    names = set(labels)
    selected = [material for material in materials if material.name in names]
    used_images = sorted(
        {texture.image for material in selected for texture in material.textures.values()}
    )
    numbers = {old: number for number, old in enumerate(used_images)}
    return tuple(renumber_images(material, numbers) for material in selected), tuple(
        images[number] for number in used_images
    )


def renumber_images(material: Material, numbers: dict[int, int]) -> Material:
    """The material with its image indices renumbered."""
    return material.with_textures(
        {
            slot: replace(texture, image=numbers[texture.image])
            for slot, texture in material.textures.items()
        }
    )


def validated_materials(
    materials: Sequence[Material], images: Sequence[Image]
) -> tuple[Material, ...]:
    """Return the materials if their images exist, names are unique and numbers are finite.

    Raises
    ------
    InvalidInputError
        Otherwise; the message names the material and the invalid field.
    """
    for name, number in Counter(material.name for material in materials).items():
        if number > 1:
            raise InvalidInputError(
                f"{number} materials have the name {name!r}; names must be unique"
            )
    return tuple(_validated(material, len(images)) for material in materials)


def _validated(material: Material, n_images: int) -> Material:
    owner = f"material {material.name!r}"
    textures = {}
    for slot, texture in material.textures.items():
        name = f"the {slot} texture of {owner}"
        allowed = ("rgb", "rgba") if slot in COLOR_SLOTS else ("r", "g", "b", "a")
        if texture.channels not in allowed:
            raise InvalidInputError(
                f"{name} has channels {texture.channels!r}; allowed are {', '.join(allowed)}"
            )
        if not 0 <= texture.image < n_images:
            raise InvalidInputError(f"{name} refers to image {texture.image}; there are {n_images}")
        textures[slot] = replace(texture, **_converted(texture, name), **_filters(texture, name))
    return replace(material, **_converted(material, owner)).with_textures(textures)


def _converted(instance: Material | Texture, owner: str) -> dict[str, Any]:
    """Fields with numbers converted to floats, and choices to members of their enums."""
    values: dict[str, Any] = {}
    for field in fields(instance):
        name, default, value = field.name, field.default, getattr(instance, field.name)
        if isinstance(default, StrEnum):
            values[name] = _member(value, tuple(type(default)), f"{name} of {owner}")
        elif isinstance(default, bool):
            values[name] = bool(value)
        elif isinstance(default, tuple):
            if len(value) != len(default):
                raise InvalidInputError(
                    f"{name} of {owner} must have {len(default)} numbers; got {len(value)}"
                )
            values[name] = tuple(_finite(number, f"{name} of {owner}") for number in value)
        elif isinstance(default, float):
            values[name] = _finite(value, f"{name} of {owner}")
    return values


def _filters(texture: Texture, owner: str) -> dict[str, Any]:
    magnified, shrunk = texture.magnified, texture.shrunk
    allowed = (Filter.NEAREST, Filter.LINEAR)
    return {
        "magnified": magnified and _member(magnified, allowed, f"magnified of {owner}"),
        "shrunk": shrunk and _member(shrunk, tuple(Filter), f"shrunk of {owner}"),
    }


def _member(value: Any, allowed: Sequence[StrEnum], name: str) -> StrEnum:
    if value not in allowed:
        raise InvalidInputError(f"{name} must be one of {', '.join(allowed)}; got {value!r}")
    return allowed[allowed.index(value)]


def _finite(value: Any, name: str) -> float:
    if not isinstance(value, SupportsFloat) or not math.isfinite(value):
        raise InvalidInputError(f"{name} must be finite; got {value}")
    return float(value)
