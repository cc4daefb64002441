"""Where parts of a mesh lie in the hierarchy of an Alembic file."""

from collections.abc import Sequence

from meshreel.formats.alembic.names import IN_NAMES, UNNAMED, clean, unused_name

Path = tuple[str, ...]
"""Names from the top down."""


def object_paths(names: Sequence[str]) -> list[Path]:
    """The path of each part, different from all others and below at least one transform.

    A part whose name is a path lies there. Where that is at the top, or other parts lie below it,
    it goes into a transform of its own name, as Blender has it: "body" is "/body/body".
    """
    wanted = [
        tuple(clean(one, IN_NAMES) for one in name.split("/") if one) or (UNNAMED,)
        for name in names
    ]
    transforms = {path[:depth] for path in wanted for depth in range(1, len(path))}
    transforms |= {path for path in wanted if len(path) == 1}
    taken = set(transforms)
    paths = []
    for path in wanted:
        placed = (*path, path[-1]) if path in transforms else path
        name = unused_name(placed[-1], {one[-1] for one in taken if one[:-1] == placed[:-1]})
        paths.append((*placed[:-1], name))
        taken.add(paths[-1])
    return paths
