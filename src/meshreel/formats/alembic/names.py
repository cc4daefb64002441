"""Valid and unique names and paths for the objects and properties of an Alembic file."""

from collections.abc import Iterable, Sequence

UNNAMED = "mesh"

IN_NAMES, IN_METADATA, IN_TEXTS = "/\0", ";=\0", "\0"
"""Reserved characters of path components, of metadata, and of strings.

The Alembic library aborts the process if the name of texture coordinates contains a reserved
character of metadata.
"""

Path = tuple[str, ...]
"""Names from the root down."""


def clean(text: str, reserved: str) -> str:
    """Return the text with ``_`` in place of reserved characters and lone surrogates."""
    return "".join("_" if one in reserved or "\ud800" <= one <= "\udfff" else one for one in text)


def clean_unique_name(name: str, used: Iterable[str]) -> str:
    """Return the name without slashes, with a number appended if it is in use."""
    return unique_name(clean(name, IN_NAMES) or UNNAMED, used)


def unique_name(name: str, used: Iterable[str]) -> str:
    """Return the name, with a number appended if it is in use."""
    unique, number = name, 1
    while unique in used:
        number += 1
        unique = f"{name}_{number}"
    return unique


def object_paths(names: Sequence[str]) -> list[Path]:
    """Return a path for each part, unique and below at least one transform.

    A part name that is a path becomes the path of its mesh. A path that has a single component,
    or is also the parent of another part, gains a transform of the same name, as in Blender:
    "body" becomes "/body/body".
    """
    requested = [
        tuple(clean(one, IN_NAMES) for one in name.split("/") if one) or (UNNAMED,)
        for name in names
    ]
    transforms = {path[:depth] for path in requested for depth in range(1, len(path))}
    transforms |= {path for path in requested if len(path) == 1}
    used = set(transforms)
    paths = []
    for path in requested:
        placed = (*path, path[-1]) if path in transforms else path
        siblings = {one[-1] for one in used if one[:-1] == placed[:-1]}
        name = clean_unique_name(placed[-1], siblings)
        paths.append((*placed[:-1], name))
        used.add(paths[-1])
    return paths
