"""Paths of the parts of a mesh in the hierarchy of an Alembic file."""

from collections.abc import Sequence

from meshreel.formats.alembic.names import IN_NAMES, UNNAMED, clean, clean_unique_name

Path = tuple[str, ...]
"""Names from the root down."""


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
