"""Contents of PLY files, from the elements and properties of their headers."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from contents.items import Item, Sort

EXTENSIONS = (".ply",)
PLY_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2",
    "int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8",
}  # fmt: skip
COLORS = {f"{before}{name}" for before in ("", "diffuse_") for name in ("red", "green", "blue")}
COLORS |= {"alpha", "diffuse_alpha", "r", "g", "b", "a"}
UVS = {"s", "t", "u", "v", "texture_u", "texture_v", "texture_s", "texture_t"}


def walk(path: Path) -> Iterator[Item]:
    """Yield the elements and properties of a PLY file, and its comments that name images."""
    data = path.read_bytes()
    end = data.index(b"end_header")
    lines = [line.split() for line in data[:end].decode("latin-1").splitlines()]
    body = data[end:].partition(b"\n")[2]
    encoding = next(words[1] for words in lines if words[:1] == ["format"])
    elements: list[tuple[str, int, list[list[str]]]] = []
    for words in lines:
        if words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"]:
            elements[-1][2].append(words[1:])
        elif words[:2] == ["comment", "TextureFile"]:
            yield Item(Sort.IMAGE, " ".join(words[2:]))
        elif words[:1] == ["obj_info"]:
            yield Item(Sort.OTHER, "obj_info")
    for number, (name, n_rows, properties) in enumerate(elements):
        if name not in ("vertex", "face"):
            yield from [Item(Sort.OTHER, name)] * (n_rows > 0)
            continue
        columns: dict[str, Any] = {words[-1]: None for words in properties if words[0] != "list"}
        if number == 0 and n_rows and len(columns) == len(properties):
            dtype = np.dtype([(words[1], PLY_TYPES[words[0]]) for words in properties])
            if encoding == "ascii":
                numbers = np.array(body.split()[: n_rows * len(properties)], np.float64)
                columns = dict(zip(columns, numbers.reshape(n_rows, -1).T, strict=True))
            else:
                dtype = dtype.newbyteorder("<" if "little" in encoding else ">")
                rows = np.frombuffer(body, dtype, n_rows)
                columns = {column: rows[column] for column in columns}
        if name == "vertex":
            axes = [columns.pop(axis) for axis in "xyz"]
            yield Item(
                Sort.POSITIONS, "vertex", None if axes[0] is None else np.stack(axes, axis=1)
            )
        else:
            yield Item(Sort.FACES, "face", n_rows)
        for column, values in columns.items():
            if column in ("nx", "ny", "nz") and name == "vertex":
                yield Item(Sort.EDGES, column, words=("normals",))
            elif column in COLORS | UVS:
                sort = Sort.COLOR if column in COLORS else Sort.UV
                yield Item(sort, column)
            else:
                yield Item(Sort.DATA, column, values)
        for words in properties:
            if words[0] == "list" and words[-1] not in ("vertex_index", "vertex_indices"):
                yield Item(Sort.UV if words[-1] == "texcoord" else Sort.OTHER, words[-1])
