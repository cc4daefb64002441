"""Images of a glTF file: their bytes as they are, wherever they are kept."""

import base64
import binascii
import re
from pathlib import PurePosixPath
from urllib.parse import unquote

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.buffers import Buffers
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.named_files import file_beside
from meshreel.formats.surfaces.images import UNKNOWN, image_type
from meshreel.model.materials import Image

DATA_URI = re.compile(r"data:([^,;]{0,100})(?:;[^,]{0,200})?;base64,", re.IGNORECASE)

PACKED = {
    "EXT_texture_webp": "image/webp",
    "EXT_texture_avif": "image/avif",
    "KHR_texture_basisu": "image/ktx2",
    "MSFT_texture_dds": "image/vnd-ms.dds",
}
"""Extensions by which a texture has an image of another kind than PNG and JPEG."""


def image_number(texture: JsonObject, n_images: int) -> int:
    """Which image a texture shows: that of glTF itself, or of an extension if there is no other.

    Raises
    ------
    FormatError
        If it shows none that is known.
    """
    if (source := texture.index("source", n_images)) is not None:
        return source
    for name in PACKED:
        extension = texture.extension(name)
        if extension is not None and (source := extension.index("source", n_images)) is not None:
            return source
    raise FormatError(f"{texture.place}: shows no image")


def read_image(given: JsonObject, buffers: Buffers) -> Image:
    """An image of the file.

    Raises
    ------
    FormatError, InvalidInputError
        If it cannot be had.
    """
    document = buffers.document
    name, told = given.text("name", ""), given.text("mimeType", "")
    view = document.index(given, "bufferView", "bufferViews")
    if view is not None:
        data = bytes(buffers.view(view)[0])
        return Image(name, told or image_type(data), data)
    uri = given.text("uri")
    if match := DATA_URI.match(uri):
        data = _decoded(uri[match.end() :], given)
        found = image_type(data)
        said = match[1].lower() if found == UNKNOWN else found
        return Image(name, told or said or found, data)
    path = file_beside(document, uri, given.place)
    with os_errors_naming(path):
        data = path.read_bytes()
    file_name = PurePosixPath(unquote(uri))
    return Image(name or file_name.stem, told or image_type(data, file_name.name), data)


def _decoded(text: str, given: JsonObject) -> bytes:
    try:
        return base64.b64decode(text)
    except (binascii.Error, ValueError) as error:
        raise FormatError(f"{given.place}: its data is no base64 ({error})") from None
