"""An image or a video that a page shows on the mesh."""

from dataclasses import dataclass
from pathlib import Path

from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.model.surface import Kind

MEDIA_TYPES = {
    ".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp",
    ".avif": "image/avif", ".mp4": "video/mp4", ".webm": "video/webm", ".mov": "video/quicktime",
}  # fmt: skip
"""Of what browsers show, by extension."""


@dataclass(frozen=True)
class Texture:
    """A file, and its media type."""

    path: Path
    media_type: str


def texture_for(reel: ReelFile, path: Path) -> Texture:
    """A texture for a mesh.

    Raises
    ------
    InvalidInputError
        If browsers show no such files, it is not there, or the mesh has no texture coordinates.
    """
    media_type = MEDIA_TYPES.get(path.suffix.lower())
    if media_type is None:
        raise InvalidInputError(
            f"{path} is no image or video that browsers show; its name must end in one of "
            f"{', '.join(MEDIA_TYPES)}"
        )
    if not path.is_file():
        raise InvalidInputError(f"{path} is not there")
    if not any(one.kind is Kind.UV for one in reel.surface.attributes):
        raise InvalidInputError(
            f"the stream has no texture coordinates, by which {path.name} would lie on the mesh; "
            "encode an input that has them"
        )
    return Texture(path, media_type)
