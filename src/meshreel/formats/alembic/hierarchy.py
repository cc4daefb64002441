"""The objects of an Alembic file, each with the transforms above it."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from meshreel.errors import FormatError
from meshreel.formats.alembic.archive import AbcObject, Archive
from meshreel.formats.alembic.ogawa import damaged
from meshreel.formats.alembic.transforms import Transform

MAX_OBJECTS, MAX_DEPTH = 100_000, 256
"""Instances of instances can make any number of objects of a small file."""

POLYGONS, SUBDIVISION, TRANSFORM = "AbcGeom_PolyMesh", "AbcGeom_SubD", "AbcGeom_Xform"
OTHERS = {
    "AbcGeom_Camera": "cameras",
    "AbcGeom_Curve": "curves",
    "AbcGeom_Light": "lights",
    "AbcGeom_NuPatch": "NURBS patches",
    "AbcGeom_Points": "point clouds",
    "AbcMaterial_Material": "materials",
}
"""Kinds of objects, by their schema without its version."""


@dataclass(frozen=True, eq=False)
class Node:
    """An object in its place; several may be instances of one object.

    Attributes
    ----------
    path : str
        Names from the top, such as "/root/body".
    schema : str
        What it is, without the version: "AbcGeom_PolyMesh".
    object : AbcObject
    chain : tuple of Transform
        The transforms above it, the outermost first.
    """

    path: str
    schema: str
    object: AbcObject
    chain: tuple[Transform, ...]


def walk(archive: Archive) -> Iterator[Node]:
    """Every object of a file, in its order; what an instance stands for once for each.

    Raises
    ------
    FormatError
        If two objects have one path, an instance stands for what is not there, or for itself, or
        there are too many.
    """
    seen: set[str] = set()
    top = Node("", "", archive.top, ())
    waiting = [(one, top, frozenset({archive.top.reference})) for one in _below(archive.top)]
    while waiting:
        child, parent, above = waiting.pop()
        path = f"{parent.path}/{child.header.name}"
        if path in seen:
            raise damaged(f"it has two objects {path}")
        seen.add(path)
        if len(seen) > MAX_OBJECTS:
            raise FormatError(f"holds more than {MAX_OBJECTS} objects; export fewer of them")
        found = _source(archive, child, path) if child.header.is_instance else child
        if found.reference in above:
            raise damaged(f"{path} is below itself")
        if len(above) > MAX_DEPTH:
            raise FormatError(f"has {path} below more than {MAX_DEPTH} objects; export it flatter")
        node = Node(path, _kind(found), found, parent.chain)
        yield node
        if node.schema == TRANSFORM and ".xform" in found.properties:
            transform = Transform(found.properties[".xform"].properties)
            node = Node(path, node.schema, found, (*parent.chain, transform))
        waiting += [(one, node, above | {found.reference}) for one in _below(found)]


def describe_contents(nodes: Sequence[Node]) -> str:
    """The objects of a file without a mesh, in words: "cameras (2), curves (1)"."""
    counts = Counter(OTHERS[node.schema] for node in nodes if node.schema in OTHERS)
    listed = [f"{what} ({count})" for what, count in sorted(counts.items())]
    return ", ".join(listed) or ("only transforms" if nodes else "no objects")


def _below(found: AbcObject) -> list[AbcObject]:
    return found.children[::-1]


def _kind(found: AbcObject) -> str:
    return found.header.schema.rpartition("_v")[0]


def _source(archive: Archive, instance: AbcObject, path: str) -> AbcObject:
    """The object that an instance stands for."""
    named = instance.properties.get(".instanceSource")
    wanted = "".join(named.texts()[:1]) if named is not None else ""
    source: AbcObject | None = archive.top
    for name in wanted.strip("/").split("/"):
        children = source.children if source is not None else []
        source = next((one for one in children if one.header.name == name), None)
    if source is None or source.header.is_instance:
        raise damaged(f"{path} is an instance of {wanted!r}, which is not there")
    return source
