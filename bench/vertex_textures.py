"""Vertex animation textures and other ways to play a mesh: bytes on disk, bytes on a GPU, errors.

    python bench/vertex_textures.py samba.npz chicken.npz --max-error 0.05 --out textures.json

Each way is a row of `WAYS`, and gives the files that it needs, what they take in video memory, and
the largest distance of a vertex from its original, in percent of the diagonal of the bounding box
of all frames, of the files as they were written.

Video memory is what a GPU holds to show the mesh: vertices and indices as the mesh file has them,
textures uncompressed with four channels, as GPUs have them, and, for each copy of a crowd whose
copies are out of step, what only this copy needs beside its transform.
"""

import argparse
import json
import re
import struct
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from meshreel.evaluation.runs.machine import machine_facts, machine_line
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.layouts import LAYOUTS
from meshreel.formats.vat.plain import write_plain
from meshreel.formats.vat.textures import TexelType, read_texture, texel_type_of
from speed_tables import table

COPIES = 100
"""In the crowd."""

HEADER = ["what", "MB on disk", "MB of video memory", f"MB, crowd of {COPIES}", "error %"]
DECODED_BYTES = 24
"""Of a vertex that is decoded on the fly: a position and a normal, in float32."""

MORPH_TEXEL_BYTES = 16
"""Of a vertex in a morph target: three.js has RGBA texels of float32, for positions and normals."""


@dataclass(frozen=True)
class Cost:
    """What a way to play a sequence takes.

    Attributes
    ----------
    what : str
    disk_bytes : int
        Of all files together.
    shared_bytes : int
        Of video memory, however many copies there are.
    copy_bytes : int
        Of video memory, for each copy that is out of step with the others.
    error_percent : float
        Of the diagonal.
    """

    what: str
    disk_bytes: int
    shared_bytes: int
    copy_bytes: int
    error_percent: float


Document = dict[str, list[dict[str, Any]]]
Way = Callable[[meshreel.MeshSequence, Path, float], Cost]
"""Of a sequence, an empty folder to write into, and the error to allow where it can be chosen."""


def plain(what: str, layout: str, texels: TexelType) -> Way:
    """Plain vertex animation textures of one type of texels."""

    def write(sequence: meshreel.MeshSequence, folder: Path, max_error: float) -> Cost:
        notes: list[str] = []
        names = LAYOUTS[layout].names("walk", texels.extension, normals=True)
        options = WriteOptions(max_error=100.0)  # of a type that is given
        write_plain(folder, names, stream_of(sequence, notes), options, LAYOUTS[layout], [texels])
        textures = [folder / name for name in (names.positions, names.normals) if name]
        video = mesh_bytes(folder / names.mesh) + sum(map(texture_bytes, textures))
        return Cost(what, size_of(folder), video, 0, noted_error(notes))

    return write


def pca(sequence: meshreel.MeshSequence, folder: Path, max_error: float) -> Cost:
    """A PCA texture, with normals where the surface is smooth."""
    notes: list[str] = []
    path = folder / "walk.vat"
    options = WriteOptions(layout="pca", max_error=max_error)
    files = meshreel.save(sequence, path, options=options, notes=notes)
    mesh, texture, data = (Path(file) for file in files)
    n_fields = json.loads(data.read_text(encoding="utf-8"))["fields"]
    video = mesh_bytes(mesh) + texture_bytes(texture)
    return Cost(f"PCA, {n_fields} fields", size_of(path), video, 0, noted_error(notes))


def morphs(sequence: meshreel.MeshSequence, folder: Path, max_error: float) -> Cost:
    """A GLB of morph targets, as three.js holds them."""
    notes: list[str] = []
    path = folder / "walk.glb"
    meshreel.save(sequence, path, options=WriteOptions(max_error=max_error), notes=notes)
    document = glb_document(path)
    video = 0
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            targets = primitive.get("targets", [])
            n_verts = document["accessors"][primitive["attributes"]["POSITION"]]["count"]
            kinds = sorted({kind for target in targets for kind in target})
            video += len(targets) * len(kinds) * n_verts * MORPH_TEXEL_BYTES
            accessors = [*primitive["attributes"].values(), primitive["indices"]]
            video += sum(accessor_bytes(document, one) for one in accessors)
    n_targets = max(len(mesh["primitives"][0].get("targets", [])) for mesh in document["meshes"])
    what = f"GLB, {n_targets} morph targets"
    return Cost(what, path.stat().st_size, video, 4 * n_targets, noted_error(notes))


def on_the_fly(sequence: meshreel.MeshSequence, folder: Path, max_error: float) -> Cost:
    """A stream, decoded while it plays."""
    stream = meshreel.encode(sequence, max_error=max_error)
    decoded = meshreel.decode(stream)
    far = [np.linalg.norm(a - b, axis=1).max() for a, b in zip(decoded, sequence, strict=True)]
    error = 100 * float(max(far)) / diagonal(sequence)
    indices = sequence.faces.size * (2 if sequence.n_verts < 0xFFFF else 4)
    copy = sequence.n_verts * DECODED_BYTES
    return Cost(".reel, decoded on the fly", len(stream), indices, copy, error)


WAYS: tuple[Way, ...] = (
    plain("OpenVAT, 8-bit PNG", "openvat", TexelType.BITS_8),
    plain("OpenVAT, 16-bit PNG", "openvat", TexelType.BITS_16),
    plain("OpenVAT, half EXR", "openvat", TexelType.HALF),
    plain("Labs, 8-bit PNG", "labs", TexelType.BITS_8),
    plain("Labs, 16-bit PNG", "labs", TexelType.BITS_16),
    plain("Labs, half EXR", "labs", TexelType.HALF),
    pca,
    morphs,
    on_the_fly,
)


def costs(sequence: meshreel.MeshSequence, max_error: float) -> Iterable[Cost]:
    """What each way takes."""
    for way in WAYS:
        with TemporaryDirectory() as folder:
            yield way(sequence, Path(folder), max_error)


def stream_of(sequence: meshreel.MeshSequence, notes: list[str]) -> FrameStream:
    """The sequence as writers take it."""
    return FrameStream(
        [sequence.vertices], sequence.faces,
        n_frames=sequence.n_frames, fps=sequence.fps, surface=sequence.surface, notes=notes,
    )  # fmt: skip


def noted_error(notes: Iterable[str]) -> float:
    """The largest error in percent that the notes of a writer tell of."""
    [found] = [one for one in (re.search(r"largest error is (\S+) %", n) for n in notes) if one]
    return float(found[1])


def diagonal(sequence: meshreel.MeshSequence) -> float:
    """Diagonal of the bounding box of all frames."""
    return float(np.linalg.norm(sequence.extent.high - sequence.extent.low))


def size_of(folder: Path) -> int:
    """Bytes of all files in a folder."""
    return sum(one.stat().st_size for one in folder.iterdir())


def texture_bytes(path: Path) -> int:
    """Bytes of video memory that a texture takes."""
    texels = read_texture(path)
    return texel_type_of(texels).video_bytes(*texels.shape[:2])


def glb_document(path: Path) -> Document:
    """The JSON of a GLB file."""
    data = path.read_bytes()
    (size,) = struct.unpack("<I", data[12:16])
    found: Document = json.loads(data[20 : 20 + size])
    return found


def accessor_bytes(document: Document, number: int) -> int:
    """Bytes of what an accessor tells of, as the buffer has it."""
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    stride = view.get("byteStride") or view["byteLength"] // accessor["count"]
    return int(accessor["count"] * stride)


def mesh_bytes(path: Path) -> int:
    """Bytes of the vertices and indices of a GLB file."""
    document = glb_document(path)
    return sum(accessor_bytes(document, one) for one in range(len(document["accessors"])))


def row(cost: Cost) -> list[str]:
    """A row of the table."""
    one, crowd = (cost.shared_bytes + n * cost.copy_bytes for n in (1, COPIES))
    sizes = [f"{size / 1e6:.3g}" for size in (cost.disk_bytes, one, crowd)]
    return [cost.what, *sizes, f"{cost.error_percent:.2g}"]


def main() -> None:
    """Print a table for each file, and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, help="sequences that meshreel reads")
    parser.add_argument(
        "--max-error", type=float, default=0.05,
        help="percent of the diagonal, where it can be chosen; default: %(default)s",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="a JSON file for the figures")
    options = parser.parse_args()
    print(f"{machine_line(machine_facts())}\n")
    figures = {}
    for path in options.files:
        sequence = meshreel.load(path)
        if not sequence.fps:
            sequence = replace(sequence, fps=25.0)
        found = list(costs(sequence, options.max_error))
        print(f"{path.name}: {sequence.n_verts} vertices, {sequence.n_frames} frames\n")
        print(table(HEADER, [row(one) for one in found]), end="\n\n")
        figures[path.name] = [asdict(one) for one in found]
    if options.out:
        about = {"machine": machine_facts(), "max_error": options.max_error, "figures": figures}
        options.out.write_text(json.dumps(about, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
