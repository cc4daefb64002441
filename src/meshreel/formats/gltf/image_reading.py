"""Reading images of a glTF file as unchanged bytes, from buffers, data URIs or files."""

import base64
import binascii
import re
from pathlib import PurePosixPath
from urllib.parse import unquote

from meshreel.errors import FormatError
from meshreel.formats.file_errors import os_errors_naming
from meshreel.formats.gltf.buffers import Buffers
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.named_files import referenced_file
from meshreel.formats.surfaces.images import UNKNOWN, image_type
from meshreel.model.materials import Image

DATA_URI = re.compile(r"data:([^,;]{0,100})(?:;[^,]{0,200})?;base64,", re.IGNORECASE)

IMAGE_EXTENSIONS = {
    "EXT_texture_webp": "image/webp",
    "EXT_texture_avif": "image/avif",
    "KHR_texture_basisu": "image/ktx2",
    "MSFT_texture_dds": "image/vnd-ms.dds",
}
"""Extensions with images of types other than PNG and JPEG, and their media types."""


def image_index(texture: JsonObject, n_images: int) -> int:
    """Return the image of a texture: that of the core specification, or else of an extension.

    Raises
    ------
    FormatError
        If it has no supported image.
    """
    if (source := texture.index("source", n_images)) is not None:
        return source
    for name in IMAGE_EXTENSIONS:
        extension = texture.extension(name)
        if extension is not None and (source := extension.index("source", n_images)) is not None:
            return source
    raise FormatError(f"{texture.place}: has no supported image")


def read_image(image: JsonObject, buffers: Buffers) -> Image:
    """Return an image of the file.

    Raises
    ------
    FormatError, InvalidInputError
        If it cannot be read.
    """
    document = buffers.document
    name, declared = image.text("name", ""), image.text("mimeType", "")
    view = document.index(image, "bufferView", "bufferViews")
    if view is not None:
        data = bytes(buffers.view(view)[0])
        return Image(name, declared or image_type(data), data)
    uri = image.text("uri")
    if match := DATA_URI.match(uri):
        data = _decode_base64(uri[match.end() :], image)
        detected = image_type(data)
        mime_type = match[1].lower() if detected == UNKNOWN else detected
        return Image(name, declared or mime_type or detected, data)
    path = referenced_file(document, uri, image.place)
    with os_errors_naming(path):
        data = path.read_bytes()
    file_name = PurePosixPath(unquote(uri))
    return Image(name or file_name.stem, declared or image_type(data, file_name.name), data)


def _decode_base64(text: str, image: JsonObject) -> bytes:
    try:
        return base64.b64decode(text)
    except (binascii.Error, ValueError) as error:
        raise FormatError(f"{image.place}: its data are not valid base64 ({error})") from None
