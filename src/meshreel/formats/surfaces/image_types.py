"""What an image is, by its first bytes or its name; nothing is decoded."""

from pathlib import PurePosixPath

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
"""Where which bytes are in files of which type."""

ENDINGS = {
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


def image_type(data: bytes, name: str = "") -> str:
    """The MIME type of an image; "application/octet-stream" if nothing tells.

    Parameters
    ----------
    data : bytes
    name : str
        Of its file, for types that do not show in the bytes.
    """
    for place, signature, mime_type in SIGNATURES:
        if data[place : place + len(signature)] == signature:
            return mime_type
    return ENDINGS.get(PurePosixPath(name).suffix.lower(), UNKNOWN)


def image_ending(mime_type: str) -> str:
    """The ending of files of a type, with the dot; empty if none is known."""
    return next((ending for ending, one in ENDINGS.items() if one == mime_type), "")
