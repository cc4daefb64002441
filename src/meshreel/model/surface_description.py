"""Attributes, materials and images of a surface in words."""

from meshreel.model.materials import Image, Material
from meshreel.model.surface import Domain, Surface
from meshreel.runtime.counting import counted

PLURALS = {Domain.VERTEX: "vertices", Domain.FACE: "faces", Domain.CORNER: "corners"}


def carried(surface: Surface) -> tuple[str, ...]:
    """Attributes, groups and hard edges of a surface, each as in "uv 'st' of corners"."""
    attributes = [f"{one.kind} {one.name!r} of {PLURALS[one.domain]}" for one in surface.attributes]
    groups = [
        f"{len(one.labels)} group{'s' if len(one.labels) != 1 else ''} {one.name!r} of faces"
        for one in surface.groups
    ]
    hard = [] if surface.hard_edges is None else [counted(len(surface.hard_edges), "hard edge")]
    return (*attributes, *groups, *hard)


def described_materials(surface: Surface) -> tuple[str, ...]:
    """The name of each material, and which images its textures show: "skin: normal image 0"."""
    return tuple(map(_described_material, surface.materials))


def described_images(surface: Surface) -> tuple[str, ...]:
    """Number, name, type and size of each image: "0: 'shade', image/png, 92 bytes"."""
    return tuple(_described_image(*one) for one in enumerate(surface.images))


def _described_material(material: Material) -> str:
    shown = [
        f"{slot.replace('_', ' ')} image {texture.image}"
        for slot, texture in material.textures.items()
    ]
    return f"{material.name}: {', '.join(shown)}" if shown else material.name


def _described_image(number: int, image: Image) -> str:
    named = f"{image.name!r}, " if image.name else ""
    return f"{number}: {named}{image.mime_type}, {len(image.data)} bytes"
