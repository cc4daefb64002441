"""The image or video that the player shows on the mesh."""

from dataclasses import dataclass
from pathlib import Path

from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.formats.file_errors import check_input_file
from meshreel.model.surface import Kind

MEDIA_TYPES = {
    ".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp",
    ".avif": "image/avif", ".mp4": "video/mp4", ".webm": "video/webm", ".mov": "video/quicktime",
}  # fmt: skip
"""Media types of the formats that browsers show, by extension."""


@dataclass(frozen=True)
class Texture:
    """A texture file and its media type."""

    path: Path
    media_type: str

    @property
    def size_bytes(self) -> int:
        """Size of the file."""
        return self.path.stat().st_size

    def read(self, start: int, stop: int) -> bytes:
        """Return bytes start..stop - 1 of the file."""
        with self.path.open("rb") as file:
            file.seek(start)
            return file.read(stop - start)


def texture_for(reel: ReelFile, path: Path) -> Texture:
    """Return the texture in a file, checked against the mesh.

    Raises
    ------
    InvalidInputError
        If the file is missing, browsers cannot show its format, or the mesh has no UVs.
    """
    media_type = MEDIA_TYPES.get(path.suffix.lower())
    if media_type is None:
        raise InvalidInputError(
            f"{path} is not an image or video that browsers show; supported extensions: "
            f"{', '.join(MEDIA_TYPES)}"
        )
    if not path.is_file():
        raise InvalidInputError(f"there is no file {str(path)!r}; check it")
    check_input_file(path)
    if not any(attribute.kind is Kind.UV for attribute in reel.surface.attributes):
        raise InvalidInputError(
            f"the stream has no texture coordinates to map {path.name} to the mesh; encode an "
            "input that has them"
        )
    return Texture(path, media_type)
