"""Materials of groups of faces, with their textures and images, as in glTF."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from enum import StrEnum
from typing import Any, SupportsFloat

from meshreel.errors import InvalidInputError


class AlphaMode(StrEnum):
    """Use of the fourth component of a colour."""

    OPAQUE = "opaque"
    MASK = "mask"
    BLEND = "blend"


class Wrap(StrEnum):
    """Wrap mode of a texture outside its image; USD has the last two, glTF does not."""

    REPEAT = "repeat"
    MIRROR = "mirror"
    CLAMP = "clamp"
    BLACK = "black"
    METADATA = "metadata"


class Filter(StrEnum):
    """Filter of a texture for magnification (the first two only) or minification."""

    NEAREST = "nearest"
    LINEAR = "linear"
    NEAREST_MIPMAP_NEAREST = "nearest mipmap nearest"
    LINEAR_MIPMAP_NEAREST = "linear mipmap nearest"
    NEAREST_MIPMAP_LINEAR = "nearest mipmap linear"
    LINEAR_MIPMAP_LINEAR = "linear mipmap linear"


@dataclass(frozen=True)
class Image:
    """An image as in its file, not decoded.

    Parameters
    ----------
    name : str
        Name in the file, possibly empty.
    mime_type : str
        Such as "image/png".
    data : bytes
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
        Channels of the image that are used: "rgb" or "rgba" for a colour, one of them for a number.
    wrap_u, wrap_v : Wrap
    magnified, shrunk : Filter, optional
    offset, rotation, scale
        Transform of texture coordinates as in glTF's KHR_texture_transform: v downwards, in
        radians.
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
        The label of its faces in the groups "material"; no other material has it.
    base_color : tuple of 4 floats
        Linear red, green, blue, and opacity.
    metallic, roughness : float
    emissive : tuple of 3 floats
        Linear, 1 is white; may be above 1.
    normal_scale, occlusion_strength : float
    alpha_mode : AlphaMode
    alpha_cutoff : float
        In mode MASK, opacities below it are not drawn.
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
        found = {slot: getattr(self, f"{slot}_texture") for slot in SLOTS}
        return {slot: texture for slot, texture in found.items() if texture is not None}

    def with_textures(self, textures: dict[str, Texture]) -> "Material":
        """The material with these textures and no others."""
        found: dict[str, Any] = {f"{slot}_texture": textures.get(slot) for slot in SLOTS}
        return replace(self, **found)


COLOR_SLOTS = ("base_color", "normal", "emissive")
SLOTS = ("base_color", "metallic", "roughness", "normal", "occlusion", "emissive")
"""Slots of textures; those that are not in `COLOR_SLOTS` have one component."""

UNSAID = Material("", metallic=0.0, double_sided=True)
"""Material of faces without one, for formats that need it: dull, double-sided."""


def used_by(
    labels: Sequence[str], materials: Sequence[Material], images: Sequence[Image]
) -> tuple[tuple[Material, ...], tuple[Image, ...]]:
    """The materials of these labels, and the images that they use, renumbered."""
    wanted = set(labels)
    kept = [one for one in materials if one.name in wanted]
    shown = sorted({texture.image for one in kept for texture in one.textures.values()})
    new = {old: number for number, old in enumerate(shown)}
    return tuple(renumbered(one, new) for one in kept), tuple(images[one] for one in shown)


def renumbered(material: Material, numbers: dict[int, int]) -> Material:
    """The material with its image indices renumbered."""
    textures = material.textures
    moved = {slot: replace(one, image=numbers[one.image]) for slot, one in textures.items()}
    return material.with_textures(moved)


def validated_materials(
    materials: Sequence[Material], images: Sequence[Image]
) -> tuple[Material, ...]:
    """The materials, if their images exist, their names are unique and their numbers finite.

    Raises
    ------
    InvalidInputError
        Naming the material, and its fault.
    """
    for name, number in Counter(one.name for one in materials).items():
        if number > 1:
            raise InvalidInputError(
                f"{number} materials are called {name!r}; give each a name of its own"
            )
    return tuple(_validated(one, len(images)) for one in materials)


def _validated(given: Material, n_images: int) -> Material:
    place = f"material {given.name!r}"
    textures = {}
    for slot, one in given.textures.items():
        where = f"the {slot} texture of {place}"
        allowed = ("rgb", "rgba") if slot in COLOR_SLOTS else ("r", "g", "b", "a")
        if one.channels not in allowed:
            raise InvalidInputError(
                f"{where} has channels {one.channels!r}; allowed are {', '.join(allowed)}"
            )
        if not 0 <= one.image < n_images:
            raise InvalidInputError(f"{where} shows image {one.image}; there are {n_images}")
        textures[slot] = replace(one, **_plain(one, where), **_filters(one, where))
    return replace(given, **_plain(given, place)).with_textures(textures)


def _plain(one: Material | Texture, place: str) -> dict[str, Any]:
    """Checked numbers as floats, and choices as members of their enums."""
    found: dict[str, Any] = {}
    for name, default in _DEFAULTS[type(one)]:
        value = getattr(one, name)
        if isinstance(default, StrEnum):
            found[name] = _choice(value, tuple(type(default)), f"{name} of {place}")
        elif isinstance(default, bool):
            found[name] = bool(value)
        elif isinstance(default, tuple):
            if len(value) != len(default):
                raise InvalidInputError(
                    f"{name} of {place} must have {len(default)} numbers; got {len(value)}"
                )
            found[name] = tuple(_finite(number, name, place) for number in value)
        elif isinstance(default, float):
            found[name] = _finite(value, name, place)
    return found


def _filters(texture: Texture, place: str) -> dict[str, Any]:
    magnified, shrunk = texture.magnified, texture.shrunk
    enlarging = (Filter.NEAREST, Filter.LINEAR)
    return {
        "magnified": magnified and _choice(magnified, enlarging, f"magnified of {place}"),
        "shrunk": shrunk and _choice(shrunk, tuple(Filter), f"shrunk of {place}"),
    }


def _choice(value: Any, allowed: Sequence[StrEnum], what: str) -> StrEnum:
    if value not in allowed:
        raise InvalidInputError(f"{what} must be one of {', '.join(allowed)}; got {value!r}")
    return allowed[allowed.index(value)]


def _finite(value: Any, name: str, place: str) -> float:
    if not isinstance(value, SupportsFloat) or not math.isfinite(value):
        raise InvalidInputError(f"{name} of {place} must be finite; got {value}")
    return float(value)


def _defaults(kind: type[Material] | type[Texture]) -> Iterator[tuple[str, Any]]:
    return ((one.name, one.default) for one in fields(kind))


_DEFAULTS = {kind: tuple(_defaults(kind)) for kind in (Material, Texture)}
