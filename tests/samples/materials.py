"""Deterministic materials and images shared by tests."""

import struct
import zlib
from dataclasses import replace

from meshreel.model.materials import AlphaMode, Filter, Image, Material, Texture, Wrap
from samples.meshes import quad_sheet, two_sheets


def png(shade=128, name="shade"):
    """Return a PNG of one gray pixel."""

    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", 1, 1, 8, 2, 0, 0, 0))
    body = chunk(b"IDAT", zlib.compress(bytes([0, shade, shade, shade])))
    data = b"\x89PNG\r\n\x1a\n" + head + body + chunk(b"IEND", b"")
    return Image(name, "image/png", data)


def jpeg(name="photo"):
    """Return bytes that begin and end like a JPEG."""
    return Image(name, "image/jpeg", b"\xff\xd8\xff\xe0" + bytes(range(200)) + b"\xff\xd9")


def look():
    """Return two materials that use every feature of glTF, and their images.

    All numbers are of float32, so that USD holds them too.
    """
    red = Material(
        "red",
        base_color=(1.0, 0.5, 0.25, 0.75),
        metallic=0.125,
        roughness=0.375,
        emissive=(0.5, 0.25, 0.0),
        normal_scale=0.5,
        occlusion_strength=0.75,
        alpha_mode=AlphaMode.MASK,
        alpha_cutoff=0.25,
        double_sided=True,
        base_color_texture=Texture(0, "st", "rgba", Wrap.CLAMP, Wrap.MIRROR),
        metallic_texture=Texture(1, "st", "b"),
        roughness_texture=Texture(1, "st", "g"),
        normal_texture=Texture(1, "st"),
        occlusion_texture=Texture(1, "st", "r"),
        emissive_texture=Texture(0, "st"),
    )
    cloth = Material(
        "gr\u00fcn",
        roughness=0.5,
        base_color_texture=Texture(
            1,
            "st",
            magnified=Filter.NEAREST,
            shrunk=Filter.LINEAR_MIPMAP_LINEAR,
            offset=(0.5, 0.25),
            rotation=0.5,
            scale=(2.0, 4.0),
        ),
        unlit=True,
    )
    return (red, cloth), (png(), jpeg())


def dressed(sequence):
    """Return the sequence with materials for its groups "red" and "grün"."""
    materials, images = look()
    return sequence.replace(surface=replace(sequence.surface, materials=materials, images=images))


def dressed_sheet(n_frames=6):
    """Return `quad_sheet` with materials and images."""
    return dressed(quad_sheet(n_frames))


def dressed_sheets(n_frames=6):
    """Return `two_sheets` with materials and images."""
    return dressed(two_sheets(n_frames))
