"""Options of the images of materials, which encoding and saving share."""

from meshreel.codec.option import COUNT, Option, Range
from meshreel.errors import InvalidInputError, Keyword
from meshreel.runtime.extras import IMAGES

DEFAULT_QUALITY, QUALITIES = 80, Range(1, 100, is_whole=True)

IMAGES_OPTION = Option(
    "Re-encode the images of materials: webp[:QUALITY], 1 to 100, default "
    f"{DEFAULT_QUALITY}, for colors, while other maps (normals, roughness, ...) stay lossless; "
    "webp:lossless; or png, for programs that do not read WebP (needs [images]).",
    metavar="FORMAT",
    more="Opacity is kept exactly. An image that would become larger stays as it is; so do those "
    "of 16 bits per channel, and textures of the graphics card (KTX2, DDS). Only images of "
    "materials in ``.reel``, glTF and USD.",
)
MAX_IMAGE_OPTION = Option(
    "Scale images of materials down so that their longer side has at most this many pixels "
    "(needs [images]).",
    range=COUNT,
    metavar="PIXELS",
    more="Colors are averaged as light, and normals have unit length again.",
)


def check_images(images: str | None, max_image: int | None) -> None:
    """Raise InvalidInputError if an option is invalid, or Pillow, which they need, is missing."""
    if images is not None:
        format_and_quality(images)
    MAX_IMAGE_OPTION.of_field("max_image", int | None, None).check(max_image)
    if images is not None or max_image is not None:
        IMAGES.load()


def format_and_quality(images: str) -> tuple[str, int | None]:
    """Return the format of Pillow, and the quality of colors; None if they are lossless."""
    name, colon, quality = str(images).partition(":")
    if images == "png":
        return "PNG", None
    if images in ("webp", "webp:lossless"):
        return "WEBP", None if colon else DEFAULT_QUALITY
    if name == "webp" and quality.isdecimal() and int(quality) in QUALITIES:
        return "WEBP", int(quality)
    raise InvalidInputError(
        Keyword("images"),
        f" must be webp, webp:QUALITY with a quality of {QUALITIES.words}, webp:lossless or png; "
        f"got {images!r}",
    )
