"""Encoding of materials and images to payloads of sections."""

import struct

from meshreel.codec.bitstream.container import write_text, write_varint
from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, FILTERS, WRAPS
from meshreel.model.materials import SLOTS, Image, Material, Texture

MATERIAL_NUMBERS = {
    "base_color": 4,
    "metallic": 1,
    "roughness": 1,
    "emissive": 3,
    "normal_scale": 1,
    "occlusion_strength": 1,
    "alpha_cutoff": 1,
}
TEXTURE_NUMBERS = {"offset": 2, "rotation": 1, "scale": 2}
"""Numeric fields in the order of the stream, with their sizes."""

DOUBLE_SIDED, UNLIT = 4, 8
NUMBER = struct.Struct("<d")

Appearance = Material | Texture


def write_material(material: Material) -> bytes:
    """Encode a material; default values take no bytes."""
    flags = ALPHA_MODES.index(material.alpha_mode)
    flags |= DOUBLE_SIDED * material.double_sided | UNLIT * material.unlit
    textures = material.textures
    slots = sum(1 << SLOTS.index(slot) for slot in textures)
    numbers = _write_numbers(material, Material(""), MATERIAL_NUMBERS)
    head = write_text(material.name) + bytes([flags]) + numbers + bytes([slots])
    return head + b"".join(map(_write_texture, textures.values()))


def write_image(image: Image) -> bytes:
    """Encode an image: its name, type, and unchanged bytes."""
    return write_text(image.name) + write_text(image.mime_type) + image.data


def _write_texture(texture: Texture) -> bytes:
    channels = sum(1 << CHANNELS.index(channel) for channel in texture.channels)
    wraps = WRAPS.index(texture.wrap_u) | WRAPS.index(texture.wrap_v) << 4
    magnified, shrunk = (
        0 if filter_ is None else 1 + FILTERS.index(filter_)
        for filter_ in (texture.magnified, texture.shrunk)
    )
    codes = bytes([channels, wraps, magnified | shrunk << 4])
    numbers = _write_numbers(texture, Texture(0), TEXTURE_NUMBERS)
    return write_varint(texture.image) + write_text(texture.uv) + codes + numbers


def _write_numbers(appearance: Appearance, default: Appearance, sizes: dict[str, int]) -> bytes:
    """Encode a mask of the numbers that differ from the defaults, and these numbers."""
    pairs = list(zip(_numbers(appearance, sizes), _numbers(default, sizes), strict=True))
    changed = [number for number, (own, other) in enumerate(pairs) if own != other]
    mask = sum(1 << number for number in changed)
    return write_varint(mask) + b"".join(NUMBER.pack(pairs[number][0]) for number in changed)


def _numbers(appearance: Appearance, sizes: dict[str, int]) -> list[float]:
    values = [(getattr(appearance, name), size) for name, size in sizes.items()]
    return [number for value, size in values for number in ([value] if size == 1 else value)]
