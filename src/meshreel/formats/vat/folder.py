"""Layouts of vertex animation textures, and writing a folder of their files."""

from pathlib import Path

from meshreel.codec.error_bounds import bound_of
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.axes import BLENDER_FBX_SPACE, GLTF, UNITY, UNREAL
from meshreel.formats.vat.labs import LabsSoft
from meshreel.formats.vat.openvat import OpenVat
from meshreel.formats.vat.plain import write_plain
from meshreel.formats.vat.plain_layout import FileNames, PlainLayout
from meshreel.formats.vat.textures import TexelType
from meshreel.runtime.extras import OPEN_EXR, PNG

TEXEL_TYPES = {
    "exr": (TexelType.HALF, TexelType.FLOAT),
    "png": (TexelType.BITS_8, TexelType.BITS_16),
}
"""Texel types of each ``--textures`` choice, smallest first."""

DEFAULT_TEXTURES = "exr"

DEFAULT_LAYOUT = "openvat"

LAYOUTS: dict[str, PlainLayout] = {
    "openvat": OpenVat(),
    "openvat-unity": OpenVat(BLENDER_FBX_SPACE),
    "labs": LabsSoft(GLTF),
    "labs-unity": LabsSoft(UNITY),
    "labs-unreal": LabsSoft(UNREAL),
}
"""Layouts with one texel per vertex and frame."""


def vat_files(path: Path, options: WriteOptions) -> list[Path]:
    """Return the paths of the files that a folder will contain.

    Raises
    ------
    InvalidInputError
        If the layout, the kind of textures or the error bound is invalid.
    FormatError
        If the library that writes the textures is not installed.
    """
    if options.max_error is not None:
        bound_of(options.max_error)
    kind = options.textures or DEFAULT_TEXTURES
    if kind not in TEXEL_TYPES:
        raise InvalidInputError(
            f"--textures (textures=) must be one of {', '.join(TEXEL_TYPES)}; got {kind!r}"
        )
    names = _names(path.stem, options)
    (PNG if kind == "png" else OPEN_EXR).load()
    used = (names.mesh, names.positions, names.normals, names.data)
    return [path / name for name in used if name is not None]


def write_vat(folder: Path, stem: str, stream: FrameStream, options: WriteOptions) -> None:
    """Write the files of a folder; the notes of the stream gain the errors achieved.

    All frames are loaded into memory.

    Raises
    ------
    InvalidInputError
        If no texture meets the error bound, or it would exceed the texture size of GPUs.
    """
    types = TEXEL_TYPES[options.textures or DEFAULT_TEXTURES]
    write_plain(folder, _names(stem, options), stream, options, _layout(options), types)


def _names(stem: str, options: WriteOptions) -> FileNames:
    extension = TEXEL_TYPES[options.textures or DEFAULT_TEXTURES][0].extension
    return _layout(options).names(stem, extension, normals=options.normals is not False)


def _layout(options: WriteOptions) -> PlainLayout:
    name = options.layout or DEFAULT_LAYOUT
    if name not in LAYOUTS:
        raise InvalidInputError(
            f"--layout (layout=) must be one of {', '.join(LAYOUTS)}; got {name!r}"
        )
    return LAYOUTS[name]
