"""A plain reader of `.reel` streams, as docs/format.md has them; slow, and readable.

`python -m conformance.reader FILE` prints what it finds. It shares no code with the package
`meshreel`, and needs the standard library only: what both say of a stream is what the page says.
"""

import json
import math
import struct
import sys
from array import array
from dataclasses import dataclass, replace
from pathlib import Path

from conformance import paper, predicted
from conformance.bits import Memory, need
from conformance.connectivity import read_faces
from conformance.container import Container, Payload, read_container, read_containers
from conformance.description import describe_all
from conformance.exact import read_exact
from conformance.fields import read_fields
from conformance.hierarchy import edges_of, passes_of, resolutions_of
from conformance.order import read_order
from conformance.prediction import predict_fields
from conformance.rounding import single
from conformance.surface import CornerRows, graphs_of, polygons_of, read_surface
from conformance.timeline import (
    basis_vectors,
    frames_of,
    length_of,
    pass_of_cosines,
    passes_by_times,
    read_corrections,
    read_rests,
    resting_times,
)

DEFAULT_MEMORY = Memory()


@dataclass
class Reel:
    """A segment, decoded.

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
    shape : tuple of list and list, or None
        Steps and integers of the shape that cotangent weights are measured in.
    positions : array of float, or None
        Of `reel`, `lossless` and `grid`, as they go out: frames, vertices, x y z. Of other methods
        integers are defined.
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
    shape: tuple | None
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
    the size of stencils. Where corners share values, `corners` are the values that they have as
    these go out; `vertices` are those of rows, as they go out.
    """

    faces: list
    n: int
    order: object
    found: dict
    corners: object = None
    vertices: object = None

    @property
    def neighbours(self):
        """Those next to each, ascending."""
        near = edges_of(self.faces, self.n)
        return [sorted(near[v]) for v in range(self.n)]

    def resolutions(self, size):
        if size not in self.found:
            self.found[size] = resolutions_of(self.faces, self.n, size)
        return self.found[size]


def read_all(data, memory=DEFAULT_MEMORY):
    """The segments of a stream, decoded; as `read`, of each."""
    return [read_segment(container, memory) for container in read_containers(data)]


def read(data, memory=DEFAULT_MEMORY):
    """A stream of one segment, decoded.

    Parameters
    ----------
    data : bytes
    memory : Memory
        What the mesh, each block, a table of an attribute and all positions or values of a track
        may take; what is announced is compared with it before it is decoded.

    Raises
    ------
    DamagedError
        If a rule of the page is broken; other errors may be raised, too.
    TooLargeError
        If more memory is needed than allowed.
    """
    return read_segment(read_container(data), memory)


def read_segment(container, memory):
    """A segment, decoded."""
    header = container.header
    need_memory(container, memory)
    internal = read_faces(container.only("CONNECTIVITY"), header.n_verts, header.n_faces)
    order, faces = list(range(header.n_verts)), internal
    if header.order < 2:
        order, faces = read_order(container.only("ORDER"), internal, header.n_verts)
    polygons = polygons_of(container, faces)
    blocks, anchors, shape, positions, tracks = [], [], None, None, []
    if header.method in ("reel", "lossless", "grid"):
        mesh = Items(internal, header.n_verts, order, {})
        (_, blocks, positions), *tracks = read_reel_tracks(container, mesh, polygons, memory)
    else:
        isolated = [v for v, near in edges_of(internal, header.n_verts).items() if not near]
        if header.method != "v2v":
            anchors = paper.read_anchors(container.only("ANCHOR_VERTICES"), header.n_verts)
        if header.laplacian == COTANGENT:
            shape = paper.read_shape(container.only("SHAPE"), header.n_verts)
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
        surface=read_surface(container, polygons, memory),
        anchors=anchors,
        shape=shape,
        start=number_of(container, "START"),
        promise=number_of(container, "PROMISE"),
        positions=positions,
        tracks=tracks,
    )


def need_memory(container, memory):
    """Refuse a mesh, a block or positions that take too much."""
    header = container.header
    n, m = header.n_verts, header.n_faces
    memory.need(512 * n + 128 * m, "the mesh")
    n_all = 0
    for block, *_ in container.blocks:
        head = Payload(block["BLOCK"])
        n_frames, n_modes = head.varint(), head.varint()
        n_all += n_frames
        memory.need(24 * n_modes * (n + 3 * n_frames), "the modes of a block")
    memory.need(24 * n * n_all, "positions")


def number_of(container, section):
    """The number in a section that may not be there."""
    for payload in container.all_of(section):
        number = Payload(payload)
        found = number.number("d")
        number.end()
        need(math.isfinite(found) and (section != "PROMISE" or found > 0))
        return found
    return None


LETTERS = dict(zip((4, 8, 17, 18, 20, 24, 33, 34, 36, 40), "fdBHIQbhiq", strict=True))
"""Number types as `struct` and `array` write them."""

COTANGENT = 2
"""Laplacian of cotangent weights."""

EXACT = 1
"""Coding of an exact track."""

CORNERS, BY_VERTEX, BY_ROW = 2, 3, 4
"""Domains of tracks of corners: each has its value, or its vertex has it, or its row."""

VELOCITIES, NORMALS = 2, 3
"""Kinds of tracks."""

COLUMNS = {1: (2, 3), VELOCITIES: (3,), NORMALS: (3,), 4: (3, 4), 5: (2,), 6: (1,)}
"""Columns that tracks of some kinds may have."""


def read_track(payload):
    """The header of a further track, and how its numbers are placed."""
    payload = Payload(payload)
    kind, domain, number_type, coding = (payload.byte() for _ in range(4))
    name, unit, n_columns = payload.text(), payload.text(), payload.varint()
    need(kind < 7 and domain < 5 and coding < 9 and number_type in LETTERS)
    need(n_columns in COLUMNS.get(kind, range(1, 257)), "a track has columns that it cannot have")
    said = {"name": name, "unit": unit, "kind": kind, "domain": domain, "coding": coding}
    bound, scale, origin = 0.0, 1.0, [0.0] * n_columns
    if not predicted.is_exact(coding):
        bound, scale = payload.number("d"), payload.number("d")
    need(coding == EXACT or number_type in (4, 8), "modes and differences are of floats")
    if coding == 0:
        origin = [payload.number("d") for _ in range(n_columns)]
    elif coding == predicted.TURNS:
        need(kind == NORMALS, "what is turned is no normal")
        origin = [0.0] * 2
    elif coding != EXACT:
        need(kind == VELOCITIES and domain in (0, BY_VERTEX), "differences are of vertices")
        said["rate"] = payload.number("d")
    if domain == BY_ROW:
        said["rows"] = payload.rest()
    payload.end()
    return said | {"bound": bound}, Placement(number_type, scale, tuple(origin))


def of_unit_length(normals):
    """Normals divided by their length; 0 where that is below a half."""
    for at in range(0, len(normals), 3):
        x, y, z = normals[at : at + 3]
        length = math.sqrt((x * x + y * y) + z * z)
        for i, one in enumerate((x, y, z), start=at):
            normals[i] = 0.0 if length < 0.5 else one / length
    return normals


def read_reel_tracks(container, mesh, polygons, memory):
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
    all_items.append(replace(mesh, corners=polygons.vertices_of_corners()))
    lengths = [Payload(block[0]["BLOCK"]).varint() for block in container.blocks]
    further = [read_track(payload) for payload in container.all_of("TRACK")]
    positions = {"domain": 0, "coding": int(header.method != "reel")}
    for number, (said, place) in enumerate([(positions, placed), *further]):
        blocks, values, rows = [], None, said.pop("rows", None)
        items = all_items[said["domain"]] if rows is None else of_rows(rows, mesh, all_items)
        coding = said.get("coding", 0)
        n_values = max(items.n, len(items.corners or ())) * len(place.origin)
        memory.need(8 * n_values * sum(lengths), "a track")
        for block, n_frames in zip(container.blocks, lengths, strict=True):
            need_modes(block[number], n_values, len(place.origin) * n_frames, memory)
            read = read_exact_block if predicted.is_exact(coding) else read_reel_block
            if said is positions and header.method == "grid":
                read = read_grid_block
            integers, found = read(block[number], n_frames, place, blocks, items, coding)
            if coding > EXACT:
                at, size = sum(one["frames"] for one in blocks), 3 * mesh.n
                points = tracks[0][2][at * size : (at + n_frames) * size]
                letter = LETTERS[place.number_type]
                found = predicted.predicted_values(
                    said, found, points, mesh, polygons, letter, items.vertices
                )
            elif said.get("kind") == NORMALS:
                found = of_unit_length(found)
            if "MISSING" in block[number]:
                n_columns = len(found) // (n_frames * items.n)
                found = without_missing(found, block[number], (n_frames, items.n, n_columns), items)
            if items.corners is not None:
                found = spread(found, n_frames, items)
            blocks.append(integers)
            values = found if values is None else values + found
        tracks.append((said | {"domain": min(said["domain"], CORNERS)}, blocks, values))
    return tracks


def need_modes(group, n_values, n_times, memory):
    """Refuse modes and corrections of a block that take too much."""
    if "FIELDS" in group:
        head = Payload(group["BLOCK" if "BLOCK" in group else "TRACK_BLOCK"])
        if "BLOCK" in group:
            head.varint()
        memory.need(8 * head.varint() * (n_values + n_times), "the modes of a block")
    if "CORRECTIONS" in group:
        head = Payload(group["CORRECTIONS"])
        head.number("f")
        head.varint()
        memory.need(8 * head.varint() * 6, "corrections")


def of_rows(payload, mesh, all_items):
    """The rows that corners share."""
    vertices = all_items[BY_VERTEX].corners
    rows = CornerRows(payload, [mesh.order[vertex] for vertex in vertices], mesh.n)
    of_row = dict(zip(mesh.order, range(mesh.n), strict=True))
    of_row.update(zip(rows.of_corners, vertices, strict=True))
    pairs = rows.pairs(all_items[CORNERS].faces)
    return Items(pairs, rows.n, range(rows.n), {}, rows.of_corners, of_row)


def spread(values, n_frames, items):
    """Values of a block for each corner."""
    width, found = len(values) // (n_frames * items.n), array(values.typecode)
    for t in range(n_frames):
        for item in items.corners:
            place = (t * items.n + item) * width
            found += values[place : place + width]
    return found


def read_reel_block(group, n_frames, placed, blocks, items, coding):
    """Integers and values of a track in a block; `blocks` are those before.

    Values of a track that is predicted are not rounded.
    """
    block = read_integers(group, n_frames, len(placed.origin), items)
    key = []
    if block["reference"]:
        need(block["reference"] <= len(blocks), "there is no key block")
        other = blocks[-block["reference"]]
        need(other["reference"] == 0 and other["stencil"] == block["stencil"])
        key = other["values"]
    n_reused = block.get("reused", 0)
    need(n_reused <= len(key), "the key block has fewer fields than are reused")
    reused = key[:n_reused]
    resolutions = items.resolutions(block["stencil"])
    block["values"] = reused + predict_fields(
        resolutions, block["coefficients"], block["stencil"], block["learned"], key
    )
    scaled = [{v: one * block["step"] for v, one in row.items()} for row in block["values"]]
    # Fields have their vertices in the order in which they were decoded.
    lengths = [length_of(field.values()) / block["finer"] for field in reused]
    lengths += [None] * len(block["coefficients"])
    rests, rest_bits = resting_times(block.get("rests", [])), block.get("rest bits", 0)
    kind = next((one for one in ("cosines", "adaptive") if one in block), "")
    bases = basis_vectors(block["basis"], n_frames, lengths, n_reused, rests, rest_bits, kind)
    corrections = block["correction step"], block["corrections"]
    if coding:
        placed = replace(placed, number_type=8)
    return block, frames_of(bases, scaled, block["precision"], corrections, placed, items.order)


def read_exact_block(group, n_frames, placed, blocks, items, coding):
    """The same of an exact track, or of positions of `lossless`, which have no modes."""
    head = Payload(group["BLOCK"] if "BLOCK" in group else group["TRACK_BLOCK"])
    if "BLOCK" in group:
        head.varint()
    need(head.varint() == 0, "exact values have modes")
    head.end()
    letter = LETTERS[placed.number_type if coding <= EXACT else placed.number_type + 32]
    shape = (n_frames, items.n, len(placed.origin))
    rows = read_exact(group["VALUES"], shape, letter, items.neighbours)
    numbers, size = array(letter), array(letter).itemsize
    for frame in rows:
        for item in items.order:
            numbers.frombytes(b"".join(one.to_bytes(size, sys.byteorder) for one in frame[item]))
    return {"frames": n_frames, "modes": 0}, numbers


def read_grid_block(group, n_frames, placed, blocks, items, coding):
    """The same of positions of `grid`: behind the step, integers, or what they stand for."""
    (step,) = struct.unpack("<d", group["VALUES"][:8])
    need(0 <= step <= 1, "the step of a grid is none")
    rest = {**group, "VALUES": group["VALUES"][8:]}
    if step == 0:
        return read_exact_block(rest, n_frames, placed, blocks, items, coding)
    whole = replace(placed, number_type=36)
    found, places = read_exact_block(rest, n_frames, whole, blocks, items, coding)
    numbers = array(LETTERS[placed.number_type])
    for place, n in enumerate(places):
        value = n * step * placed.scale + placed.origin[place % 3]
        numbers.append(single(value) if placed.number_type == 4 else value)
    need(all(map(math.isfinite, numbers)), "positions are not finite")
    return found, numbers


def without_missing(values, group, shape, items):
    """Values of a block, with NaN where the file says so."""
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
    layout_number = layout.byte()
    precision, has_rests = layout_number & ~(16 + 32 + 64), layout_number & 16
    cosines, is_adaptive = layout_number & 32, layout_number & 64
    need(precision in (4, 8), "the fields have a layout that is not known")
    need(not (has_rests and cosines), "times rest in a block with cosines")
    need(not (is_adaptive and cosines), "times are adaptive in a block with cosines")
    need(n_frames <= 1024 or not cosines, "a block with cosines is too long")
    reference, step, size, n_learned = (
        *(layout.varint(), layout.number("f")),
        *(layout.varint(), layout.varint()),
    )
    rest_bits, rests = read_rests(layout, n_frames) if has_rests else (0, [])
    n_reused, finer = 0, 0.0
    if reference and layout.position < len(layout.data):
        n_reused, finer = layout.varint(), layout.number("f")
        need(0 < n_reused <= n_modes and 0 < finer < 1e6)
    layout.end()
    need(1 <= size <= 16 and n_learned <= 255 and 0 < step < 1e6)
    corrections = 0.0, {}
    if "CORRECTIONS" in group:
        corrections = read_corrections(group["CORRECTIONS"], n_columns, n_frames, items.n)
    passes = passes_of(items.resolutions(size))
    times = passes_by_times(n_columns, n_frames, resting_times(rests))
    times = pass_of_cosines(n_columns, n_frames) if cosines else times
    return {
        "frames": n_frames,
        "modes": n_modes,
        "reference": reference,
        "step": step,
        "precision": precision,
        "stencil": size,
        "learned": n_learned,
        **({"rests": rests, "rest bits": rest_bits} if rests else {}),
        **({"cosines": 1} if cosines else {}),
        **({"adaptive": 1} if is_adaptive else {}),
        **({"reused": n_reused, "finer": finer} if n_reused else {}),
        "basis": read_fields(group["BASIS"], n_modes, times),
        "coefficients": read_fields(group["COEFFICIENTS"], n_modes - n_reused, passes),
        "correction step": corrections[0],
        "corrections": corrections[1],
    }


if __name__ == "__main__":
    print(json.dumps(describe_all(read_all(Path(sys.argv[1]).read_bytes())), indent=1))
