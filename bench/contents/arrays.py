"""Contents of NumPy archives and HDF5 files: each array by the names of our documentation."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from contents import vtkhdf
from contents.items import Item, Sort, timed, valued

EXTENSIONS = (".npz", ".h5", ".hdf5", ".hdf")
SHAPES = {"times", "fps", "start_s", "face_sizes", "faces", "cells", "cell_types", "name"}
DESCRIBED = {"name", "domain", "kind", "unit", "units"}
"""Attributes of tracks."""


def walk(path: Path) -> Iterator[Item]:
    """Yield the arrays of a file, and in HDF5 the attributes of its groups and datasets."""
    if path.suffix.lower() == ".npz":
        with np.load(path, allow_pickle=False) as archive:
            yield from _items({name: archive[name] for name in archive.files}, {})
        return
    import h5py

    with h5py.File(path, "r") as file:
        is_vtkhdf = "VTKHDF" in file
    if is_vtkhdf:
        yield from vtkhdf.walk(path)
        return
    arrays: dict[str, Any] = {}
    attributes: dict[str, dict[str, Any]] = {}

    def visit(name: str, node: Any) -> None:
        attributes[name] = dict(node.attrs)
        if isinstance(node, h5py.Dataset):
            is_text = h5py.check_string_dtype(node.dtype) is not None
            arrays[name] = np.asarray(node.asstr()[()]).astype(str) if is_text else node[()]

    with h5py.File(path, "r") as file:
        attributes[""] = dict(file.attrs)
        file.visititems(visit)
        linked = {name for name in arrays if "vertices" in file and file["vertices"] == file[name]}
    positions = linked or {name for name, values in arrays.items() if _are_positions(name, values)}
    for name, values in attributes.items():
        for attribute in values.keys() - (
            DESCRIBED if name in arrays.keys() - positions else set()
        ):
            yield Item(Sort.OTHER, attribute)
    folder = min(positions).rpartition("/")[0]
    shortened = {min(positions): "vertices"}
    for name in arrays.keys() - positions:
        above, _, leaf = name.rpartition("/")
        is_faces = leaf == "faces" and f"{folder}/".startswith(f"{above}/")
        shortened[name] = leaf if above == folder or is_faces else name
    yield from _items({new: arrays[old] for old, new in shortened.items()}, attributes)


def _are_positions(name: str, values: Any) -> bool:
    is_float, is_track = values.dtype.kind == "f", "tracks/" in name
    return is_float and not is_track and values.ndim == 3 and 3 in values.shape[1:]


def _items(arrays: Mapping[str, Any], attributes: Mapping[str, Any]) -> Iterator[Item]:
    def texts(name: str) -> list[str]:
        return [str(text) for text in arrays.get(name, ())]

    described = {*SHAPES, "vertices", "hard_edges", "part_names", "part_sizes"}
    yield Item(Sort.POSITIONS, "vertices", arrays.get("vertices"))
    shape = np.shape(arrays["vertices"])
    n_frames = shape[0] if shape[-1] == 3 else shape[-1]
    times = arrays.get("times")
    if times is None and arrays.get("fps", 0):
        times = arrays.get("start_s", 0) + np.arange(n_frames) / arrays["fps"]
    yield from timed(() if times is None else times)
    if "cells" in arrays:
        n_cells = max(
            np.size(arrays["cell_types"]), len(arrays["cells"]) * (arrays["cells"].ndim > 1)
        )
        yield Item(Sort.FACES, "cells", n_cells)
        yield Item(Sort.FACES, "faces")  # follow from the cells
    else:
        sizes = arrays.get("face_sizes", arrays.get("faces", ()))
        yield Item(Sort.FACES, "faces", len(sizes))
    yield from [Item(Sort.EDGES, "hard_edges")] * ("hard_edges" in arrays)
    yield from (Item(Sort.GROUP, name) for name in texts("part_names"))
    for index in range(len(texts("group_names"))):
        yield from (Item(Sort.GROUP, label) for label in texts(f"group_{index}_labels"))
        described |= {f"group_{index}_labels", f"group_{index}_numbers"}
    for index, name in enumerate(texts("attribute_names")):
        kind, values = texts("attribute_kinds")[index], arrays[f"attribute_{index}_values"]
        values = values[arrays.get(f"attribute_{index}_indices", slice(None))]
        yield from valued(name, None if kind == "color" else values, kind)
        described |= {f"attribute_{index}_values", f"attribute_{index}_indices"}
    columns = [texts(f"track_{column}") for column in ("names", "kinds", "units")]
    tracks = {row[0].replace("/", "_"): row for row in zip(*columns, strict=True)}
    for path, values in arrays.items():
        if path in described or path.startswith(("attribute_", "group_", "track_")):
            if path not in described and path.partition("_")[2][:1].isdigit():
                yield Item(Sort.OTHER, path)
            continue
        own = attributes.get(path, {})
        default = path.removeprefix("tracks/")
        name, kind, unit = tracks.get(default, (default, "", ""))
        kind, unit = str(own.get("kind", kind)), str(own.get("unit", own.get("units", unit)))
        is_known = np.asarray(values).dtype.kind in "iuf" and kind != "color"
        yield from valued(str(own.get("name", name)), values if is_known else None, kind, unit)
