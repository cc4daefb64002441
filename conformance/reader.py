"""A plain reader of `.reel` streams, written from docs/format.md: slow, but readable.

`python -m conformance.reader FILE` prints a description of a stream. The reader shares no code with
the package `meshreel`, and needs only the standard library: comparing both verifies the page.
"""

import json
import math
import struct
import sys
from array import array
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from conformance import paper, predicted
from conformance.bits import Memory, integers, need
from conformance.cells import read_cells
from conformance.container import (
    OF_MODES,
    OF_MODES_OF_A_TRACK,
    OF_VALUES,
    Container,
    Payload,
    read_container,
    read_containers,
)
from conformance.description import describe_all
from conformance.edit import read_mesh
from conformance.exact import read_exact
from conformance.fields import read_fields
from conformance.hierarchy import edges_of, passes_of, resolutions_of
from conformance.order import twins_of
from conformance.points import points_of
from conformance.prediction import predict_fields
from conformance.rounding import single
from conformance.surface import CornerRows, graphs_of, polygons_of, read_surface
from conformance.surface_integers import read_surface_integers
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
        In internal and in output order.
    order : list of int
        The internal number of each vertex in output order.
    blocks : list of dict
        Integers of each block by section, as lists or lists of rows.
    surface : dict
    start, error_bound : float, or None if absent
    times : list of float, or None if absent
    anchors : list of int
    shape : tuple of list and list, or None
        Steps and integers of the shape of cotangent weights.
    positions : array of float, or None
        Frames, vertices, x y z in output order, for `reel`, `lossless` and `grid`. Other methods
        define integers only.
    cells : Cells, optional
        In output order.
    tracks : list
        For each further track its fields, its blocks, and its values like positions.
    """

    container: Container
    internal_faces: list
    faces: list
    order: list
    blocks: list
    surface: dict
    start: float | None
    times: list | None
    error_bound: float | None
    anchors: list
    shape: tuple | None
    positions: object
    tracks: list
    cells: object = None


@dataclass
class Placement:
    """Number type of a track, and scale and origins of decoded numbers."""

    number_type: int
    scale: float
    origin: tuple


@dataclass
class Items:
    """The n vertices, faces, corners or rows with values; `order` lists them in output order.

    Items at corners of one of `faces` are adjacent. `cache` has resolutions by stencil size. If
    corners share values, `corners` has the item of each corner, and `vertices` the vertex of each
    row, in output order; `twins` are those of the sides of faces. `links` are the adjacent pairs
    of a mesh of cells.
    """

    faces: list
    n: int
    order: object
    cache: dict
    corners: object = None
    vertices: object = None
    twins: list | None = None
    links: list | None = None

    @property
    def neighbors(self):
        """Return the neighbors of each item, ascending."""
        near = edges_of(self.links or self.faces, self.n)
        return [sorted(near[v]) for v in range(self.n)]

    def resolutions(self, size):
        if size not in self.cache:
            self.cache[size] = resolutions_of(self.links or self.faces, self.n, size)
        return self.cache[size]


def read_all(data, memory=DEFAULT_MEMORY):
    """Decode all segments of a stream; see `read`."""
    return [read_segment(container, memory) for container in read_containers(data)]


def read(data, memory=DEFAULT_MEMORY):
    """Decode a stream of one segment.

    Parameters
    ----------
    data : bytes
    memory : Memory
        Limit for each of: the mesh, a block, a table of an attribute, all values of a track.
        Announced sizes are checked before decoding.

    Raises
    ------
    DamagedError
        If a rule of the page is broken; other errors are possible too.
    TooLargeError
        If the memory limit is too low.
    """
    return read_segment(read_container(data), memory)


def read_segment(container, memory):
    """Decode a segment."""
    header = container.header
    check_memory(container, memory)
    cells = None
    if container.all_of("CELLS"):
        internal, order, faces, cells = read_cells(container)
        twins = twins_of(internal)
    else:
        internal, twins, order, faces = read_mesh(container)
    polygons = polygons_of(container, faces, cells)
    blocks, anchors, shape, positions, tracks = [], [], None, None, []
    if header.method in ("reel", "lossless", "grid"):
        mesh = Items(internal, header.n_verts, order, {}, twins=twins)
        mesh.links = cells and cells.links
        read = read_reel_tracks(container, mesh, polygons, cells, memory)
        (_, blocks, positions), *tracks = read
    else:
        need(cells is None, "cells come with a method of the paper")
        isolated = [v for v, near in edges_of(internal, header.n_verts).items() if not near]
        if header.method != "v2v":
            anchors = paper.read_anchors(container.only("ANCHOR_VERTICES"), header.n_verts)
        if header.laplacian == COTANGENT:
            shape = paper.read_shape(container.only("SHAPE"), header.n_verts)
        for (sections,) in container.blocks:
            previous = blocks[-1] if blocks else None
            block = paper.read_block(sections, header, len(anchors), len(isolated), previous)
            blocks.append(block)
    return Reel(
        container=container,
        internal_faces=internal,
        faces=faces,
        order=order,
        blocks=blocks,
        surface=read_surface(container, polygons, memory, positions),
        cells=cells,
        anchors=anchors,
        shape=shape,
        start=number_of(container, "START"),
        times=container.times,
        error_bound=number_of(container, "ERROR_BOUND"),
        positions=positions,
        tracks=tracks,
    )


def check_memory(container, memory):
    """Check the memory of the mesh, the blocks and the positions."""
    header = container.header
    n, m = header.n_verts, header.n_faces
    memory.check(512 * n + 128 * m, "the mesh")
    n_all = 0
    for block, *_ in container.blocks:
        head = Payload(block["BLOCK"])
        n_frames, n_modes = head.varint(), head.varint()
        n_all += n_frames
        memory.check(24 * n_modes * (n + 3 * n_frames), "the modes of a block")
    memory.check(24 * n * n_all, "positions")


def number_of(container, section):
    """Return the number in an optional section, or None."""
    for payload in container.all_of(section):
        number = Payload(payload)
        if len(payload) == 8:
            value = number.number("d")
        else:
            n_decimals, digits = number.byte(), number.varint()
            value = float(digits) / math.prod([10.0] * n_decimals)
        number.end()
        need(math.isfinite(value) and (section != "ERROR_BOUND" or value > 0))
        return value
    return None


LETTERS = dict(zip((4, 8, 17, 18, 20, 24, 33, 34, 36, 40), "fdBHIQbhiq", strict=True))
"""Number types as letters of `struct` and `array`."""

COTANGENT = 2
"""Laplacian with cotangent weights."""

EXACT = 1
"""Coding of an exact track."""

CORNERS, BY_VERTEX, BY_ROW, OF_CELLS = 2, 3, 4, 5
"""Domains of tracks of corners: values of each corner, of vertices, or of rows; and of cells."""

RETURNED = (0, 1, 2, 2, 2, 3)
"""Domains as readers return them."""

VELOCITIES, NORMALS = 2, 3
"""Kinds of tracks."""

COLUMNS = {1: (2, 3), VELOCITIES: (3,), NORMALS: (3,), 4: (3, 4), 5: (2,), 6: (1,)}
"""Allowed numbers of columns by kind; other kinds have 1 to 256."""


def read_track(payload):
    """Return the fields of a TRACK, and its placement."""
    payload = Payload(payload)
    kind, domain, number_type, coding = (payload.byte() for _ in range(4))
    has_bound, letter, coding = coding & 16 > 0, "f" if coding & 32 else "d", coding & ~48
    name, unit, n_columns = payload.text(), payload.text(), payload.varint()
    need(kind < 7 and domain < 6 and coding < 9 and number_type in LETTERS)
    need(n_columns in COLUMNS.get(kind, range(1, 257)), "a track has a wrong number of columns")
    track = {"name": name, "unit": unit, "kind": kind, "domain": domain, "coding": coding}
    bound, scale, origin = 0.0, 1.0, [0.0] * n_columns
    if has_bound:
        need(predicted.is_exact(coding), "only exact tracks may have a bound of their source")
        bound = payload.number(letter)
        need(0 < bound < math.inf, "the bound of an exact track is not positive and finite")
    elif not predicted.is_exact(coding):
        bound, scale = payload.number(letter), payload.number(letter)
        need(0 <= bound < math.inf and 0 < scale < math.inf, "a bound or scale is out of range")
    need(coding == EXACT or number_type in (4, 8), "modes and differences require floats")
    if coding == 0:
        origin = [payload.number(letter) for _ in range(n_columns)]
        need(all(map(math.isfinite, origin)), "an origin is not finite")
    elif coding == predicted.ROTATED:
        need(kind == NORMALS and domain != OF_CELLS, "a rotated track does not contain normals")
        origin = [0.0] * 2
    elif coding != EXACT:
        need(
            kind == VELOCITIES and domain in (0, BY_VERTEX),
            "differences require velocities",
        )
        track["rate"] = payload.number(letter)
        need(math.isfinite(track["rate"]), "a rate is not finite")
    if domain == BY_ROW:
        track["rows"] = payload.rest()
    payload.end()
    return track | {"bound": bound}, Placement(number_type, scale, tuple(origin))


def normalized(normals):
    """Normalize vectors in place; those shorter than 1/2 become 0."""
    for at in range(0, len(normals), 3):
        x, y, z = normals[at : at + 3]
        length = math.sqrt((x * x + y * y) + z * z)
        for i, value in enumerate((x, y, z), start=at):
            normals[i] = 0.0 if length < 0.5 else value / length
    return normals


def read_reel_tracks(container, mesh, polygons, cells, memory):
    """Return the fields, the integers per block, and the values of each track, positions first.

    Parameters
    ----------
    container : Container
    mesh : Items
        The vertices.
    polygons : Polygons
    """
    header, tracks = container.header, []
    placement = Placement(header.vertex_type, header.scale, header.origin)
    all_items = [mesh, *(Items(pairs, n, range(n), {}) for pairs, n in graphs_of(polygons))]
    all_items.append(replace(mesh, corners=polygons.vertices_of_corners()))
    if cells:
        n_cells = len(cells.cells)
        all_items += [None, Items(cells.neighbors, n_cells, range(n_cells), {})]
    lengths = [Payload(block[0]["BLOCK"]).varint() for block in container.blocks]
    further = [read_track(payload) for payload in container.all_of("TRACK")]
    names = {track["name"] for track, _ in further}
    need(len(names) == len(further), "two tracks have the same name")
    positions = {"domain": 0, "coding": int(header.method != "reel")}
    for number, (track, placed) in enumerate([(positions, placement), *further]):
        blocks, values, rows = [], None, track.pop("rows", None)
        need(track["domain"] != OF_CELLS or cells, "a track is of cells, and there are none")
        items = all_items[track["domain"]] if rows is None else items_of_rows(rows, mesh, all_items)
        coding = track.get("coding", 0)
        n_values = max(items.n, len(items.corners or ())) * len(placed.origin)
        memory.check(8 * n_values * sum(lengths), "a track")
        for block, n_frames in zip(container.blocks, lengths, strict=True):
            check_modes(block[number], n_values, len(placed.origin) * n_frames, memory)
            read = read_exact_block if predicted.is_exact(coding) else read_reel_block
            may_be_grid = track is positions and read is read_exact_block
            if may_be_grid and (header.method == "grid" or "ROUNDING" in block[0]):
                read = read_grid_block
            elif number and read is read_reel_block and "VALUES" in block[number]:
                need(block[number]["VALUES"][:1] in (b"\1", b"\5"), "a grid has an unknown form")
                read = read_grid_block
            first, size = sum(coded["frames"] for coded in blocks), 3 * mesh.n

            def points(at=first * size, items=items, domain=track["domain"]):
                frame = list(tracks[0][2][at : at + 3 * mesh.n])
                nodes = cells and [cell.nodes for cell in cells.cells]
                return points_of(domain, frame, items, polygons, nodes)

            kind = track["domain"], rows
            others = points, partial(related_fields, tracks[1:], len(blocks), kind)
            integers, numbers = read(block[number], n_frames, placed, blocks, items, coding, others)
            integers["items"] = kind
            if coding > EXACT:
                moving = tracks[0][2][first * size : (first + n_frames) * size]
                letter = LETTERS[placed.number_type]
                numbers = predicted.predicted_values(
                    track, numbers, moving, mesh, polygons, letter, items.vertices
                )
            elif track.get("kind") == NORMALS and coding != EXACT:
                numbers = normalized(numbers)
            if "MISSING" in block[number]:
                shape = (n_frames, items.n, len(numbers) // (n_frames * items.n))
                numbers = without_missing(numbers, block[number], shape, items)
            if items.corners is not None:
                numbers = spread(numbers, n_frames, items)
            blocks.append(integers)
            values = numbers if values is None else values + numbers
        need(track is not positions or all(map(math.isfinite, values)), "a position is not finite")
        tracks.append((track | {"domain": RETURNED[track["domain"]]}, blocks, values))
    return tracks


def check_modes(group, n_values, n_times, memory):
    """Check the memory of modes and corrections of a block."""
    if "FIELDS" in group:
        head = Payload(group["BLOCK" if "BLOCK" in group else "TRACK_BLOCK"])
        if "BLOCK" in group:
            head.varint()
        memory.check(8 * head.varint() * (n_values + n_times), "the modes of a block")
    if "CORRECTIONS" in group:
        head = Payload(group["CORRECTIONS"])
        head.number("f")
        head.varint()
        memory.check(8 * head.varint() * 6, "corrections")


def items_of_rows(payload, mesh, all_items):
    """Return the rows that corners share."""
    vertices = all_items[BY_VERTEX].corners
    rows = CornerRows(payload, [mesh.order[vertex] for vertex in vertices], mesh.n)
    row_vertices = dict(zip(mesh.order, range(mesh.n), strict=True))
    row_vertices.update(zip(rows.of_corners, vertices, strict=True))
    pairs = rows.pairs(all_items[CORNERS].faces)
    return Items(pairs, rows.n, range(rows.n), {}, rows.of_corners, row_vertices)


def spread(values, n_frames, items):
    """Return the values of each corner in a block."""
    width, result = len(values) // (n_frames * items.n), array(values.typecode)
    for t in range(n_frames):
        for item in items.corners:
            start = (t * items.n + item) * width
            result += values[start : start + width]
    return result


MAX_RELATIONS = 8


def related_fields(tracks, number, items, distance):
    """Return the fields of a block that are related to those of the next track of these items.

    Also returns the length of their chain. `tracks` are those before, without the positions.
    """
    need(distance <= len(tracks), "a track is related to one before the first")
    block = tracks[-distance][1][number]
    need("values" in block and block["items"] == items, "a related track has other items")
    need(block.get("relations", 0) < MAX_RELATIONS, "a chain of related tracks is too long")
    return block["values"], block.get("relations", 0) + 1


def read_reel_block(group, n_frames, placed, blocks, items, coding, others):
    """Return integers and values of a track in a block; `blocks` are the previous ones.

    Values of a predicted track are not rounded.
    """
    block = read_integers(group, n_frames, len(placed.origin), items)
    key = []
    if block["reference"]:
        need(block["reference"] <= len(blocks), "the key block does not exist")
        key_block = blocks[-block["reference"]]
        need(key_block.get("reference") == 0 and key_block["stencil"] == block["stencil"])
        key = key_block["values"]
    n_reused = block.get("reused", 0)
    need(n_reused <= len(key), "the key block has fewer fields than are reused")
    reused = key[:n_reused]
    resolutions = items.resolutions(block["stencil"])
    nugget, (points, related) = 2.0 ** (8 - block["nugget"]) if "nugget" in block else 0.0, others
    fields = []
    if "related" in block:
        fields, block["relations"] = related(block["related"])
    block["values"] = reused + predict_fields(
        resolutions,
        block["coefficients"],
        block["stencil"],
        block["learned"],
        key,
        points() if nugget else None,
        nugget,
        fields,
    )
    scaled = [{v: x * block["step"] for v, x in field.items()} for field in block["values"]]
    # A field lists its vertices in decoding order.
    lengths = [length_of(field.values()) / block["finer"] for field in reused]
    lengths += [None] * len(block["coefficients"])
    rests, rest_bits = resting_times(block.get("rests", [])), block.get("rest bits", 0)
    kind = next((kind for kind in ("cosines", "adaptive") if kind in block), "")
    bases = basis_vectors(block["basis"], n_frames, lengths, n_reused, rests, rest_bits, kind)
    corrections = block["correction step"], block["corrections"]
    if coding:
        placed = replace(placed, number_type=8)
    return block, frames_of(bases, scaled, block["precision"], corrections, placed, items.order)


def need_no_modes(group):
    """Raise DamagedError if a group with VALUES has modes."""
    head = Payload(group["BLOCK"] if "BLOCK" in group else group["TRACK_BLOCK"])
    if "BLOCK" in group:
        head.varint()
    need(head.varint() == 0 and set(group) <= OF_VALUES, "a group with VALUES has modes")
    head.end()


def read_exact_block(group, n_frames, placed, blocks, items, coding, _):
    """Return the same for an exact track, or positions of `lossless`."""
    need_no_modes(group)
    letter = LETTERS[placed.number_type if coding <= EXACT else placed.number_type + 32]
    shape = (n_frames, items.n, len(placed.origin))
    rows = read_exact(group["VALUES"], shape, letter, items.neighbors)
    numbers, size = array(letter), array(letter).itemsize
    for frame in rows:
        for item in items.order:
            numbers.frombytes(b"".join(bits.to_bytes(size, sys.byteorder) for bits in frame[item]))
    return {"frames": n_frames, "modes": 0}, numbers


def read_grid_block(group, n_frames, placed, blocks, items, coding, _):
    """Return the same for values on a grid, or exact positions of `grid`."""
    form, rest = group["VALUES"][0], {name: group[name] for name in group if name != "MISSING"}
    need(form in (0, 1, 2, 5, 6, 10, 14), "the form of values on a grid is unknown")
    if coding > EXACT:
        placed = replace(placed, number_type=8)
    n_stored = 1 if form & 8 else n_frames
    offsets = read_rounding(rest.pop("ROUNDING", None), n_stored * items.n)
    if form == 0:
        need(not offsets, "there is no grid to round")
        rest["VALUES"] = group["VALUES"][1:]
        return read_exact_block(rest, n_frames, placed, blocks, items, coding, None)
    number, start = ("<f", 5) if form & 4 else ("<d", 9)
    (step,) = struct.unpack(number, group["VALUES"][1:start])
    need(0 < step <= 1, "the step of a grid is not in 0..1")
    rest["VALUES"] = group["VALUES"][start:]
    if form & 2:
        need_no_modes(rest)
        frames = read_surface_integers(
            rest["VALUES"], n_stored, items.n, 3, items.faces, items.twins
        )
        block = {"frames": n_frames, "modes": 0}
        integers = [number for rows in frames for item in items.order for number in rows[item]]
    else:
        whole = replace(placed, number_type=36)
        block, integers = read_exact_block(rest, n_frames, whole, blocks, items, 0, None)
    n_columns = len(placed.origin)
    block["values"] = [
        dict(zip(items.order, integers[column:][::n_columns][at : at + items.n], strict=True))
        for at in range(0, len(integers) // n_columns, items.n)
        for column in range(n_columns)
    ]
    numbers = array(LETTERS[placed.number_type])
    for i, n in enumerate(integers):
        value = n * step * placed.scale + placed.origin[i % len(placed.origin)]
        numbers.append(single(value) if placed.number_type == 4 else value)
        offset = offsets[i % 3].get(n, 0) if offsets else 0
        if offset:
            numbers[i] = predicted.float_after(numbers[i], offset, LETTERS[placed.number_type])
    return block, numbers * (n_frames // n_stored)


def read_rounding(payload, n_positions):
    """Return the offsets by coordinate of each axis, or nothing."""
    if payload is None:
        return []
    payload = Payload(payload)
    counts = [payload.varint() for _ in range(3)]
    need(max(counts) <= n_positions, "there are more rounded coordinates than positions")
    *lowest, x, y, z = integers(payload.rest(), [1, 1, 1, *counts])
    return [
        {low + i: offset for i, offset in enumerate(row)}
        for (low,), row in zip(lowest, (x, y, z), strict=True)
    ]


def without_missing(values, group, shape, items):
    """Set missing values of a block to NaN."""
    rows = read_exact(group["MISSING"], shape, "B", items.neighbors)
    flags = (flag for frame in rows for item in items.order for flag in frame[item])
    for i, flag in enumerate(flags):
        need(flag < 2, "a flag of MISSING is not 0 or 1")
        if flag:
            values[i] = math.nan
    return values


def read_layout(group, n_frames, n_columns):
    """Return the layout of a track in a block."""
    is_first = "BLOCK" in group
    need(set(group) <= (OF_MODES if is_first else OF_MODES_OF_A_TRACK), "a section is misplaced")
    head, layout = Payload(group["BLOCK" if is_first else "TRACK_BLOCK"]), Payload(group["FIELDS"])
    if is_first:
        head.varint()
    n_modes = head.varint()
    head.end()
    need(1 <= n_modes <= n_columns * n_frames)
    layout_number = layout.byte()
    precision, has_rests = layout_number & ~(16 + 32 + 64 + 128), layout_number & 16
    from_points = layout_number & 128
    need(not (is_first and from_points), "weights of positions are from points")
    cosines, is_adaptive = layout_number & 32, layout_number & 64
    need(precision in (4, 8), "the layout of the fields is unknown")
    need(not (has_rests and cosines), "a block with cosines has resting times")
    need(not (is_adaptive and cosines), "a block with cosines has adaptive times")
    need(n_frames <= 1024 or not cosines, "a block with cosines is too long")
    reference, step, size, n_learned = (
        *(layout.varint(), layout.number("f")),
        *(layout.varint(), layout.varint()),
    )
    nugget = layout.byte() if from_points else 0
    related = layout.varint() if nugget & 32 else 0
    need(nugget & ~32 <= 24 and (related or not nugget & 32), "a nugget or relation is wrong")
    rest_bits, rests = read_rests(layout, n_frames) if has_rests else (0, [])
    n_reused, finer = 0, 0.0
    if reference and layout.position < len(layout.data):
        n_reused, finer = layout.varint(), layout.number("f")
        need(0 < n_reused <= n_modes and 0 < finer < 1e6)
    layout.end()
    need(1 <= size <= 16 and n_learned <= 255 and 0 < step < 1e6)
    return {
        "frames": n_frames,
        "modes": n_modes,
        "reference": reference,
        "step": step,
        "precision": precision,
        "stencil": size,
        "learned": n_learned,
        **({"nugget": nugget & ~32} if from_points else {}),
        **({"related": related} if related else {}),
        **({"rests": rests, "rest bits": rest_bits} if rests else {}),
        **({"cosines": 1} if cosines else {}),
        **({"adaptive": 1} if is_adaptive else {}),
        **({"reused": n_reused, "finer": finer} if n_reused else {}),
    }


def read_integers(group, n_frames, n_columns, items):
    """Return the layout and the integers of a track in a block."""
    layout = read_layout(group, n_frames, n_columns)
    n_modes, n_new = layout["modes"], layout["modes"] - layout.get("reused", 0)
    corrections = 0.0, {}
    if "CORRECTIONS" in group:
        corrections = read_corrections(group["CORRECTIONS"], n_columns, n_frames, items.n)
    passes = passes_of(items.resolutions(layout["stencil"]))
    times = passes_by_times(n_columns, n_frames, resting_times(layout.get("rests", [])))
    times = pass_of_cosines(n_columns, n_frames) if "cosines" in layout else times
    return layout | {
        "basis": read_fields(group["BASIS"], n_modes, times),
        "coefficients": read_fields(group["COEFFICIENTS"], n_new, passes),
        "correction step": corrections[0],
        "corrections": corrections[1],
    }


if __name__ == "__main__":
    print(json.dumps(describe_all(read_all(Path(sys.argv[1]).read_bytes())), indent=1))
