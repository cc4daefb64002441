"""Names of parts and groups as names that USD allows, all of them different."""

from collections.abc import Sequence

from meshreel.formats.extras import USD

Steps = tuple[str, ...]


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

    That prim is the first step of all names, if they are paths that have it in common; else it is
    called `root`. No mesh is at the path of another or below it.

    Parameters
    ----------
    names : sequence of str
        Paths such as "/root/body", or plain names.
    root : str

    Returns
    -------
    list of str
        Such as "/root/body"; each has two steps or more.
    """
    cleaned = [_steps(name) for name in names]
    firsts = {steps[0] for steps in cleaned}
    if len(firsts) > 1 or any(len(steps) < 2 for steps in cleaned):
        cleaned = [(prim_name(root), *steps) for steps in cleaned]
    above = {steps[:n] for steps in cleaned for n in range(1, len(steps))}
    taken: set[str] = set()
    paths = []
    for steps in cleaned:
        while steps in above:  # meshes must not be below meshes
            steps = (*steps, steps[-1])
        path = different(_path(steps), taken | {_path(one) for one in above})
        taken.add(path)
        paths.append(path)
    return paths


def _steps(name: str) -> Steps:
    return tuple(prim_name(step) for step in name.split("/") if step) or (prim_name(""),)


def _path(steps: Steps) -> str:
    return "/" + "/".join(steps)
