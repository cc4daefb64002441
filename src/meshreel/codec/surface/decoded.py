"""The surface of a file, from the structures of `core/include/meshreel.h`."""

import ctypes

import numpy as np

from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, DOMAINS, FILTERS, KINDS, WRAPS
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.files import OpenFile, array_at, text_of
from meshreel.kernel.structures import NUMBER_TYPES, Text, fields_of
from meshreel.model.cells import Cells
from meshreel.model.materials import SLOTS, Image, Material, Texture
from meshreel.model.surface import Attribute, FaceGroups, Part, Surface

NO_IMAGE = 2**32 - 1
FILTERS_OR_ANY = (None, *FILTERS)

_U32, _U64, _POINTER, _DOUBLE = ctypes.c_uint32, ctypes.c_uint64, ctypes.c_void_p, ctypes.c_double


class _Attribute(ctypes.Structure):
    _fields_ = [
        ("name", Text),
        *fields_of(_U32, "kind domain type width n_rows n_items is_indexed reserved"),
        *fields_of(_POINTER, "values rows"),
    ]


class _Groups(ctypes.Structure):
    _fields_ = [
        ("name", Text),
        *fields_of(_U32, "n_labels reserved"),
        ("labels", ctypes.POINTER(Text)),
        ("of_faces", _POINTER),
    ]


class _Part(ctypes.Structure):
    _fields_ = [("name", Text), *fields_of(_U32, "n_verts n_faces")]


class _Texture(ctypes.Structure):
    _fields_ = [
        *fields_of(_U32, "image channels wrap_u wrap_v magnified shrunk"),
        ("uv", Text),
        ("offset", _DOUBLE * 2),
        ("rotation", _DOUBLE),
        ("scale", _DOUBLE * 2),
    ]


class _Material(ctypes.Structure):
    _fields_ = [
        ("name", Text),
        *fields_of(_U32, "alpha_mode is_double_sided is_unlit reserved"),
        ("base_color", _DOUBLE * 4),
        *fields_of(_DOUBLE, "metallic roughness"),
        ("emissive", _DOUBLE * 3),
        *fields_of(_DOUBLE, "normal_scale occlusion_strength alpha_cutoff"),
        ("textures", _Texture * len(SLOTS)),
    ]


class _Image(ctypes.Structure):
    _fields_ = [("name", Text), ("media_type", Text), *fields_of(_U64, "offset size")]


class _Surface(ctypes.Structure):
    _fields_ = [
        *fields_of(_POINTER, "face_sizes triangle_corners"),
        ("attributes", ctypes.POINTER(_Attribute)),
        ("groups", ctypes.POINTER(_Groups)),
        ("parts", ctypes.POINTER(_Part)),
        ("materials", ctypes.POINTER(_Material)),
        ("images", ctypes.POINTER(_Image)),
        ("hard_edges", _POINTER),
        *fields_of(_U32, "n_attributes n_groups n_parts n_materials n_images n_hard_edges"),
    ]


def decoded_surface(file: OpenFile) -> Surface:
    """Polygons, attributes, groups, parts, materials and hard edges of a file.

    Raises
    ------
    CorruptStreamError, TruncatedStreamError
        If a section is damaged, or does not fit the mesh.
    MemoryLimitError
        If it takes more memory than allowed.
    """
    stored = _Surface.from_address(file.surface_address())
    info = file.info
    sizes = None
    if stored.face_sizes:
        sizes = array_at(stored.face_sizes, info.n_faces, np.int32)
    hard_edges = None
    if stored.n_hard_edges:
        hard_edges = array_at(stored.hard_edges, 2 * stored.n_hard_edges, np.int32).reshape(-1, 2)
    surface = Surface(
        sizes,
        tuple(_attribute(stored.attributes[i]) for i in range(stored.n_attributes)),
        tuple(_groups(stored.groups[i], info.n_faces) for i in range(stored.n_groups)),
        tuple(
            Part(text_of(part.name), part.n_verts, part.n_faces)
            for part in (stored.parts[i] for i in range(stored.n_parts))
        ),
        tuple(_material(stored.materials[i]) for i in range(stored.n_materials)),
        tuple(_image(stored.images[i], file) for i in range(stored.n_images)),
        hard_edges,
        cells=None if file.cells is None else Cells(*file.cells),
    )
    try:
        return surface.validated(info.n_verts, file.faces)
    except InvalidInputError as error:
        raise CorruptStreamError(f"the surface does not fit the mesh: {error}") from error


def _attribute(stored: _Attribute) -> Attribute:
    dtype = NUMBER_TYPES[stored.type]
    values = array_at(stored.values, stored.n_rows * stored.width, dtype).reshape(-1, stored.width)
    rows = array_at(stored.rows, stored.n_items, np.int32) if stored.rows else None
    if rows is not None and not stored.is_indexed:
        values, rows = values[rows], None
    return Attribute(text_of(stored.name), KINDS[stored.kind], DOMAINS[stored.domain], values, rows)


def _groups(stored: _Groups, n_faces: int) -> FaceGroups:
    labels = tuple(text_of(stored.labels[i]) for i in range(stored.n_labels))
    return FaceGroups(text_of(stored.name), labels, array_at(stored.of_faces, n_faces, np.int32))


def _material(stored: _Material) -> Material:
    textures = {
        slot: _texture(texture)
        for slot, texture in zip(SLOTS, stored.textures, strict=True)
        if texture.image != NO_IMAGE
    }
    return Material(
        text_of(stored.name),
        tuple(stored.base_color),
        stored.metallic,
        stored.roughness,
        tuple(stored.emissive),
        stored.normal_scale,
        stored.occlusion_strength,
        ALPHA_MODES[stored.alpha_mode],
        stored.alpha_cutoff,
        bool(stored.is_double_sided),
        bool(stored.is_unlit),
    ).with_textures(textures)


def _texture(stored: _Texture) -> Texture:
    return Texture(
        stored.image,
        text_of(stored.uv),
        "".join(letter for bit, letter in enumerate(CHANNELS) if stored.channels >> bit & 1),
        WRAPS[stored.wrap_u],
        WRAPS[stored.wrap_v],
        FILTERS_OR_ANY[stored.magnified],
        FILTERS_OR_ANY[stored.shrunk],
        tuple(stored.offset),
        stored.rotation,
        tuple(stored.scale),
    )


def _image(stored: _Image, file: OpenFile) -> Image:
    return Image(
        text_of(stored.name), text_of(stored.media_type), file.bytes_at(stored.offset, stored.size)
    )
