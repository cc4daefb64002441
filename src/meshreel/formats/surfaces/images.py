"""Image types by signature or file name, and file names for images; nothing is decoded."""

import re
from collections.abc import Sequence
from pathlib import Path, PurePosixPath

from meshreel.model.materials import Image

SIGNATURES = (
    (0, b"\x89PNG\r\n\x1a\n", "image/png"),
    (0, b"\xff\xd8\xff", "image/jpeg"),
    (8, b"WEBP", "image/webp"),
    (0, b"\xabKTX 20\xbb\r\n\x1a\n", "image/ktx2"),
    (0, b"DDS ", "image/vnd-ms.dds"),
    (4, b"ftypavif", "image/avif"),
    (0, b"\x76\x2f\x31\x01", "image/x-exr"),
    (0, b"#?RADIANCE", "image/vnd.radiance"),
    (0, b"GIF8", "image/gif"),
    (0, b"BM", "image/bmp"),
    (0, b"II*\x00", "image/tiff"),
    (0, b"MM\x00*", "image/tiff"),
)
"""Offset and bytes of the signature of each type."""

EXTENSIONS = {
    ".png": "image/png",
    ".jpg": "image/jpeg",
    ".jpeg": "image/jpeg",
    ".webp": "image/webp",
    ".ktx2": "image/ktx2",
    ".dds": "image/vnd-ms.dds",
    ".avif": "image/avif",
    ".exr": "image/x-exr",
    ".hdr": "image/vnd.radiance",
    ".gif": "image/gif",
    ".bmp": "image/bmp",
    ".tif": "image/tiff",
    ".tiff": "image/tiff",
    ".tga": "image/x-tga",
}
UNKNOWN = "application/octet-stream"

NOT_PORTABLE = re.compile(r"[^A-Za-z0-9_-]+")
MAX_LENGTH = 80


def image_type(data: bytes, name: str = "") -> str:
    """Return the MIME type of an image; "application/octet-stream" if it is unknown.

    Parameters
    ----------
    name : str
        File name, for types without a signature.
    """
    for offset, signature, mime_type in SIGNATURES:
        if data[offset : offset + len(signature)] == signature:
            return mime_type
    return EXTENSIONS.get(PurePosixPath(name).suffix.lower(), UNKNOWN)


def image_names(images: Sequence[Image]) -> list[str]:
    """Return portable file names for images, unique even if case is ignored."""
    used: set[str] = set()
    counts: dict[str, int] = {}
    names = []
    for image in images:
        stem = NOT_PORTABLE.sub("_", image.name)[:MAX_LENGTH] or "image"
        extension = next((key for key, mime in EXTENSIONS.items() if mime == image.mime_type), "")
        name, lower_name = stem + extension, (stem + extension).lower()
        while name.lower() in used:
            counts[lower_name] = counts.get(lower_name, 1) + 1
            name = f"{stem}_{counts[lower_name]}{extension}"
        used.add(name.lower())
        names.append(name)
    return names


def image_folder(path: Path) -> Path:
    """Return the folder next to a file for images that the file cannot contain."""
    return path.with_name(f"{path.stem}_textures")
