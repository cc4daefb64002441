"""Names of parts and groups as names that USD allows, all of them different."""

from collections.abc import Sequence

from meshreel.formats.extras import USD

Elements = tuple[str, ...]


def prim_name(name: str) -> str:
    """The name with ``_`` in place of what USD does not allow in one, and never empty."""
    is_allowed = USD.load("Sdf").Path.IsValidIdentifier
    cleaned = "".join(char if is_allowed(f"_{char}") else "_" for char in name) or "mesh"
    return cleaned if is_allowed(cleaned) else f"_{cleaned}"


def different(name: str, taken: set[str]) -> str:
    """The name, with a number behind it if it is taken already; it is taken then."""
    found, number = name, 2
    while found in taken:
        found, number = f"{name}_{number}", number + 1
    taken.add(found)
    return found


def mesh_paths(names: Sequence[str], root: str) -> list[str]:
    """Where the meshes of a file go, in order, all under one prim.

    That prim is the first element of all names, if they are paths that have it in common; else it
    is called `root`. No mesh is at the path of another or below it.

    Parameters
    ----------
    names : sequence of str
        Paths such as "/root/body", or plain names.

    Returns
    -------
    list of str
        Such as "/root/body"; each has two elements or more.
    """
    cleaned = [_elements(name) for name in names]
    firsts = {elements[0] for elements in cleaned}
    if len(firsts) > 1 or any(len(elements) < 2 for elements in cleaned):
        cleaned = [(prim_name(root), *elements) for elements in cleaned]
    above = {elements[:n] for elements in cleaned for n in range(1, len(elements))}
    taken: set[str] = set()
    paths = []
    for elements in cleaned:
        while elements in above:  # meshes must not be below meshes
            elements = (*elements, elements[-1])
        path = different(_path(elements), taken | {_path(one) for one in above})
        taken.add(path)
        paths.append(path)
    return paths


def _elements(name: str) -> Elements:
    return tuple(prim_name(element) for element in name.split("/") if element) or (prim_name(""),)


def _path(elements: Elements) -> str:
    return "/" + "/".join(elements)
