"""Contents of VTKHDF files: their datasets."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contents.items import Item, Sort

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
                yield from [Item(Sort.TIMES, "times", node[()], ("frame rate",))] * (len(node) > 1)
            elif leaf == "NumberOfCells" and np.sum(node[()]):
                is_flat = folder == "Polygons" and len(node) == 1 and is_single
                yield Item(Sort.FACES, name, int(node[0]) if is_flat else None)
            elif leaf == "Points":
                yield Item(Sort.POSITIONS, name, node[()])
            elif folder in ("PointData", "CellData"):
                title, kind = node.attrs.get("name", leaf), node.attrs.get("kind", "")
                unit = node.attrs.get("unit", node.attrs.get("units", ""))
                sort = {"color": Sort.COLOR, "uv": Sort.UV}.get(kind, Sort.DATA)
                yield Item(sort, title, node[()] if sort is Sort.DATA else None, ("inside",))
                yield from [Item(Sort.UNIT, f"{title}:{unit}", words=("units",))] * bool(unit)
            elif leaf not in STRUCTURE and "Steps" not in name:
                yield Item(Sort.OTHER, name)
