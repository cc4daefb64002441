"""Contents of CGNS files by h5py, and of OpenFOAM and Fluent cases by their text."""

import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contents.items import Item, Sort, merged, timed

EXTENSIONS = (".cgns", ".foam", ".cas")
STRUCTURE = {
    "CGNSLibraryVersion_t", "CGNSBase_t", "Zone_t", "ZoneType_t", "GridCoordinates_t", "Elements_t",
    "FlowSolution_t", "GridLocation_t", "IndexRange_t", "BaseIterativeData_t", "ZoneBC_t",
    "ZoneIterativeData_t", "ZoneGridConnectivity_t", '"int[IndexDimension]"', "Rind_t",
    "DataClass_t",
}  # fmt: skip
"""Labels of nodes of CGNS that hold no values of their own."""
LISTS = ("Elements_t", "BaseIterativeData_t", "ZoneIterativeData_t")


def walk(path: Path) -> Iterator[Item]:
    """Yield the contents of a file or case."""
    walks = {".cgns": walk_cgns, ".foam": walk_foam, ".cas": walk_fluent}
    yield from merged(walks[path.suffix.lower()](path))


def walk_cgns(path: Path) -> Iterator[Item]:
    """Yield zones, arrays and other nodes; components of a vector are one item."""
    import h5py

    nodes: list[tuple[list[str], str, Any]] = []

    def visit(name: str, node: Any) -> None:
        label = bytes(node.attrs.get("label", b"")).partition(b"\0")[0].decode()
        if label:
            nodes.append((name.split("/"), label, node[" data"][()] if " data" in node else None))

    with h5py.File(path, "r") as file:
        file.visititems(visit)
    labels = {"/".join(names): label for names, label, _ in nodes}
    arrays: dict[tuple[str, str], dict[str, Any]] = defaultdict(dict)
    for names, label, values in nodes:
        above = "/".join(names[:-1])
        kind = labels.get(above, "")
        if label == "Zone_t":
            yield Item(Sort.GROUP, names[-1])
        elif names[-1] == "TimeValues":
            yield from timed(values)
        elif label == "DataArray_t" and kind in ("FlowSolution_t", "GridCoordinates_t"):
            stem = re.sub("_?[XYZxyz]$", "", names[-1])
            arrays[above, stem][names[-1]] = values
        elif label not in STRUCTURE and kind in STRUCTURE and kind not in LISTS:
            yield Item(Sort.OTHER, names[-1])
    pointers = [values for names, _, values in nodes if names[-1] == "FlowSolutionPointers"]
    used = b" ".join(values.tobytes() for values in pointers).decode("latin-1").split()
    for (above, stem), columns in arrays.items():
        is_position, solution = labels[above] == "GridCoordinates_t", above.rpartition("/")[2]
        if used and not is_position and solution not in used:
            yield Item(Sort.OTHER, solution)
            continue
        values = [np.ravel(column) for _, column in sorted(columns.items())]
        values += [np.zeros_like(values[0])] * (len(values) == 2)
        if is_position or len(values) == 3:
            rows = np.stack(values, axis=1)
            yield Item(Sort.POSITIONS if is_position else Sort.DATA, stem, rows)
        else:
            yield from (Item(Sort.DATA, name, np.ravel(column)) for name, column in columns.items())


def walk_foam(path: Path) -> Iterator[Item]:
    """Yield patches, zones, and the fields of all times; binary and packed values by name only."""
    folder = path.parent
    meshes = sorted(folder.glob("constant/**/polyMesh"))
    for mesh in meshes:
        for name in ("boundary", "cellZones", "faceZones", "pointZones", "sets/*"):
            for file in mesh.glob(name):
                names = re.findall(r"([\w.:-]+)\s*\{[^{}]*type", _body(file))
                sets = name == "sets/*"
                yield from (Item(Sort.OTHER, label) for label in ([file.name] if sets else names))
        if len(meshes) == 1:
            points = _numbers(_body(mesh / "points"), 3)
            yield Item(Sort.POSITIONS, "points", points)
            owner = re.search(r"nCells:\s*(\d+)", (mesh / "owner").read_text("latin-1"))
            yield from [Item(Sort.FACES, "cells", int(owner[1]))] if owner else []
    steps = {}
    for step in folder.iterdir():
        if step.is_dir() and re.fullmatch(r"[\d.]+(e-?\d+)?", step.name):
            steps[float(step.name)] = step
    yield from timed(sorted(steps))
    for step in steps.values():
        for file in sorted(filter(Path.is_file, step.rglob("*"))):
            head = file.read_bytes()[:2000].decode("latin-1")
            kind = re.search(r"class\s+(\w+)\s*;", head)
            if kind is None or "polyMesh" in file.parts:
                continue
            size = {"Scalar": 1, "Vector": 3, "SymmTensor": 6, "Tensor": 9}
            match = re.fullmatch("vol(Scalar|Vector|SymmTensor|Tensor)Field", kind[1])
            if match is None:
                yield Item(Sort.OTHER, file.name)
                continue
            inner = re.search(r"internalField\s+(\w+)([^;]*);", _body(file), re.DOTALL)
            values = _numbers(inner[2], size[match[1]]) if inner else None
            yield Item(Sort.DATA, file.name, None if match[1] == "SymmTensor" else values)


def walk_fluent(path: Path) -> Iterator[Item]:
    """Yield the zones and the nodes of an ASCII case."""
    text = path.read_bytes().decode("latin-1")
    for kind, name in re.findall(r"\(\s*(?:39|45)\s*\(\s*\d+\s+(\S+)\s+(\S+?)\s*\)", text):
        yield Item(Sort.GROUP if kind in ("fluid", "solid") else Sort.OTHER, name)
    sections = re.findall(r"\(\s*10\s*\(\s*[1-9a-f][^()]*\)\s*\(([^()]*)\)", text)
    points = [_numbers(section, 3) for section in sections]
    if points and all(part is not None for part in points):
        yield Item(Sort.POSITIONS, "nodes", np.concatenate(points))


def _body(file: Path) -> str:
    """Return the text of a file of OpenFOAM without comments and header."""
    text = re.sub(r"/\*.*?\*/|//[^\n]*", "", file.read_text("latin-1"), flags=re.DOTALL)
    return re.sub(r"FoamFile\s*\{[^}]*\}", "", text, count=1)


def _numbers(text: str, width: int) -> Any:
    """Return rows of numbers, or None if they are not text."""
    if counted := re.search(r"(?:^|>)\s*\d+\s*\(", text):
        text = text[counted.end() :]
    try:
        words = re.sub("[()]", " ", text).split()
        return np.array(words, float).reshape(-1, width)
    except ValueError:
        return None
