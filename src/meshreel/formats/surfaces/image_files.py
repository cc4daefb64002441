"""Names of images as files, and the folder beside a file that holds them."""

import re
from collections.abc import Sequence
from pathlib import Path

from meshreel.formats.surfaces.image_types import image_ending
from meshreel.materials import Image

NOT_PORTABLE = re.compile(r"[^A-Za-z0-9_-]+")
MAX_LENGTH = 80


def image_names(images: Sequence[Image]) -> list[str]:
    """A file name for each image, as every system allows it, no two alike in any case."""
    taken: set[str] = set()
    counts: dict[str, int] = {}
    names = []
    for image in images:
        stem = NOT_PORTABLE.sub("_", image.name)[:MAX_LENGTH] or "image"
        ending = image_ending(image.mime_type)
        name, wanted = stem + ending, (stem + ending).lower()
        while name.lower() in taken:
            counts[wanted] = counts.get(wanted, 1) + 1
            name = f"{stem}_{counts[wanted]}{ending}"
        taken.add(name.lower())
        names.append(name)
    return names


def image_folder(path: Path) -> Path:
    """The folder of the images of a file that cannot hold them, beside it."""
    return path.with_name(f"{path.stem}_textures")
