"""Contents of EnSight Gold cases, by their text and VTK, and of d3plot files, by control words."""

import re
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from contents.items import Item, Sort

EXTENSIONS = (".case", ".encas", ".d3plot")

CONTROL = {
    "nodes": 16, "global results": 18, "temperature": 19, "velocity": 21, "acceleration": 22,
    "solids": 23, "beams": 28, "shells": 31, "thick shells": 40, "SPH particles": 37,
    "user numbers": 39,
}  # fmt: skip
"""Control words of a d3plot by what they count or switch on."""


def walk(path: Path) -> Iterator[Item]:
    """Yield the contents of a case, or of a family of d3plot files."""
    return walk_d3plot(path) if "d3plot" in path.name.lower() else walk_ensight(path)


def walk_d3plot(path: Path) -> Iterator[Item]:
    """Yield nodes, elements and results that the control words announce."""
    data = path.read_bytes()
    code = next(
        code
        for code in ("<i", ">i", "<q", ">q")
        if struct.unpack_from(code, data, 11 * struct.calcsize(code))[0] in (1, 5, 1001, 1005)
    )
    size = struct.calcsize(code)
    words = np.frombuffer(data, f"{code[0]}i{size}", 64)
    counts = {name: int(words[index]) for name, index in CONTROL.items()}
    start = size * (64 + int(words[57]))
    if words[15] == 4:
        points = np.frombuffer(data, f"{code[0]}f{size}", 3 * counts["nodes"], start)
        is_fixed = words[20] == 0  # otherwise states have positions
        yield Item(Sort.POSITIONS, "nodes", points if is_fixed else None)
    elements = sum(abs(counts[name]) for name in ("solids", "shells", "thick shells"))
    has_cells = counts["solids"] or counts["thick shells"]
    yield Item(Sort.FACES, "elements", elements if has_cells or counts["shells"] else None)
    for name in ("velocity", "acceleration"):
        yield from [Item(Sort.DATA, name)] * bool(counts[name])
    yield from [Item(Sort.DATA, "temperature")] * (counts["temperature"] % 10 in (1, 2))
    yield from [Item(Sort.DATA, "mass_scaling")] * (counts["temperature"] // 10 == 1)
    for name in ("beams", "SPH particles", "user numbers", "global results"):
        yield from [Item(Sort.OTHER, name)] * (counts[name] > 0)
    if counts["shells"] and words[33]:
        yield from [Item(Sort.DATA, "stress")] * bool(words[43] == 1000)
        yield from [Item(Sort.DATA, "plastic_strain")] * bool(words[44] == 1000)
        yield from [Item(Sort.OTHER, "force resultants")] * bool(words[45] == 1000)
        yield from [Item(Sort.DATA, "thickness")] * bool(words[46] == 1000)
        yield from [Item(Sort.OTHER, "other integration points")] * bool(
            abs(words[36]) % 10_000 > 1
        )
        yield from [Item(Sort.OTHER, "history variables")] * bool(words[35] > 0)
    elif has_cells and words[27]:
        yield from [Item(Sort.DATA, "stress")] * bool(words[43] in (999, 1000))
        yield from [Item(Sort.OTHER, "history variables")] * bool(words[34] > 0)


def walk_ensight(path: Path) -> Iterator[Item]:
    """Yield the variables and times of a case, and the parts that VTK reads."""
    from vtkmodules import all as vtk

    section = ""
    for line in path.read_text("latin-1").splitlines():
        key, colon, value = line.partition(":")
        if re.fullmatch(r"[A-Z]+", line.strip()):
            section = line.strip()
        elif section == "VARIABLE" and colon:
            words = value.split()
            names = [word for word in words if not word.isdigit()]
            yield Item(Sort.DATA, names[0])
        elif section not in ("", "FORMAT", "GEOMETRY", "TIME", "FILE", "VARIABLE"):
            yield Item(Sort.OTHER, section)
        elif section == "GEOMETRY" and colon and key.strip() != "model":
            yield Item(Sort.OTHER, key.strip())
    reader = vtk.vtkGenericEnSightReader()
    reader.SetCaseFileName(str(path))
    reader.Update()
    blocks = reader.GetOutput()
    parts = []
    for index in range(blocks.GetNumberOfBlocks()):
        block = blocks.GetBlock(index)
        name = blocks.GetMetaData(index).Get(vtk.vtkCompositeDataSet.NAME()) or ""
        cells = (block.GetCell(cell) for cell in range(block.GetNumberOfCells()))
        if any(cell.GetCellDimension() > 1 for cell in cells):
            parts.append(name.strip())
    yield from (Item(Sort.GROUP, name) for name in parts if name and len(parts) > 1)
    yield Item(Sort.FACES, "cells")
    for array in reader.GetTimeSets() and [reader.GetTimeSets().GetItem(0)]:
        times = [array.GetValue(index) for index in range(array.GetNumberOfTuples())]
        yield from [Item(Sort.TIMES, "times", times)] * (len(times) > 1)
