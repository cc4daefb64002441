"""Contents of OBJ with MTL, STL and OFF, from their headers and keywords."""

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from contents.items import Item, Sort

OBJ_WORDS = {
    "l": ("lines",), "p": ("points",), "curv": ("curves",), "curv2": ("curves",),
    "surf": ("free-form surfaces",), "s": ("smoothing groups", "hard edges", "hard edge"),
}  # fmt: skip
TOPOLOGY = {"v", "f", "vt", "vn", "mtllib", "usemtl", "g", "o", "#"}


def walk_obj(path: Path) -> Iterator[Item]:
    """Yield the statements of an OBJ file, and the properties of its material libraries."""
    rows, group = defaultdict[str, list[list[str]]](list), dict[str, str]()
    smoothing, smooth_groups = list[str](), set[tuple[str, ...]]()
    text = path.read_text("utf-8", "replace").replace("\\\n", " ")
    for words in filter(None, map(str.split, text.splitlines())):
        key = "#" if words[0].startswith("#") else words[0]
        rows[key].append(words[1:])
        if key in ("usemtl", "g", "o"):
            group[key] = " ".join(words[1:])
        elif key == "s":
            smoothing = words[1:]
        elif key == "f":
            smooth_groups.add(tuple(smoothing))
            yield from (Item(Sort.GROUP, name) for name in filter(None, group.values()))
            group.clear()
    vertices = rows["v"]
    yield Item(Sort.POSITIONS, "v", [[float(word) for word in words[:3]] for words in vertices])
    yield Item(Sort.FACES, "f", len(rows["f"]))
    if any(len(words) in (6, 7) for words in vertices):
        yield Item(Sort.COLOR, "v", words=("colors",))
    if rows["vt"]:
        yield Item(Sort.UV, "vt", words=("texture coordinates",))
    if rows["vn"]:
        yield Item(Sort.EDGES, "vn", words=("normals",))
    if len(smooth_groups) < 2:  # one smoothing group has no edges
        rows.pop("s", None)
    for key in rows.keys() - TOPOLOGY:
        yield Item(Sort.EDGES if key == "s" else Sort.OTHER, key, words=OBJ_WORDS.get(key, ()))
    for words in rows["mtllib"]:
        library = path.with_name(" ".join(words))
        lines = library.read_text("latin-1").splitlines() if library.is_file() else ["newmtl"]
        for line in filter(None, map(str.strip, lines)):
            yield Item(Sort.MATERIAL, line.split()[0], words=(library.name,))


def walk_stl(path: Path) -> Iterator[Item]:
    """Yield the triangles of an STL file, and colors in its spare bytes."""
    data = path.read_bytes()
    n_faces = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * n_faces:
        rows = np.frombuffer(data, [("v", "<f4", 12), ("attribute", "<u2")], n_faces, 84)
        corners = rows["v"][:, 3:]
        yield from [Item(Sort.OTHER, "spare bytes")] * bool(rows["attribute"].any())
        if b"COLOR=" in data[:80]:
            yield Item(Sort.OTHER, "header")
    else:
        lines = [line.split() for line in data.decode("latin-1").splitlines()]
        points = [line[1:] for line in lines if line[:1] and line[0].lower() == "vertex"]
        corners, n_faces = np.array(points, float), len(points) // 3
        for words in lines:
            if words[1:] and words[0].lower() == "solid":
                yield Item(Sort.OTHER, " ".join(words[1:]))
    yield Item(Sort.POSITIONS, "vertices", corners)
    yield Item(Sort.FACES, "faces", n_faces)


def walk_off(path: Path) -> Iterator[Item]:
    """Yield the columns of an OFF file."""
    text = [line.partition("#")[0].split() for line in path.read_text("latin-1").splitlines()]
    lines = [words for words in text if words]
    keyword = lines[0].pop(0) if lines[0][0].endswith("OFF") else "OFF"
    n_verts, n_faces = map(int, (lines := [words for words in lines if words])[0][:2])
    rows, faces = lines[1 : 1 + n_verts], lines[1 + n_verts : 1 + n_verts + n_faces]
    yield Item(Sort.POSITIONS, "vertices", [[float(word) for word in row[:3]] for row in rows])
    yield Item(Sort.FACES, "faces", n_faces)
    yield from [Item(Sort.OTHER, "normals")] * ("N" in keyword)
    yield from [Item(Sort.UV, "uv")] * ("ST" in keyword)
    n_named = 3 + 3 * ("N" in keyword) + 2 * ("ST" in keyword)
    if max(map(len, rows)) > n_named:
        yield Item(Sort.COLOR, "colors", words=("further numbers of vertices",))
    if any(len(words) > int(words[0]) + 1 for words in faces):
        yield Item(Sort.COLOR, "face colors")


WALKS = {".obj": walk_obj, ".stl": walk_stl, ".off": walk_off}
EXTENSIONS = tuple(WALKS)


def walk(path: Path) -> Iterator[Item]:
    """Yield the contents of a file with one mesh."""
    return WALKS[path.suffix.lower()](path)
