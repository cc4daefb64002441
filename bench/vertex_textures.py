"""Disk and video memory and errors of vertex animation textures and other ways to play a mesh.

    python bench/vertex_textures.py samba.npz chicken.npz --max-error 0.05 --out textures.json

Each entry of `WAYS` writes its files and reports their size, their video memory, and the largest
distance of a vertex from its original in percent of the diagonal of the bounding box of all frames.

Video memory includes vertices and indices as in the mesh file, uncompressed textures with four
channels, and, for each independently animated copy in a crowd, the data that copies cannot share,
without their transforms.
"""

import argparse
import json
import re
import struct
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from measuring import machine_text, print_table, store
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.vat.folder import write_vat
from meshreel.formats.vat.textures import TexelType, read_texture
from meshreel.model.notes import Notes

COPIES = 100
"""Copies in the crowd."""

HEADER = ["what", "MB on disk", "MB of video memory", f"MB, crowd of {COPIES}", "error %"]
DECODED_BYTES = 24
"""Bytes per vertex when decoded during playback: position and normal in float32."""

MORPH_TEXEL_BYTES = 16
"""Bytes per vertex of a morph target: three.js uses RGBA float32 texels per attribute."""


@dataclass(frozen=True)
class Cost:
    """Memory and error of a way to play a sequence.

    Attributes
    ----------
    what : str
    disk_bytes : int
        All files.
    shared_bytes : int
        Video memory shared by all copies.
    copy_bytes : int
        Video memory of each independently animated copy.
    error_percent : float
        Largest error in percent of the diagonal.
    """

    what: str
    disk_bytes: int
    shared_bytes: int
    copy_bytes: int
    error_percent: float


Document = dict[str, list[dict[str, Any]]]
Way = Callable[[meshreel.MeshSequence, Path, float], Cost]
"""Takes a sequence, an empty output folder, and the error bound if the way supports one."""


def plain(what: str, layout: str, texels: TexelType) -> Way:
    """Plain vertex animation textures with one texel type."""

    def write(sequence: meshreel.MeshSequence, folder: Path, max_error: float) -> Cost:
        notes = Notes()
        options = WriteOptions(max_error=100.0, layout=layout)  # the texel type is the error
        write_vat(folder, "walk", stream_of(sequence, notes), options, [texels])
        [mesh] = folder.glob("*.glb")
        textures = folder.glob(f"*{texels.extension}")
        video = mesh_bytes(mesh) + sum(map(texture_bytes, textures))
        return Cost(what, size_of(folder), video, 0, noted_error(notes))

    return write


def morphs(sequence: meshreel.MeshSequence, folder: Path, max_error: float) -> Cost:
    """A GLB with morph targets, with the video memory of three.js."""
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
            video += sum(accessor_bytes(document, number) for number in accessors)
    n_targets = max(len(mesh["primitives"][0].get("targets", [])) for mesh in document["meshes"])
    what = f"GLB, {n_targets} morph targets"
    return Cost(what, path.stat().st_size, video, 4 * n_targets, noted_error(notes))


def on_the_fly(sequence: meshreel.MeshSequence, folder: Path, max_error: float) -> Cost:
    """A stream, decoded during playback."""
    stream = meshreel.encode(sequence, max_error=max_error)
    decoded = meshreel.decode(stream)
    far = [
        np.linalg.norm(a - b, axis=1).max()
        for a, b in zip(decoded.vertices, sequence.vertices, strict=True)
    ]
    error = 100 * float(max(far)) / diagonal(sequence)
    indices = sequence.faces.size * (2 if sequence.n_verts < 0xFFFF else 4)
    copy = sequence.n_verts * DECODED_BYTES
    return Cost(".reel, decoded on the fly", len(stream), indices, copy, error)


WAYS: tuple[Way, ...] = (
    plain("OpenVAT, 8-bit PNG", "openvat", TexelType.BITS_8),
    plain("OpenVAT, 16-bit PNG", "openvat", TexelType.BITS_16),
    plain("OpenVAT, half EXR", "openvat", TexelType.HALF),
    morphs,
    on_the_fly,
)


def costs(sequence: meshreel.MeshSequence, max_error: float) -> Iterable[Cost]:
    """Yield the cost of each way."""
    for way in WAYS:
        with TemporaryDirectory() as folder:
            yield way(sequence, Path(folder), max_error)


def stream_of(sequence: meshreel.MeshSequence, notes: Notes) -> FrameStream:
    """The sequence in the form that writers accept."""
    stream = SegmentedStream(sequence.replace(tracks={}), notes=notes)
    return next(stream.segments())


def noted_error(notes: Iterable[str]) -> float:
    """The largest error in percent, from the notes of a writer."""
    [match] = filter(None, (re.search(r"largest error is (\S+) %", note) for note in notes))
    return float(match[1])


def diagonal(sequence: meshreel.MeshSequence) -> float:
    """Diagonal of the bounding box of all frames."""
    return float(np.linalg.norm(sequence.extent.high - sequence.extent.low))


def size_of(folder: Path) -> int:
    """Bytes of all files in a folder."""
    return sum(path.stat().st_size for path in folder.iterdir())


def texture_bytes(path: Path) -> int:
    """Video memory of a texture."""
    texels = read_texture(path)
    [texel_type] = [each for each in TexelType if each.dtype == texels.dtype]
    return texel_type.video_bytes(*texels.shape[:2])


def glb_document(path: Path) -> Document:
    """The JSON of a GLB file."""
    data = path.read_bytes()
    (size,) = struct.unpack("<I", data[12:16])
    document: Document = json.loads(data[20 : 20 + size])
    return document


def accessor_bytes(document: Document, number: int) -> int:
    """Bytes of an accessor in its buffer."""
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    stride = view.get("byteStride") or view["byteLength"] // accessor["count"]
    return int(accessor["count"] * stride)


def mesh_bytes(path: Path) -> int:
    """Bytes of the vertices and indices of a GLB file."""
    document = glb_document(path)
    return sum(accessor_bytes(document, number) for number in range(len(document["accessors"])))


def row(cost: Cost) -> list[str]:
    """A row of the table."""
    single, crowd = (cost.shared_bytes + n * cost.copy_bytes for n in (1, COPIES))
    sizes = [f"{size / 1e6:.3g}" for size in (cost.disk_bytes, single, crowd)]
    return [cost.what, *sizes, f"{cost.error_percent:.2g}"]


def main() -> None:
    """Print a table for each file, and write JSON if requested."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", type=Path, help="sequences that meshreel reads")
    parser.add_argument(
        "--max-error", type=float, default=0.05,
        help="error bound in percent of the diagonal, if supported; default: %(default)s",
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="a JSON file for the figures")
    options = parser.parse_args()
    print(f"{machine_text()}\n")
    figures = {}
    for path in options.files:
        sequence = meshreel.load(path)
        if not sequence.fps:
            sequence = sequence.replace(fps=25.0)
        measured = list(costs(sequence, options.max_error))
        print(f"{path.name}: {sequence.n_verts} vertices, {sequence.n_frames} frames\n")
        print_table("", HEADER, map(row, measured))
        figures[path.name] = list(map(asdict, measured))
    store(options.out, max_error=options.max_error, figures=figures)


if __name__ == "__main__":
    main()
