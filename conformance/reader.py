"""A plain reader of `.reel` streams, as docs/format.md has them; slow, and readable.

`python -m conformance.reader FILE` prints what it finds. It shares no code with the package
`meshreel`, and needs the standard library only: what both say of a stream is what the page says.
"""

import json
import math
import sys
from array import array
from dataclasses import dataclass
from pathlib import Path

from conformance import paper
from conformance.bits import need
from conformance.connectivity import read_faces
from conformance.container import Container, Payload, read_container
from conformance.description import describe
from conformance.exact import read_exact
from conformance.fields import read_fields
from conformance.hierarchy import edges_of, passes_of, resolutions_of
from conformance.order import read_order
from conformance.prediction import predict_fields
from conformance.surface import graphs_of, polygons_of, read_surface
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
    tracks : list
        Of each further track what it is, its blocks, and its values like positions.
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
    tracks: list


@dataclass
class Placement:
    """How numbers of a track go out: their type, and scale and origins for what is decoded."""

    number_type: int
    scale: float
    origin: tuple


@dataclass
class Items:
    """What has values: n vertices, faces or corners; `order` is how they go out.

    Those at a corner each of one of `faces` are next to each other. `found` keeps resolutions by
    the size of stencils.
    """

    faces: list
    n: int
    order: object
    found: dict

    @property
    def neighbours(self):
        """Those next to each, ascending."""
        near = edges_of(self.faces, self.n)
        return [sorted(near[v]) for v in range(self.n)]

    def resolutions(self, size):
        if size not in self.found:
            self.found[size] = resolutions_of(self.faces, self.n, size)
        return self.found[size]


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
    polygons = polygons_of(container, faces)
    blocks, anchors, positions, tracks = [], [], None, []
    if header.method == "reel":
        mesh = Items(internal, header.n_verts, order, {})
        (_, blocks, positions), *tracks = read_reel_tracks(container, mesh, polygons)
    else:
        isolated = [v for v, near in edges_of(internal, header.n_verts).items() if not near]
        if header.method != "v2v":
            anchors = paper.read_anchors(container.only("ANCHOR_VERTICES"), header.n_verts)
        for (sections,) in container.blocks:
            before = blocks[-1] if blocks else None
            block = paper.read_block(sections, header, len(anchors), len(isolated), before)
            blocks.append(block)
    return Reel(
        container=container,
        internal_faces=internal,
        faces=faces,
        order=order,
        blocks=blocks,
        surface=read_surface(container, polygons),
        anchors=anchors,
        start=number_of(container, "START"),
        promise=number_of(container, "PROMISE"),
        positions=positions,
        tracks=tracks,
    )


def number_of(container, section):
    """The number in a section that may not be there."""
    for payload in container.all_of(section):
        number = Payload(payload)
        found = number.number("d")
        number.end()
        return found
    return None


LETTERS = dict(zip((4, 8, 17, 18, 20, 24, 33, 34, 36, 40), "fdBHIQbhiq", strict=True))
"""Number types as `struct` and `array` write them."""

NORMALS = 3
"""Kind of a track of normals."""

COLUMNS = {1: (2, 3), 2: (3,), NORMALS: (3,), 4: (3, 4), 5: (2,), 6: (1,)}
"""Columns that tracks of some kinds may have."""


def read_track(payload):
    """The header of a further track, and how its numbers are placed."""
    payload = Payload(payload)
    kind, domain, number_type, coding = (payload.byte() for _ in range(4))
    name, unit, n_columns = payload.text(), payload.text(), payload.varint()
    need(kind < 7 and domain < 3 and coding < 2 and number_type in LETTERS)
    need(n_columns in COLUMNS.get(kind, range(1, 257)), "a track has columns that it cannot have")
    bound, scale, origin = 0.0, 1.0, [0.0] * n_columns
    if coding == 0:
        need(number_type in (4, 8), "modes are of floats")
        bound, scale, *origin = (payload.number("d") for _ in range(2 + n_columns))
    payload.end()
    said = {"name": name, "unit": unit, "kind": kind, "domain": domain, "coding": coding}
    return said | {"bound": bound}, Placement(number_type, scale, tuple(origin))


def of_unit_length(normals):
    """Normals divided by their length; 0 where that is below a half."""
    for at in range(0, len(normals), 3):
        x, y, z = normals[at : at + 3]
        length = math.sqrt((x * x + y * y) + z * z)
        for i, one in enumerate((x, y, z), start=at):
            normals[i] = 0.0 if length < 0.5 else one / length
    return normals


def read_reel_tracks(container, mesh, polygons):
    """Of positions and each further track: what it is, integers of its blocks, its values.

    Parameters
    ----------
    container : Container
    mesh : Items
        The vertices.
    polygons : Polygons
    """
    header, tracks = container.header, []
    placed = Placement(header.vertex_type, header.scale, header.origin)
    all_items = [mesh, *(Items(pairs, n, range(n), {}) for pairs, n in graphs_of(polygons))]
    lengths = [Payload(block[0]["BLOCK"]).varint() for block in container.blocks]
    further = [read_track(payload) for payload in container.all_of("TRACK")]
    for number, (said, place) in enumerate([({"domain": 0}, placed), *further]):
        blocks, values, items = [], None, all_items[said["domain"]]
        for block, n_frames in zip(container.blocks, lengths, strict=True):
            read = read_exact_block if said.get("coding") else read_reel_block
            integers, found = read(block[number], n_frames, place, blocks, items)
            blocks.append(integers)
            values = found if values is None else values + found
        if said.get("kind") == NORMALS:
            values = of_unit_length(values)
        tracks.append((said, blocks, values))
    return tracks


def read_reel_block(group, n_frames, placed, blocks, items):
    """Integers and values of a track in a block; `blocks` are those before."""
    block = read_integers(group, n_frames, len(placed.origin), items)
    key = ()
    if block["reference"]:
        need(block["reference"] <= len(blocks), "there is no key block")
        other = blocks[-block["reference"]]
        need(other["reference"] == 0 and other["stencil"] == block["stencil"])
        key = other["values"]
    resolutions = items.resolutions(block["stencil"])
    block["values"] = predict_fields(
        resolutions, block["coefficients"], block["stencil"], block["learned"], key
    )
    scaled = [{v: one * block["step"] for v, one in row.items()} for row in block["values"]]
    bases = [basis_vector(row, n_frames) for row in block["basis"]]
    corrections = block["correction step"], block["corrections"]
    values = frames_of(bases, scaled, block["precision"], corrections, placed, items.order)
    if "MISSING" in group:
        values = without_missing(values, group, n_frames, placed, items)
    return block, values


def read_exact_block(group, n_frames, placed, blocks, items):
    """The same of an exact track, which has no modes."""
    head = Payload(group["TRACK_BLOCK"])
    need(head.varint() == 0, "an exact track has modes")
    head.end()
    letter, shape = LETTERS[placed.number_type], (n_frames, items.n, len(placed.origin))
    rows = read_exact(group["VALUES"], shape, letter, items.neighbours)
    numbers, size = array(letter), array(letter).itemsize
    for frame in rows:
        for item in items.order:
            numbers.frombytes(b"".join(one.to_bytes(size, sys.byteorder) for one in frame[item]))
    return {"frames": n_frames, "modes": 0}, numbers


def without_missing(values, group, n_frames, placed, items):
    """Values of a block, with NaN where the file says so."""
    shape = n_frames, items.n, len(placed.origin)
    rows = read_exact(group["MISSING"], shape, "B", items.neighbours)
    flags = (flag for frame in rows for item in items.order for flag in frame[item])
    for place, flag in enumerate(flags):
        need(flag < 2, "a value is neither there nor missing")
        if flag:
            values[place] = math.nan
    return values


def read_integers(group, n_frames, n_columns, items):
    """The integers of a track in a block."""
    is_first = "BLOCK" in group
    head, layout = Payload(group["BLOCK" if is_first else "TRACK_BLOCK"]), Payload(group["FIELDS"])
    if is_first:
        head.varint()
    n_modes = head.varint()
    head.end()
    need(1 <= n_modes <= n_columns * n_frames)
    precision = layout.byte()
    need(precision in (4, 8), "the fields have a layout that is not known")
    reference, step, size, n_learned = (
        *(layout.varint(), layout.number("f")),
        *(layout.varint(), layout.varint()),
    )
    layout.end()
    need(1 <= size <= 16 and n_learned <= 255 and 0 < step < 1e6)
    corrections = 0.0, {}
    if "CORRECTIONS" in group:
        corrections = read_corrections(group["CORRECTIONS"], n_columns, n_frames, items.n)
    passes = passes_of(items.resolutions(size))
    return {
        "frames": n_frames,
        "modes": n_modes,
        "reference": reference,
        "step": step,
        "precision": precision,
        "stencil": size,
        "learned": n_learned,
        "basis": read_fields(group["BASIS"], n_modes, passes_by_times(n_columns, n_frames)),
        "coefficients": read_fields(group["COEFFICIENTS"], n_modes, passes),
        "correction step": corrections[0],
        "corrections": corrections[1],
    }


if __name__ == "__main__":
    print(json.dumps(describe(read(Path(sys.argv[1]).read_bytes())), indent=1))
