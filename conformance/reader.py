"""A plain reader of `.reel` streams, as docs/format.md has them; slow, and readable.

`python -m conformance.reader FILE` prints what it finds. It shares no code with the package
`meshreel`, and needs the standard library only: what both say of a stream is what the page says.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path

from conformance import paper
from conformance.bits import need
from conformance.connectivity import read_faces
from conformance.container import Container, Payload, read_container
from conformance.description import describe
from conformance.fields import read_fields
from conformance.hierarchy import edges_of, passes_of, resolutions_of
from conformance.order import read_order
from conformance.prediction import predict_fields
from conformance.surface import read_surface
from conformance.timeline import basis_vector, frames_of, passes_by_times, read_corrections


@dataclass
class Reel:
    """A stream, decoded.

    Attributes
    ----------
    container : Container
    internal_faces, faces : list of tuple of int
        In internal order; and as they go out.
    order : list of int
        The internal number of each vertex that goes out.
    blocks : list of dict
        Of each block its integers, by section; lists, or lists of rows.
    surface : dict
    start, promise : float, None if there is none
    anchors : list of int
    positions : array of float, or None
        Of `reel`, as they go out: frames, vertices, x y z. Of other methods integers are defined.
    """

    container: Container
    internal_faces: list
    faces: list
    order: list
    blocks: list
    surface: dict
    start: float | None
    promise: float | None
    anchors: list
    positions: object


def read(data):
    """A stream, decoded.

    Raises
    ------
    DamagedError
        If a rule of the page is broken; other errors may be raised, too.
    """
    container = read_container(data)
    header = container.header
    internal = read_faces(container.only("CONNECTIVITY"), header.n_verts, header.n_faces)
    order, faces = list(range(header.n_verts)), internal
    if header.order < 2:
        order, faces = read_order(container.only("ORDER"), internal, header.n_verts)
    blocks, anchors, positions = [], [], None
    if header.method == "reel":
        blocks, positions = read_reel_blocks(container, internal, order)
    else:
        isolated = [v for v, near in edges_of(internal, header.n_verts).items() if not near]
        if header.method != "v2v":
            anchors = paper.read_anchors(container.only("ANCHOR_VERTICES"), header.n_verts)
        for sections in container.blocks:
            before = blocks[-1] if blocks else None
            block = paper.read_block(sections, header, len(anchors), len(isolated), before)
            blocks.append(block)
    return Reel(
        container=container,
        internal_faces=internal,
        faces=faces,
        order=order,
        blocks=blocks,
        surface=read_surface(container, faces),
        anchors=anchors,
        start=number_of(container, "START"),
        promise=number_of(container, "PROMISE"),
        positions=positions,
    )


def number_of(container, section):
    """The number in a section that may not be there."""
    for payload in container.all_of(section):
        number = Payload(payload)
        found = number.number("d")
        number.end()
        return found
    return None


def read_reel_blocks(container, faces, order):
    """Integers and positions of the blocks of `reel`."""
    header, meshes, blocks, positions = container.header, {}, [], None
    for sections in container.blocks:
        block = read_reel_block(sections, header, faces, meshes)
        key = ()
        if block["reference"]:
            need(block["reference"] <= len(blocks), "there is no key block")
            other = blocks[-block["reference"]]
            need(other["reference"] == 0 and other["stencil"] == block["stencil"])
            key = other["values"]
        block["values"] = predict_fields(
            meshes[block["stencil"]], block["coefficients"], block["stencil"], block["learned"], key
        )
        blocks.append(block)
        scaled = [{v: one * block["step"] for v, one in row.items()} for row in block["values"]]
        bases = [basis_vector(row, block["frames"]) for row in block["basis"]]
        corrections = block["correction step"], block["corrections"]
        found = frames_of(bases, scaled, corrections, header, order)
        positions = found if positions is None else positions + found
    return blocks, positions


def read_reel_block(sections, header, faces, meshes):
    """The integers of a block; `meshes` keeps resolutions by the size of stencils."""
    head, layout = Payload(sections["BLOCK"]), Payload(sections["FIELDS"])
    n_frames, n_modes = head.varint(), head.varint()
    head.end()
    need(layout.byte() == 6, "the fields have a layout that is not known")
    reference, step, size, n_learned = (
        *(layout.varint(), layout.number("f")),
        *(layout.varint(), layout.varint()),
    )
    layout.end()
    need(1 <= size <= 16 and n_learned <= 255 and 0 < step < 1e6)
    if size not in meshes:
        meshes[size] = resolutions_of(faces, header.n_verts, size)
    corrections = 0.0, {}
    if "CORRECTIONS" in sections:
        corrections = read_corrections(sections["CORRECTIONS"], n_frames, header.n_verts)
    return {
        "frames": n_frames,
        "modes": n_modes,
        "reference": reference,
        "step": step,
        "stencil": size,
        "learned": n_learned,
        "basis": read_fields(sections["BASIS"], n_modes, passes_by_times(n_frames)),
        "coefficients": read_fields(sections["COEFFICIENTS"], n_modes, passes_of(meshes[size])),
        "correction step": corrections[0],
        "corrections": corrections[1],
    }


if __name__ == "__main__":
    print(json.dumps(describe(read(Path(sys.argv[1]).read_bytes())), indent=1))
