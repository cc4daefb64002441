"""Contents of Exodus II files: their netCDF variables, by SciPy (netCDF-3) or h5py (netCDF-4)."""

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contents.items import Item, Sort, timed

EXTENSIONS = (".e", ".ex2", ".exo", ".g")
FLAT = ("sph", "cir", "poi", "bar", "bea", "tru", "rod", "edg", "lin", "nul")
"""Beginnings of the types of elements without faces."""
UNREAD = {
    "ns": "node sets", "ss": "side sets", "els": "elem sets", "es": "edge sets", "fs": "face sets",
    "ed": "edge blocks", "fa": "face blocks",
}  # fmt: skip
"""Beginnings of the variables that name sets, blocks and maps which are not read."""
RECORDS = {
    "node_num_map": "user numbers", "elem_num_map": "user numbers", "elem_map": "user numbers",
    "info_records": "Info_Records", "qa_records": "QA_Records",
}  # fmt: skip
STRUCTURE = re.compile(
    r"coord[xyz]?|coor_names|time_whole|\w+_status|\w+_tab|(?!name_)\w+_names|eb_prop1|"
    r"(edm?|fam?|[ens]m|[ef]?[lns]?s|fa|ed)_prop\d+|(connect|ebconn|edgconn|facconn|fbconn)\d+|"
    r"(elem|side|node|edge|face|ornt|dist_fact)_(ss|ns|es|fs|els)\d+|(node|elem|edge|face)_map\d+|"
    r"(name|vals)_(glo|nod|elem|nset|sset|eset|fset|elset|edge|face)_var\w*|\w*attri?b?\w*|(num|len)_\w+|"
    r"time_step|four"
)
"""Variables that other ones name, or that hold no values."""


def walk(path: Path) -> Iterator[Item]:
    """Yield nodes, elements, names, results and other variables of a file."""
    variables, attributes = _variables(path)
    yield from [Item(Sort.OTHER, "Title")] * bool(attributes["", "title"])
    axes = [*variables.get("coord", ())] or [variables.get(f"coord{axis}") for axis in "xyz"]
    size = max((len(axis) for axis in axes if axis is not None), default=0)
    axes = [np.zeros(size) if axis is None else axis for axis in [*axes, None, None][:3]]
    yield Item(Sort.POSITIONS, "coord", np.stack(axes, axis=1))
    yield from timed(variables.get("time_whole", ()))
    n_blocks = len(variables["eb_prop1"])
    blocks = [number for number in range(1, n_blocks + 1) if f"connect{number}" in variables]
    kinds = [attributes[f"connect{number}", "elem_type"].lower() for number in blocks]
    if not any(kind.startswith((*FLAT, "nfaced")) for kind in kinds):
        n_elements = sum(len(variables[f"connect{number}"]) for number in blocks)
        yield Item(Sort.FACES, "elements", n_elements)
    with_faces = [
        number for number, kind in zip(blocks, kinds, strict=True) if not kind.startswith(FLAT)
    ]
    yield Item(Sort.DATA, "ObjectId", [variables["eb_prop1"][number - 1] for number in with_faces])
    for number, name in enumerate(_texts(variables, "eb_names"), 1):
        if name and number in blocks:
            yield Item(Sort.GROUP, name)
    yield from _results(variables, "nod", [""])
    yield from _results(variables, "elem", [f"eb{number}" for number in blocks])
    for kind in ("glo", "nset", "sset", "elset", "eset", "fset", "edge", "face"):
        results = _results(variables, kind, [])
        yield from (Item(Sort.OTHER, item.name) for item in results)
    for number in blocks:
        n_attributes = np.shape(variables.get(f"attrib{number}", np.empty((0, 0))))[1]
        names = _texts(variables, f"attrib_name{number}") or [""] * n_attributes
        yield from (Item(Sort.OTHER, name, words=("attributes",)) for name in names)
    for map_kind, prefix in (("node", "n"), ("elem", "e")):
        for number, name in enumerate(_texts(variables, f"{prefix}map_names"), 1):
            yield Item(Sort.DATA, name, variables.get(f"{map_kind}_map{number}"))
    for kind, noun in UNREAD.items():
        ids = variables.get(f"{kind}_prop1", ())
        names = _texts(variables, f"{kind}_names") or [""] * len(ids)
        yield from (Item(Sort.OTHER, name or noun, words=(noun,)) for name in names)
    for name, noun in RECORDS.items():
        values = variables.get(name, np.ones(0))
        is_plain = values.dtype.kind in "iu" and (values == np.arange(1, len(values) + 1)).all()
        yield from [Item(Sort.OTHER, name, words=(noun,))] * bool(len(values) and not is_plain)
    for name in variables:
        if re.fullmatch(r"\w+_prop\d+", name) and not name.endswith("prop1"):
            yield Item(Sort.OTHER, attributes[name, "name"])
        elif not STRUCTURE.fullmatch(name) and name not in RECORDS:
            yield Item(Sort.OTHER, name)


def _variables(path: Path) -> tuple[dict[str, Any], "_Texts"]:
    """Return all variables by name, and the attributes by variable and name."""
    data = path.read_bytes()[:4]
    texts, variables = _Texts(), dict[str, Any]()
    if data.startswith(b"CDF"):
        from scipy.io import netcdf_file

        with netcdf_file(path, "r", mmap=False) as file:
            texts["", "title"] = _text(getattr(file, "title", b""))
            for name, variable in file.variables.items():
                variables[name] = variable[()] if not variable.shape else variable[:]
                texts[name, "elem_type"] = _text(getattr(variable, "elem_type", b""))
                texts[name, "name"] = _text(getattr(variable, "name", b""))
        return variables, texts
    import h5py

    with h5py.File(path, "r") as file:
        texts["", "title"] = _text(file.attrs.get("title", b""))
        for name, variable in file.items():
            if not str(_text(variable.attrs.get("NAME", b""))).startswith("This is a netCDF dim"):
                variables[name] = variable[()]
                texts |= {(name, key): _text(value) for key, value in variable.attrs.items()}
    return variables, texts


class _Texts(dict[tuple[str, str], str]):
    """Texts by variable and attribute; others are empty."""

    def __missing__(self, key: tuple[str, str]) -> str:
        return ""


def _text(value: Any) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)


def _texts(variables: Mapping[str, Any], name: str) -> list[str]:
    """Return the rows of a table of characters."""
    rows = variables.get(name, np.empty((0, 1), "S1"))
    return [row.tobytes().partition(b"\0")[0].decode("latin-1").strip() for row in rows]


def _results(variables: Mapping[str, Any], kind: str, suffixes: Sequence[str]) -> Iterator[Item]:
    """Yield results; names that end in x, y and z are components of a vector."""
    names = _texts(variables, f"name_{kind}_var")
    values = {
        name: [
            variables[key]
            for suffix in suffixes
            if (key := f"vals_{kind}_var{number}{suffix}") in variables
        ]
        for number, name in enumerate(names, 1)
    }
    if f"vals_{kind}_var" in variables:  # of all nodal variables
        values = {name: [variables[f"vals_{kind}_var"][:, n]] for n, name in enumerate(names)}
    while names:
        stem, first = names[0][:-1], names[0]
        vector = [name for name, axis in zip(names, "xyz", strict=False)
                  if stem and name[:-1] == stem and name[-1].lower() == axis]  # fmt: skip
        same = vector if vector == names[: len(vector)] and len(vector) > 1 else [first]
        columns = [np.concatenate([*map(np.ravel, values[name]), []]) for name in same]
        columns += [np.zeros_like(columns[0])] * (len(same) == 2)
        yield Item(Sort.DATA, stem if len(same) > 1 else first, np.stack(columns, axis=1))
        del names[: len(same)]
