"""Contents of VTKHDF files: their datasets."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contents.items import Item, Sort, timed, valued

EXTENSIONS = (".vtkhdf",)
STRUCTURE = {
    "Points", "NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds", "Connectivity",
    "Offsets", "Types", "PolyhedronOffsets", "PolyhedronToFaces", "FaceOffsets",
    "FaceConnectivity",
}  # fmt: skip
"""Datasets of VTKHDF that make up the mesh."""


def walk(path: Path) -> Iterator[Item]:
    """Yield the datasets of a VTKHDF file."""
    import h5py

    nodes: list[tuple[str, Any]] = []
    with h5py.File(path, "r") as file:
        file.visititems(lambda *named_node: nodes.append(named_node))
        is_single = sum(name.endswith("/Points") for name, _ in nodes) == 1
        for name, node in nodes:
            *_, folder, leaf = ["", *name.split("/")]
            if not isinstance(node, h5py.Dataset):
                continue
            if leaf == "Values" and folder == "Steps":
                yield from timed(node[()])
            elif leaf == "NumberOfCells" and np.sum(node[()]):
                is_flat = folder == "Polygons" and len(node) == 1 and is_single
                yield Item(Sort.FACES, name, int(node[0]) if is_flat else None)
            elif leaf == "Points":
                yield Item(Sort.POSITIONS, name, node[()])
            elif folder in ("PointData", "CellData"):
                is_uv = node.attrs.get("Attribute") == b"TCoords"
                kind = "uv" if is_uv else node.attrs.get("kind", "")
                unit = node.attrs.get("unit", node.attrs.get("units", ""))
                values = None if kind in ("color", "uv") else node[()]
                yield from valued(node.attrs.get("name", leaf), values, kind, unit, ("inside",))
            elif leaf not in STRUCTURE and "Steps" not in name:
                yield Item(Sort.OTHER, name)
