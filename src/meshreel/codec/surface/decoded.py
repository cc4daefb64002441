"""The surface of a file, from the structures of `core/include/meshreel.h`."""

import ctypes

import numpy as np

from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, DOMAINS, FILTERS, KINDS, WRAPS
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.files import NUMBER_TYPES, OpenFile, Text, array_at, fields_of
from meshreel.model.materials import SLOTS, Image, Material, Texture
from meshreel.model.surface import Attribute, FaceGroups, Part, Surface

NO_IMAGE = 2**32 - 1
FILTERS_OR_ANY = (None, *FILTERS)

_U32, _U64, _POINTER, _DOUBLE = (
    ctypes.c_uint32,
    ctypes.c_uint64,
    ctypes.c_void_p,
    ctypes.c_double,
)


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
        ("face_sizes", _POINTER),
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
    found = _Surface.from_address(file.surface_address())
    info = file.info
    sizes = None
    if found.face_sizes:
        sizes = array_at(found.face_sizes, info.n_faces, np.int32)
    hard_edges = None
    if found.n_hard_edges:
        hard_edges = array_at(found.hard_edges, 2 * found.n_hard_edges, np.int32).reshape(-1, 2)
    surface = Surface(
        sizes,
        tuple(_attribute(found.attributes[i]) for i in range(found.n_attributes)),
        tuple(_groups(found.groups[i], info.n_faces) for i in range(found.n_groups)),
        tuple(
            Part(str(one.name), one.n_verts, one.n_faces)
            for one in (found.parts[i] for i in range(found.n_parts))
        ),
        tuple(_material(found.materials[i]) for i in range(found.n_materials)),
        tuple(_image(found.images[i], file) for i in range(found.n_images)),
        hard_edges,
    )
    try:
        return surface.validated(info.n_verts, info.n_triangles)
    except InvalidInputError as error:
        raise CorruptStreamError(f"the surface does not fit the mesh: {error}") from error


def _attribute(found: _Attribute) -> Attribute:
    dtype = NUMBER_TYPES[found.type]
    values = array_at(found.values, found.n_rows * found.width, dtype).reshape(-1, found.width)
    rows = array_at(found.rows, found.n_items, np.int32) if found.rows else None
    if rows is not None and not found.is_indexed:
        values, rows = values[rows], None
    return Attribute(str(found.name), KINDS[found.kind], DOMAINS[found.domain], values, rows)


def _groups(found: _Groups, n_faces: int) -> FaceGroups:
    labels = tuple(str(found.labels[i]) for i in range(found.n_labels))
    return FaceGroups(str(found.name), labels, array_at(found.of_faces, n_faces, np.int32))


def _material(found: _Material) -> Material:
    textures = {
        slot: _texture(one)
        for slot, one in zip(SLOTS, found.textures, strict=True)
        if one.image != NO_IMAGE
    }
    return Material(
        str(found.name),
        tuple(found.base_color),
        found.metallic,
        found.roughness,
        tuple(found.emissive),
        found.normal_scale,
        found.occlusion_strength,
        ALPHA_MODES[found.alpha_mode],
        found.alpha_cutoff,
        bool(found.is_double_sided),
        bool(found.is_unlit),
    ).with_textures(textures)


def _texture(found: _Texture) -> Texture:
    return Texture(
        found.image,
        str(found.uv),
        "".join(letter for bit, letter in enumerate(CHANNELS) if found.channels >> bit & 1),
        WRAPS[found.wrap_u],
        WRAPS[found.wrap_v],
        FILTERS_OR_ANY[found.magnified],
        FILTERS_OR_ANY[found.shrunk],
        tuple(found.offset),
        found.rotation,
        tuple(found.scale),
    )


def _image(found: _Image, file: OpenFile) -> Image:
    return Image(str(found.name), str(found.media_type), file.bytes_at(found.offset, found.size))
