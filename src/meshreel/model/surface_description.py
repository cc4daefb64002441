"""Text about the attributes, materials and images of a surface."""

from meshreel.model.materials import Image, Material
from meshreel.model.surface import Domain, Surface
from meshreel.runtime.counting import counted

PLURALS = {Domain.VERTEX: "vertices", Domain.FACE: "faces", Domain.CORNER: "corners"}


def describe_attributes(surface: Surface) -> tuple[str, ...]:
    """Text for each attribute, kind of groups and hard edges, such as "uv 'st' of corners"."""
    attributes = [
        f"{attribute.kind} {attribute.name!r} of {PLURALS[attribute.domain]}"
        for attribute in surface.attributes
    ]
    groups = [
        f"{counted(len(groups.labels), 'group')} {groups.name!r} of faces"
        for groups in surface.groups
    ]
    hard = [] if surface.hard_edges is None else [counted(len(surface.hard_edges), "hard edge")]
    return (*attributes, *groups, *hard)


def describe_materials(surface: Surface) -> tuple[str, ...]:
    """Name of each material and its images, such as "skin: normal image 0"."""
    return tuple(map(_describe_material, surface.materials))


def describe_images(surface: Surface) -> tuple[str, ...]:
    """Number, name, type and size of each image, such as "0: 'shade', image/png, 92 bytes"."""
    return tuple(_describe_image(number, image) for number, image in enumerate(surface.images))


def _describe_material(material: Material) -> str:
    textures = [
        f"{slot.replace('_', ' ')} image {texture.image}"
        for slot, texture in material.textures.items()
    ]
    return f"{material.name}: {', '.join(textures)}" if textures else material.name


def _describe_image(number: int, image: Image) -> str:
    name = f"{image.name!r}, " if image.name else ""
    return f"{number}: {name}{image.mime_type}, {len(image.data)} bytes"
