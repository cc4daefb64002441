"""Contents of point caches with their mesh files, and of Draco files by the library DracoPy."""

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from contents import meshes
from contents.items import Item, Sort, timed

EXTENSIONS = (".pc2", ".mdd", ".drc")
DRACO_SORTS = (Sort.POSITIONS, Sort.EDGES, Sort.COLOR, Sort.UV)
"""Sorts by Draco's type of attributes."""


def walk(path: Path) -> Iterator[Item]:
    """Yield the contents of a file, and those of the mesh file of a point cache."""
    if path.suffix.lower() == ".drc":
        yield from walk_drc(path)
        return
    mesh = path.with_suffix(".obj")
    if mesh.is_file():
        yield from (item for item in meshes.walk(mesh) if item.sort is not Sort.POSITIONS)
    data = path.read_bytes()
    if path.suffix.lower() == ".mdd":
        n_frames, n_verts = struct.unpack_from(">ii", data)
        numbers = np.frombuffer(data, ">f4", n_frames * (1 + 3 * n_verts), 8)
        yield from timed(numbers[:n_frames].astype(np.float64))
        yield Item(Sort.POSITIONS, "points", numbers[n_frames:])
        return
    _, _, n_verts, start, interval, n_frames = struct.unpack_from("<12siiffi", data)
    yield Item(Sort.POSITIONS, "points", np.frombuffer(data, "<f4", n_frames * n_verts * 3, 32))
    yield from [Item(Sort.OTHER, "start", words=("begins at frame",))] * bool(start)
    yield from [Item(Sort.OTHER, "interval", words=("frames apart",))] * (interval != 1)


def walk_drc(path: Path) -> Iterator[Item]:
    """Yield the attributes of a Draco file; points may be welded."""
    import DracoPy

    mesh = DracoPy.decode(path.read_bytes())
    yield Item(Sort.FACES, "faces", len(mesh.faces))
    for attribute in mesh.attributes:
        kind, number = attribute["attribute_type"], attribute["unique_id"]
        sort = DRACO_SORTS[kind] if kind < len(DRACO_SORTS) else Sort.OTHER
        nouns = ("positions", "normals", "color", "uv", "generic", "unknown")
        name = attribute["name"] or f"{nouns[min(kind, 5)]} {number}"
        is_other = sort is Sort.OTHER or attribute["data"] is None
        words = ("normals",) if sort is Sort.EDGES else ()
        values = attribute["data"] if sort in (Sort.POSITIONS, Sort.UV) else None
        yield Item(Sort.OTHER if is_other else sort, name, values, words)
