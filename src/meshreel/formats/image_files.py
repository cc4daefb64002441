"""Names of images as files, and the folder beside a file that holds them."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from meshreel.errors import InvalidInputError
from meshreel.formats.image_types import image_ending
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


def check_image_paths(paths: Sequence[Path], *, overwrite: bool) -> None:
    """Refuse image files that must not be written, before any work is done.

    Raises
    ------
    InvalidInputError
        If one is there already and `overwrite` is false, or something is in the way.
    """
    for path in paths:
        if path.parent.exists() and not path.parent.is_dir():
            raise InvalidInputError(f"{path.parent} must be a folder for images; it is a file")
        if path.is_dir():
            raise InvalidInputError(f"{path} is a folder; an image is to have that name")
        if path.exists() and not overwrite:
            raise InvalidInputError(f"{path} exists and is kept; use --force (overwrite=True)")


@contextmanager
def folder_when_done(folder: Path) -> Iterator[None]:
    """Within it, the folder is there; if it was not before, it is gone again on an error."""
    is_new = not folder.exists()
    folder.mkdir(exist_ok=True)
    try:
        yield
    except BaseException:
        if is_new:
            folder.rmdir()
        raise
