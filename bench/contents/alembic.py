"""Contents of Alembic files, from the property tree of the Alembic library."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contents.items import Item, Sort

EXTENSIONS = (".abc",)
BOOKKEEPING = {
    ".selfBnds", ".childBnds", ".facesExclusive", ".faceIndices", ".faceCounts", ".faces",
    "statistics", "visible", "meshreel:computed", "meshreel:attributes",
}  # fmt: skip
"""Properties that are computed, or items of objects."""
MESHES = ("AbcGeom_PolyMesh", "AbcGeom_SubD")
PARAMS = ".arbGeomParams"


def walk(path: Path) -> Iterator[Item]:
    """Yield what a file holds; with numbers if it has a single mesh without transforms."""
    from alembic3d import Abc

    top = Abc.IArchive(str(path)).getTop()
    objects = list(_objects(top))
    meshes = [lineage for lineage in objects if _schema(lineage[-1]) in MESHES]
    shown = [mesh for mesh in meshes if not _is_hidden(mesh)] or meshes
    carriers = {item.getFullName() for mesh in shown for item in mesh}
    is_plain = len(meshes) == 1 and len(shown[0]) == 1
    yield from _items(top, is_mesh=False, is_plain=False)
    for *above, item in objects:
        name, schema = item.getFullName(), _schema(item)
        is_face_set = schema == "AbcGeom_FaceSet" and above and _schema(above[-1]) in MESHES
        if name in carriers:
            if schema in MESHES and len(shown) > 1:
                yield Item(Sort.GROUP, name, words=("parts",))
        elif is_face_set and above[-1].getFullName() in carriers:
            yield Item(Sort.GROUP, item.getName())
        else:
            yield from [Item(Sort.OTHER, name)] * (schema in MESHES or not item.getNumChildren())
            continue
        yield from _items(item, is_mesh=schema in MESHES, is_plain=is_plain)


def _objects(parent: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Yield each object below a parent, after those above it."""
    for number in range(parent.getNumChildren()):
        yield (lineage := (*above, parent.getChild(number)))
        yield from _objects(lineage[-1], lineage)


def _is_hidden(lineage: tuple[Any, ...]) -> bool:
    """Return whether its own state is always hidden or, if that is deferred, that of the next."""
    for item in reversed(lineage):
        header = item.getProperties().getPropertyHeader("visible")
        states = (
            {*map(int, _samples(item.getProperties(), header))} if header is not None else set()
        )
        if states - {-1}:
            return states == {0}
    return False


def _schema(item: Any) -> str:
    return str(item.getMetaData().get("schema")).rpartition("_v")[0]


def _opened(parent: Any, header: Any) -> Any:
    from alembic3d import Abc

    kind = Abc.IArrayProperty if header.isArray() else Abc.IScalarProperty
    return kind(parent, header.getName())


def _samples(parent: Any, header: Any) -> Iterator[Any]:
    values = _opened(parent, header)
    return (values.getValue(index) for index in range(values.getNumSamples()))


def _leaves(parent: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, tuple[Any, ...]]]:
    """Yield the compound above each property with values, and the headers from the outermost."""
    from alembic3d import Abc

    for number in range(parent.getNumProperties()):
        header = parent.getPropertyHeader(number)
        if header.isCompound():
            inner = Abc.ICompoundProperty(parent, header.getName())
            yield from _leaves(inner, (*above, header))
        elif any(not header.isArray() or len(value) for value in _samples(parent, header)):
            yield parent, (*above, header)


def _items(item: Any, *, is_mesh: bool, is_plain: bool) -> Iterator[Item]:
    """Yield the items of the properties of an object."""
    leaves = list(_leaves(item.getProperties()))
    is_computed = any(headers[-1].getName() == "meshreel:computed" for _, headers in leaves)
    for parent, headers in leaves:
        names = [header.getName() for header in headers]
        values, is_param = _opened(parent, headers[-1]), PARAMS in names or "uv" in names
        is_values = parent.getPropertyHeader(".vals") is not None and names[0] != ".xform"
        if names == ["visible"] and len({*map(int, _samples(parent, headers[-1]))}) > 1:
            yield Item(Sort.VISIBILITY, "visibility", words=("hidden meshes", "visible in turn"))
        if (is_mesh and names[-1] == "P") or names == [".xform", ".vals"]:
            sampling, n_samples = values.getTimeSampling(), values.getNumSamples()
            times = [sampling.getSampleTime(index) for index in range(n_samples)]
            is_animated = n_samples > 1 and not values.isConstant()
            yield from [Item(Sort.TIMES, "times", times if is_plain else None)] * is_animated
        if is_mesh and names[-1] == ".faceCounts":
            n_faces = len(values.getValue(0)) if is_plain and values.isConstant() else None
            yield Item(Sort.FACES, item.getFullName(), n_faces)
        is_structure = names[:-1] == [".xform"] or names[-1].endswith(".samples")
        is_structure |= (is_values and names[-1] == ".indices") or names[-1] in BOOKKEEPING
        if (is_param and not (is_values and names[-1] == ".indices")) or not is_structure:
            param = headers[-2] if is_values else headers[-1]
            name = param.getName().lstrip(".")
            sort = Sort.UV if "uv" in names else Sort.DATA
            sort = Sort.POSITIONS if is_mesh and name == "P" and not is_param else sort
            if is_mesh and name == "N" and not is_param and (values.isConstant() or is_computed):
                sort = Sort.EDGES
            yield from _values(parent, headers[-1], param, name, sort, is_plain=is_plain)


def _values(
    parent: Any, header: Any, param: Any, name: str, sort: Sort, *, is_plain: bool
) -> Iterator[Item]:
    """Yield values, which may be within the compound of a parameter; text as labels of groups."""
    metadata, is_text = param.getMetaData(), "string" in str(header.getDataType())
    title = metadata.get("sourceName") or name
    if is_text and metadata.get("geoScope") == "uni":
        labels = {text for values in _samples(parent, header) for text in values}
        yield from (Item(Sort.GROUP, label, words=(name,)) for label in labels if label)
        return
    if unit := metadata.get("unit"):
        yield Item(Sort.UNIT, f"{title}:{unit}", words=("units",))
    is_color = header.getMetaData().get("interpretation") in ("rgb", "rgba")
    is_pair = header.getDataType().getExtent() == 2 and "float" in str(header.getDataType())
    if sort is Sort.DATA and (is_color or is_pair):
        sort = Sort.COLOR if is_color else Sort.UV
    is_known = is_plain and not is_text and sort is not Sort.COLOR
    numbers = [np.ravel(np.array(value)) for value in _samples(parent, header)]
    values = np.concatenate(numbers) if is_known else None
    yield Item(sort, title, values, (name, "normals" if name == "N" else ""))
