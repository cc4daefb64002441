"""Valid and unique USD names and paths for parts and groups."""

from collections.abc import Sequence

from meshreel.runtime.extras import USD

Elements = tuple[str, ...]


def prim_name(name: str) -> str:
    """Return the name with ``_`` in place of characters that USD forbids; never empty."""
    is_allowed = USD.load("Sdf").Path.IsValidIdentifier
    cleaned = "".join(char if is_allowed(f"_{char}") else "_" for char in name) or "mesh"
    return cleaned if is_allowed(cleaned) else f"_{cleaned}"


def unique_name(name: str, used: set[str]) -> str:
    """Return the name, with a number appended if it is in use, and add it to `used`."""
    unique, number = name, 2
    while unique in used:
        unique, number = f"{name}_{number}", number + 1
    used.add(unique)
    return unique


def mesh_paths(names: Sequence[str], root: str) -> list[str]:
    """Return the paths of the meshes of a file, in order, all below one prim.

    That prim is the first element of all names, if they share it, and otherwise `root`. No mesh is
    at or below the path of another.

    Parameters
    ----------
    names : sequence of str
        Paths such as "/root/body", or plain names.

    Returns
    -------
    list of str
        Paths such as "/root/body", with at least two elements.
    """
    cleaned = [_elements(name) for name in names]
    firsts = {elements[0] for elements in cleaned}
    if len(firsts) > 1 or any(len(elements) < 2 for elements in cleaned):
        cleaned = [(prim_name(root), *elements) for elements in cleaned]
    ancestors = {elements[:n] for elements in cleaned for n in range(1, len(elements))}
    used: set[str] = set()
    paths = []
    for elements in cleaned:
        while elements in ancestors:  # meshes must not be below meshes
            elements = (*elements, elements[-1])
        path = unique_name(_path(elements), used | {_path(one) for one in ancestors})
        used.add(path)
        paths.append(path)
    return paths


def _elements(name: str) -> Elements:
    return tuple(prim_name(element) for element in name.split("/") if element) or (prim_name(""),)


def _path(elements: Elements) -> str:
    return "/" + "/".join(elements)
