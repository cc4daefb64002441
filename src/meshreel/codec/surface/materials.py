"""Payloads of the sections of materials and images, written and read."""

import struct
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import Any, TypeVar

from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, FILTERS, WRAPS
from meshreel.codec.surface.texts import read_text, write_text
from meshreel.entropy.varint import read_varint, write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError
from meshreel.materials import SLOTS, Image, Material, Texture

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
"""Fields of numbers in the order of the stream, with their sizes."""

DOUBLE_SIDED, UNLIT = 4, 8
NUMBER = struct.Struct("<d")

Look = TypeVar("Look", Material, Texture)
Choice = TypeVar("Choice")


def write_material(material: Material) -> bytes:
    """Payload of a material; only values other than the defaults take bytes."""
    flags = ALPHA_MODES.index(material.alpha_mode)
    flags |= DOUBLE_SIDED * material.double_sided | UNLIT * material.unlit
    textures = material.textures
    slots = sum(1 << SLOTS.index(slot) for slot in textures)
    numbers = _write_numbers(material, Material(""), MATERIAL_NUMBERS)
    head = write_text(material.name) + bytes([flags]) + numbers + bytes([slots])
    return head + b"".join(map(_write_texture, textures.values()))


def read_material(payload: bytes) -> Material:
    """The material that `write_material` wrote; references to images are not checked.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If it is damaged, or bytes are left over.
    """
    name, position = read_text(payload, 0)
    flags, position = _read_byte(payload, position, 16)
    found, position = _read_numbers(payload, position, Material(name), MATERIAL_NUMBERS)
    slots, position = _read_byte(payload, position, 1 << len(SLOTS))
    textures = {}
    for number, slot in enumerate(SLOTS):
        if slots >> number & 1:
            textures[slot], position = _read_texture(payload, position)
    if position != len(payload):
        raise CorruptStreamError(f"{len(payload) - position} bytes follow material {name!r}")
    return replace(
        found.with_textures(textures),
        alpha_mode=_choice(ALPHA_MODES, flags & 3),
        double_sided=bool(flags & DOUBLE_SIDED),
        unlit=bool(flags & UNLIT),
    )


def write_image(image: Image) -> bytes:
    """Payload of an image: its name, type, and unchanged bytes."""
    return write_text(image.name) + write_text(image.mime_type) + image.data


def read_image(payload: bytes) -> Image:
    """The image that `write_image` wrote.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If it ends inside its name, or the name is not UTF-8.
    """
    name, position = read_text(payload, 0)
    mime_type, position = read_text(payload, position)
    return Image(name, mime_type, payload[position:])


def _write_texture(texture: Texture) -> bytes:
    channels = sum(1 << CHANNELS.index(channel) for channel in texture.channels)
    wraps = WRAPS.index(texture.wrap_u) | WRAPS.index(texture.wrap_v) << 4
    magnified, shrunk = (
        0 if one is None else 1 + FILTERS.index(one) for one in (texture.magnified, texture.shrunk)
    )
    codes = bytes([channels, wraps, magnified | shrunk << 4])
    numbers = _write_numbers(texture, Texture(0), TEXTURE_NUMBERS)
    return write_varint(texture.image) + write_text(texture.uv) + codes + numbers


def _read_texture(payload: bytes, position: int) -> tuple[Texture, int]:
    image, position = read_varint(payload, position)
    uv, position = read_text(payload, position)
    channels, position = _read_byte(payload, position, 1 << len(CHANNELS))
    wraps, position = _read_byte(payload, position, 256)
    filters, position = _read_byte(payload, position, 256)
    texture = Texture(
        image,
        uv,
        "".join(letter for bit, letter in enumerate(CHANNELS) if channels >> bit & 1),
        _choice(WRAPS, wraps & 15),
        _choice(WRAPS, wraps >> 4),
        _choice((None, *FILTERS), filters & 15),
        _choice((None, *FILTERS), filters >> 4),
    )
    return _read_numbers(payload, position, texture, TEXTURE_NUMBERS)


def _write_numbers(one: Look, default: Look, sizes: dict[str, int]) -> bytes:
    """A mask of the numbers that are not defaults, and these numbers."""
    pairs = list(zip(_numbers(one, sizes), _numbers(default, sizes), strict=True))
    changed = [number for number, (own, other) in enumerate(pairs) if own != other]
    mask = sum(1 << number for number in changed)
    return write_varint(mask) + b"".join(NUMBER.pack(pairs[number][0]) for number in changed)


def _read_numbers(
    payload: bytes, position: int, default: Look, sizes: dict[str, int]
) -> tuple[Look, int]:
    numbers = _numbers(default, sizes)
    mask, position = read_varint(payload, position)
    if mask >> len(numbers):
        raise CorruptStreamError(f"a material sets more than its {len(numbers)} numbers")
    for number in range(len(numbers)):
        if mask >> number & 1:
            if position + NUMBER.size > len(payload):
                raise TruncatedStreamError("a material ends inside a number")
            (numbers[number],) = NUMBER.unpack_from(payload, position)
            position += NUMBER.size
    ends = accumulate(sizes.values(), initial=0)
    values = [numbers[start:end] for start, end in pairwise(ends)]
    changes: dict[str, Any] = {
        name: value[0] if len(value) == 1 else tuple(value)
        for name, value in zip(sizes, values, strict=True)
    }
    return replace(default, **changes), position


def _numbers(one: Material | Texture, sizes: dict[str, int]) -> list[float]:
    values = [(getattr(one, name), size) for name, size in sizes.items()]
    return [number for value, size in values for number in ([value] if size == 1 else value)]


def _read_byte(payload: bytes, position: int, limit: int) -> tuple[int, int]:
    if position >= len(payload):
        raise TruncatedStreamError("a material ends inside its flags")
    if payload[position] >= limit:
        raise CorruptStreamError(f"a material has flags {payload[position]}, which are unknown")
    return payload[position], position + 1


def _choice(allowed: Sequence[Choice], code: int) -> Choice:
    if code >= len(allowed):
        raise CorruptStreamError(f"a material has a choice {code}, which is unknown")
    return allowed[code]
