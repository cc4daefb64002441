"""Re-encoding of the images of materials, as WebP or PNG, and scaled down."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from io import BytesIO
from typing import Any

import numpy as np

from meshreel.codec.image_options import check_images, format_and_quality
from meshreel.errors import InvalidInputError, Keyword
from meshreel.model.colors import to_linear, to_srgb
from meshreel.model.materials import Image
from meshreel.model.notes import Notes, listed
from meshreel.model.surface import Surface
from meshreel.runtime.counting import counted, size_text
from meshreel.runtime.extras import IMAGES

SCALED_JPEG_QUALITY = 92

COLOR_SLOTS = {"base_color", "emissive"}
"""Slots of sRGB colors; the others hold data, which no lossy coder of pictures should see."""

FORMATS = {"image/jpeg": "JPEG", "image/webp": "WEBP"}
"""Formats of Pillow in which scaled images stay; others become PNG."""

READABLE = {f"image/{name}" for name in ("png", "jpeg", "webp", "bmp", "tiff", "gif", "x-tga")}
MODES = {"1", "L", "LA", "P", "PA", "RGB", "RGBA"}
PNG_DEPTH, EXIF_ORIENTATION = 24, 274


def reencode_images(
    surfaces: Iterable[Surface], images: str | None, max_image: int | None, notes: Notes
) -> Callable[[Surface], Surface]:
    """Re-encode the images of all surfaces; return a function that replaces those of a surface.

    Parameters
    ----------
    images, max_image
        As in `meshreel.encode`; if both are None, nothing changes.
    notes : Notes
        Receives the sizes, and the images that stay as they are.

    Raises
    ------
    InvalidInputError
        If there are no images, or as `check_images`.
    """
    if images is None and max_image is None:
        return lambda surface: surface
    check_images(images, max_image)
    slots: dict[Image, set[str]] = {}
    for surface in surfaces:
        for image in surface.images:
            slots.setdefault(image, set())
        for material in surface.materials:
            for slot, texture in material.textures.items():
                slots[surface.images[texture.image]].add(slot)
    if not slots:
        name = "max_image" if images is None else "images"
        raise InvalidInputError("there are no images of materials; omit ", Keyword(name))
    new = {image: image for image in slots}
    kept: dict[str, list[str]] = {}
    for number, (image, used) in enumerate(slots.items()):
        try:
            new[image] = _reencode(image, used, images, max_image)
        except _Kept as reason:
            kept.setdefault(str(reason), []).append(image.name or f"image {number}")
    changed = {old: image for old, image in new.items() if image is not old}
    if changed:
        sizes = (sum(len(image.data) for image in some) for some in (changed, changed.values()))
        has_data = images != "png" and any(slots[image] - COLOR_SLOTS for image in changed)
        lossless = ", those with other values than colors losslessly" if has_data else ""
        types = listed(dict.fromkeys(image.mime_type for image in changed.values()))
        notes.result(
            f"{counted(len(changed), 'image')} re-encoded as {types}{lossless}: "
            f"{' to '.join(map(size_text, sizes))}"
        )
    for why, names in kept.items():
        notes.result(f"images kept as they are: {listed(names)} ({why})")
    return lambda surface: replace(surface, images=tuple(new[image] for image in surface.images))


class _Kept(Exception):  # noqa: N818  the reason why an image stays as it is
    """Why an image stays as it is."""


def _reencode(image: Image, slots: set[str], images: str | None, max_image: int | None) -> Image:
    """Return a smaller image; raises _Kept if there is none."""
    picture, extras = _open(image)
    largest = max(picture.size)
    scaled = picture
    if max_image is not None and largest > max_image:
        sides = (max(1, round(side * max_image / largest)) for side in picture.size)
        scaled = _scaled(picture, (*sides,), slots)
    is_color = bool(slots) and slots <= COLOR_SLOTS
    own = FORMATS.get(image.mime_type, "PNG")
    choices = [(own, SCALED_JPEG_QUALITY if is_color else None)] if scaled is not picture else []
    if images is not None:
        target, quality = format_and_quality(images)
        choices.append((target, quality if is_color else None))
        if target == "PNG" and image.mime_type not in ("image/png", "image/jpeg"):
            return replace(image, **_encoded(scaled, target, None, extras))
    if not choices:
        raise _Kept(f"at most {max_image} pixels wide and high")
    candidates = (_encoded(scaled, *choice, extras) for choice in choices)
    best = min(candidates, key=lambda encoded: len(encoded["data"]))
    if len(best["data"]) >= len(image.data):
        raise _Kept("re-encoding would not make them smaller")
    return replace(image, **best)


def _open(image: Image) -> tuple[Any, dict[str, Any]]:
    """Return a picture in the mode L, RGB or RGBA, and its color profile for saving it."""
    pillow = IMAGES.load("Image")
    if image.mime_type not in READABLE:
        raise _Kept(image.mime_type)
    if image.mime_type == "image/png" and image.data[PNG_DEPTH : PNG_DEPTH + 1] == b"\x10":
        raise _Kept("16 bits per channel")
    try:
        with pillow.open(BytesIO(image.data)) as picture:
            picture.load()
    except (OSError, ValueError, SyntaxError, pillow.DecompressionBombError) as error:
        raise _Kept(f"Pillow cannot read them: {error}") from None
    if picture.mode not in MODES:
        raise _Kept(f"colors of type {picture.mode}")
    if getattr(picture, "n_frames", 1) > 1:
        raise _Kept("animated")
    if picture.getexif().get(EXIF_ORIENTATION, 1) != 1:
        raise _Kept("turned by EXIF")
    profile = picture.info.get("icc_profile")
    opaque = "L" if picture.mode in ("1", "L") else "RGB"
    mode = "RGBA" if picture.has_transparency_data else opaque
    return picture.convert(mode), {"icc_profile": profile} if profile else {}


def _scaled(picture: Any, sides: tuple[int, ...], slots: set[str]) -> Any:
    """Return a picture of this width and height: each channel filtered apart, colors as light."""
    pillow = IMAGES.load("Image")
    curve = np.arange(256) / 255
    if is_color := bool(slots) and slots <= COLOR_SLOTS:
        curve = to_linear(curve[:, None])[:, 0]
    channels = []
    for number, channel in enumerate(picture.split()):
        values = np.asarray(channel) / 255 if number == 3 else curve[np.asarray(channel)]  # opacity
        large = pillow.fromarray(values.astype(np.float32))
        channels.append(np.asarray(large.resize(sides, pillow.Resampling.LANCZOS)))
    values = np.stack(channels, axis=-1).clip(0, 1).astype(np.float64)
    if slots == {"normal"} and len(channels) > 2:
        normals = 2 * values[..., :3] - 1
        length = np.linalg.norm(normals, axis=-1, keepdims=True)
        values[..., :3] = (normals / np.maximum(length, 1e-6) + 1) / 2
    pixels = values.reshape(-1, len(channels))
    pixels = to_srgb(pixels) if is_color else pixels
    flat = np.rint(255 * pixels).astype(np.uint8)
    return pillow.fromarray(flat.reshape(values.shape if len(channels) > 1 else values.shape[:2]))


def _encoded(picture: Any, name: str, quality: int | None, extras: dict[str, Any]) -> Any:
    """Return type and data of a picture in a format; a quality of None is lossless, if possible."""
    buffer = BytesIO()
    settings: dict[str, Any] = {"optimize": True}
    if name == "WEBP":  # `exact` keeps colors where the opacity, which a material may ignore, is 0
        is_lossless = quality is None
        settings = {"lossless": is_lossless, "quality": quality or 80, "exact": True}
        settings["method"] = 4 if is_lossless else 6
    elif name == "JPEG":
        settings |= {"quality": quality or 95, "subsampling": 2 if quality else 0}
    try:
        picture.save(buffer, name, **settings, **extras)
    except (OSError, ValueError, KeyError) as error:
        raise _Kept(f"Pillow cannot write them: {error}") from None
    return {"mime_type": f"image/{name.lower()}", "data": buffer.getvalue()}
