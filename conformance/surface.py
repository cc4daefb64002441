"""The surface of a mesh: POLYGONS to IMAGE, and HARD_EDGES, of docs/format.md."""

import struct
from functools import cached_property
from itertools import accumulate, islice
from math import isfinite

from conformance.bits import integers, need
from conformance.container import Payload
from conformance.order import rotated, twins_of
from conformance.patterns import Stencil, nothing, read_patterns, row_before
from conformance.points import weights_of
from conformance.rounding import single
from conformance.surface_integers import read_surface_integers

KINDS, DOMAINS = ("uv", "color", "other"), ("vertex", "face", "corner", "cell")
EACH, INDEXED, SHARED = range(3)
ALONG_FACES, FROM_POINTS = 2, 4
NUGGET = 0.125
SLOTS = ("base_color", "metallic", "roughness", "normal", "occlusion", "emissive")
MATERIAL_NUMBERS = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.5)
TEXTURE_NUMBERS = (0.0, 0.0, 0.0, 1.0, 1.0)
COLORED = ("base_color", "normal", "emissive")
CHANNELS = {slot: ("rgb", "rgba") if slot in COLORED else tuple("rgba") for slot in SLOTS}


class Polygons:
    """Faces that consist of adjoining triangles."""

    def __init__(self, payload, triangles, cells=None):
        self.triangles = triangles
        self.n_cells = len(cells.cells) if cells else 0
        self.sizes = cells.sizes if cells else [3] * len(triangles)
        self.is_plain = payload is None and set(self.sizes) == {3}
        if payload is not None:
            payload = Payload(payload)
            n_faces = payload.varint()
            need(n_faces <= len(triangles))
            (above,) = integers(payload.rest(), [n_faces])
            self.sizes = [3 + n for n in above]
            need(all(n >= 0 for n in above) and sum(self.sizes) == self.n_corners)

    @property
    def n_corners(self):
        return len(self.triangles) + 2 * len(self.sizes)

    @cached_property
    def corners(self):
        """The corner numbers of each triangle."""
        corners, triangles, first = [], iter(self.triangles), 0
        for size in self.sizes:
            for triangle in corners_of_face(list(islice(triangles, size - 2))):
                corners.append(tuple(first + corner for corner in triangle))
            first += size
        return corners

    def vertices_of_corners(self):
        vertices = [None] * self.n_corners
        for corners, triangle in zip(self.corners, self.triangles, strict=True):
            for corner, vertex in zip(corners, triangle, strict=True):
                if vertices[corner] is None:
                    vertices[corner] = vertex
        return vertices


def corners_of_face(triangles):
    """Return the corner of the face at each corner of its triangles."""
    vertices, outline, corners = list(triangles[0]), [0, 1, 2], [(0, 1, 2)]
    sides = [(0, 1), (1, 2), (2, 0)]
    for x, y, z in triangles[1:]:
        need(sides)
        begin, end = sides.pop()
        while (vertices[end], vertices[begin]) != (x, y):
            need(sides)
            begin, end = sides.pop()
        added = len(vertices)
        vertices.append(z)
        outline.insert(outline.index(begin) + 1, added)
        corners.append((end, begin, added))
        sides += [(begin, added), (added, end)]
    return [tuple(outline.index(corner) for corner in triangle) for triangle in corners]


class AlongFaces:
    """Rows in coding order along the faces, each with its predictors.

    With `points`, those of the rows, rows that have a stencil are predicted from it.
    """

    def __init__(self, faces, n_rows, points=None):
        self.points = points
        self.faces, self.twins, self.n_rows = faces, twins_of(faces), n_rows
        self.row_of = [row for face in faces for row in face]
        self.corners = [[] for _ in range(n_rows)]
        for corner, row in enumerate(self.row_of):
            self.corners[row].append(corner)
        self.coded, self.known, self.visited = [], set(), set()
        self.stacks = ([], [], [], [])

    def traverse(self):
        for i, face in enumerate(self.faces):
            if i not in self.visited:
                self.visited.add(i)
                for k in range(3):
                    last = self.coded[-1][0] if self.coded else None
                    self.add(face[k], face[k - 1] if k else last)
                for k in range(3):
                    self.push(3 * i + k)
                self.grow()
        for row in range(self.n_rows):
            self.add(row, row - 1 if row else None)
        return self.coded

    def grow(self):
        while any(self.stacks):
            twin = self.twins[next(stack for stack in reversed(self.stacks) if stack).pop()]
            if twin // 3 not in self.visited:
                self.visited.add(twin // 3)
                self.add(self.row_of[rotated(twin, 2)], self.row_of[twin])
                self.push(rotated(twin, 1))
                self.push(rotated(twin, 2))

    def add(self, row, near):
        if row not in self.known:
            predictors = self.parallelograms(row) or ([] if near is None else [(near,)])
            stencil = self.stencil(row) if self.points else []
            if stencil:
                places = [self.points[other] for other in stencil]
                predictors = Stencil(stencil, weights_of(self.points[row], places, NUGGET))
            self.coded.append((row, predictors))
            self.known.add(row)

    def stencil(self, row):
        """Return up to 16 known rows, the nearest first."""
        found = [row]
        for center in found:  # grows
            for corner in self.corners[center][:32]:
                for by in (1, 2):
                    near = self.row_of[rotated(corner, by)]
                    if near in self.known and near not in found and len(found) <= 16:
                        found.append(near)
        return found[1:]

    def push(self, side):
        twin = self.twins[side]
        if twin != side and twin // 3 not in self.visited:
            row = self.row_of[rotated(twin, 2)]
            is_known = row in self.known
            self.stacks[3 if is_known else min(3, len(self.parallelograms(row)))].append(side)

    def parallelograms(self, row):
        triples = []
        for corner in self.corners[row][:32]:
            side = rotated(corner, 1)
            twin = self.twins[side]
            triple = (
                self.row_of[side],
                self.row_of[rotated(side, 1)],
                self.row_of[rotated(twin, 2)],
            )
            if twin != side and self.known.issuperset(triple) and len(triples) < 8:
                triples.append(triple)
        return triples


def read_references(payload, n_items):
    """Return the row of each vertex or face."""
    payload = Payload(payload)
    n_explicit = payload.varint()
    need(n_explicit <= n_items)
    codes, differences = integers(payload.rest(), [n_items, n_explicit])
    explicit, n_new, rows = accumulate(differences), 0, []
    for code in codes:
        need(code in (0, 1, 2) and (rows or code))
        if code == 0:
            rows.append(rows[-1])
        elif code == 1:
            rows.append(n_new)
            n_new += 1
        else:
            rows.append(next(explicit, None))
            need(rows[-1] is not None)
    need(next(explicit, None) is None)
    return rows


SAME, OPEN, SEAM, NO_NEIGHBOR = range(4)


class CornerReferences:
    """The rows of corners, coded face by face."""

    def __init__(self, payload, polygons):
        payload = Payload(payload)
        self.faces, self.items = polygons.triangles, polygons.corners
        self.twins = twins_of(self.faces)
        counts = [payload.varint() for _ in range(9)]
        n_first = polygons.n_corners - sum(counts[:8])
        need(n_first >= 0 and counts[8] <= polygons.n_corners)
        *codes, differences = integers(payload.rest(), [n_first, *counts])
        self.codes, self.explicit = [iter(code) for code in codes], accumulate(differences)
        self.rows, self.recent, self.n_new = [None] * polygons.n_corners, {}, 0

    def read(self):
        """Return the row of each corner."""
        for face, items in enumerate(self.items):
            for corner, item in enumerate(items):
                if self.rows[item] is None:
                    self.rows[item] = self.row_of(face, corner)
        need(next(self.explicit, None) is None)
        return self.rows

    def row_of(self, face, corner):
        recent = self.recent.setdefault(self.faces[face][corner], [])
        sides = [
            self.side(face, (corner + 2) % 3, corner, (corner + 2) % 3),
            self.side(face, corner, corner, (corner + 1) % 3),
        ]
        sides.sort(key=lambda side: side[0])
        candidates = [row for state, row in sides if state != NO_NEIGHBOR] + recent
        candidates = list(dict.fromkeys(candidates))
        context = 1 + sides[0][0] + 4 * (len(recent) > 1) if candidates else 0
        code = next(self.codes[context], None)
        need(code is not None)
        if code == 1:
            row, self.n_new = self.n_new, self.n_new + 1
        elif code == 2:
            row = next(self.explicit, None)
        else:
            number = max(0, code - 2)
            need(code >= 0 and number < len(candidates))
            row = candidates[number]
        need(row is not None and row >= 0)
        if row in recent:
            recent.remove(row)
        recent.insert(0, row)
        del recent[8:]
        return row

    def side(self, face, side, corner, other):
        """State of a side, and the row of the neighboring face at the vertex of the corner."""
        twin = self.twins[3 * face + side]
        if twin // 3 >= face:
            return NO_NEIGHBOR, None
        neighbor, start = divmod(twin, 3)
        ends = [start, (start + 1) % 3]
        if self.faces[neighbor][start] != self.faces[face][corner]:
            ends.reverse()
        row, there = (self.rows[self.items[neighbor][end]] for end in ends)
        here = self.rows[self.items[face][other]]
        return OPEN if here is None else SAME if here == there else SEAM, row


def divisor(form):
    return 10.0**form if form < 10 else {10: 255.0, 11: 65535.0}.get(form) or 2.0 ** (form - 64)


def read_attribute(payload, polygons, n_verts, memory, positions, is_from_points):
    """Read an attribute; `positions` are those of the first frame, or None."""
    payload = Payload(payload)
    kind, domain = KINDS[payload.byte()], DOMAINS[payload.byte()]
    number_type, width = "Bifd"[payload.byte()], payload.byte()
    name, layout, n_rows = payload.text(), payload.byte(), payload.varint()
    references = payload.take(payload.varint())
    form = payload.byte()
    grid = [payload.number("f") for _ in range(1 + width)] if form == 12 else None
    predictor = payload.byte()
    vertices = polygons.vertices_of_corners()
    n_items = {
        "vertex": n_verts,
        "face": len(polygons.sizes),
        "corner": len(vertices),
        "cell": polygons.n_cells,
    }[domain]
    need(1 <= width <= 16 and layout in (EACH, INDEXED, SHARED))
    memory.check(n_rows * (32 + 8 * width), "a table")
    rows = list(range(n_items))
    if layout == EACH:
        need(n_rows == n_items and not references)
    else:
        is_corner = domain == "corner"
        rows = (
            CornerReferences(references, polygons).read()
            if is_corner
            else read_references(references, n_items)
        )
    is_of_faces = domain in ("face", "cell")
    if is_from_points:
        need(predictor == FROM_POINTS and not is_of_faces and positions is not None)
    else:
        need(predictor < (2 if is_of_faces else 4))
    need(all(0 <= row < n_rows for row in rows))
    stored = number_type if form == 255 else "i"
    if predictor < ALONG_FACES:
        predictors = (nothing, row_before)[predictor](n_rows)
        table = read_patterns(payload.rest(), width, stored, predictors)
    else:
        corners = polygons.triangles if domain == "vertex" else polygons.corners
        triangles = [tuple(rows[corner] for corner in triangle) for triangle in corners]
        if is_from_points:
            points = [(0.0, 0.0, 0.0)] * n_rows
            for triangle, vertices_of in zip(
                triangles[::-1], polygons.triangles[::-1], strict=True
            ):
                for row, vertex in zip(triangle[::-1], vertices_of[::-1], strict=True):
                    points[row] = tuple(positions[3 * vertex : 3 * vertex + 3])
            predictors = AlongFaces(triangles, n_rows, points).traverse()
            table = read_patterns(payload.rest(), width, stored, predictors)
        else:
            read = read_along_faces if predictor == ALONG_FACES else read_on_surface
            table = read(payload.rest(), n_rows, width, stored, triangles)
    if form != 255:
        need(number_type == "f" if grid else number_type in "fd" and is_divisor(form))
        table = [
            placed(row, grid) if grid else divided(row, width, form, number_type) for row in table
        ]
    if layout == SHARED:
        table, rows = [table[row] for row in rows], None
    return {
        "name": name,
        "kind": kind,
        "domain": domain,
        "type": number_type,
        "width": width,
        "values": table,
        "rows": rows if layout == INDEXED else None,
    }


def read_along_faces(data, n_rows, width, stored, triangles):
    """Return the bytes of each row, predicted along the faces."""
    predictors = AlongFaces(triangles, n_rows).traverse()
    return read_patterns(data, width, stored, predictors)


def read_on_surface(data, n_rows, width, stored, triangles):
    """Return the bytes of each row of integers on a surface."""
    need(stored == "i", "values on a surface are not integers")
    (rows,) = read_surface_integers(data, 1, n_rows, width, triangles, twins_of(triangles))
    return [tuple(struct.pack("<i", number) for number in row) for row in rows]


def is_divisor(form):
    return form <= 11 or 64 <= form <= 88


def placed(row, grid):
    """Return the numbers of a row on a grid: its step, then the origin of each column."""
    step, *origins = grid
    need(step > 0 and all(map(isfinite, grid)))
    offsets = [single(single(struct.unpack("<i", integer)[0]) * step) for integer in row]
    numbers = [single(low + offset) for low, offset in zip(origins, offsets, strict=True)]
    return tuple(struct.pack("<f", number) for number in numbers)


def divided(row, width, form, number_type):
    numbers = [struct.unpack("<i", integer)[0] / divisor(form) for integer in row]
    numbers = map(single, numbers) if number_type == "f" else numbers
    return tuple(struct.pack("<" + number_type, number) for number in numbers)


def read_groups(payload, n_faces):
    payload = Payload(payload)
    name = payload.text()
    labels = [payload.text() for _ in range(payload.varint())]
    (differences,) = integers(payload.rest(), [n_faces])
    numbers = list(accumulate(differences))
    need(all(-1 <= number < len(labels) for number in numbers), "a group does not exist")
    return {"name": name, "labels": labels, "numbers": numbers}


def read_parts(payload, n_verts_of_all, n_faces_of_all):
    payload = Payload(payload)
    parts = []
    for _ in range(payload.varint()):
        n_verts, n_faces = payload.varint(), payload.varint()
        parts.append([payload.text(), n_verts, n_faces])
    payload.end()
    need(sum(part[1] for part in parts) == n_verts_of_all, "parts do not cover the vertices")
    need(sum(part[2] for part in parts) == n_faces_of_all, "parts do not cover the faces")
    return parts


def shared_edges(polygons):
    """Return the edges with two sides or more, in order, as pairs of vertices, lower first."""
    vertices, first, sides = polygons.vertices_of_corners(), 0, {}
    for size in polygons.sizes:
        for k in range(size):
            ends = vertices[first + k], vertices[first + (k + 1) % size]
            if ends[0] != ends[1]:
                edge = min(ends), max(ends)
                sides[edge] = sides.get(edge, 0) + 1
        first += size
    return [edge for edge, n_sides in sides.items() if n_sides > 1]


def read_hard_edges(payload, polygons):
    payload, edges = Payload(payload), shared_edges(polygons)
    n_hard = payload.varint()
    need(1 <= n_hard <= len(edges), "more edges are hard than exist")
    (gaps,) = integers(payload.rest(), [n_hard])
    numbers = list(accumulate((gap + 1 for gap in gaps), initial=-1))[1:]
    need(min(gaps) >= 0 and numbers[-1] < len(edges), "a hard edge does not exist")
    return [edges[number] for number in numbers]


def read_numbers(payload, defaults):
    """Read numbers, with defaults for absent ones."""
    present = payload.varint()
    need(present < 2 ** len(defaults))
    return [payload.number("d") if present >> i & 1 else d for i, d in enumerate(defaults)]


def read_material(payload, n_images):
    payload = Payload(payload)
    name, flags = payload.text(), payload.byte()
    numbers, slots = read_numbers(payload, MATERIAL_NUMBERS), payload.byte()
    textures = {slot: read_texture(payload) for i, slot in enumerate(SLOTS) if slots >> i & 1}
    payload.end()
    need(flags < 16 and slots < 1 << len(SLOTS), "a material has unknown flags or slots")
    for slot, texture in textures.items():
        need(texture["image"] < n_images, "an image does not exist")
        need(texture["channels"] in CHANNELS[slot], "a texture has other channels")
        need(max(texture["wrap"]) < 5, "a wrap mode is unknown")
        need(texture["filters"][0] < 3 and texture["filters"][1] < 7, "a filter is unknown")
    alpha, double_sided, unlit = flags & 3, bool(flags & 4), bool(flags & 8)
    return {
        "name": name,
        "alpha mode": ("opaque", "mask", "blend")[alpha],
        "numbers": numbers,
        "double sided": double_sided,
        "unlit": unlit,
        "textures": textures,
    }


def read_texture(payload):
    image, uv, channels = payload.varint(), payload.text(), payload.byte()
    wrap, filters = payload.byte(), payload.byte()
    need(channels < 16, "a channel is unknown")
    return {
        "image": image,
        "uv": uv,
        "wrap": [wrap & 15, wrap >> 4],
        "channels": "".join(c for i, c in enumerate("rgba") if channels >> i & 1),
        "filters": [filters & 15, filters >> 4],
        "numbers": read_numbers(payload, TEXTURE_NUMBERS),
    }


def read_image(payload):
    payload = Payload(payload)
    return {"name": payload.text(), "type": payload.text(), "data": payload.rest()}


def polygons_of(container, faces, cells):
    """Return the polygons of the faces in output order."""
    return Polygons(next(iter(container.all_of("POLYGONS")), None), faces, cells)


def graphs_of(polygons):
    """Return the pairs of adjacent faces and their number, and those of corners."""
    twins = twins_of(polygons.triangles)
    of_triangle = [face for face, size in enumerate(polygons.sizes) for _ in range(size - 2)]
    vertices = [vertex for triangle in polygons.triangles for vertex in triangle]
    corners = [corner for triangle in polygons.corners for corner in triangle]
    of_faces, of_corners = [], []
    for side, twin in enumerate(twins):
        end, twin_end = rotated(side, 1), rotated(twin, 1)
        of_corners.append((corners[side], corners[end]))
        if twin == side:
            continue
        of_faces.append((of_triangle[side // 3], of_triangle[twin // 3]))
        if vertices[side] == vertices[twin_end]:
            twin, twin_end = twin_end, twin
        of_corners += [(corners[side], corners[twin]), (corners[end], corners[twin_end])]
    return (of_faces, len(polygons.sizes)), (of_corners, polygons.n_corners)


class CornerRows:
    """Rows shared by corners: their number `n`, and the row of each corner."""

    def __init__(self, payload, vertices, n_verts):
        payload = Payload(payload)
        n_stored, last = payload.varint(), [[] for _ in range(n_verts)]
        for corner, vertex in enumerate(vertices):
            last[vertex].append(corner)
        need(n_stored <= len(vertices), "rows refer to more corners than exist")
        has_seam, stored = integers(payload.rest(), [n_verts, n_stored])
        need(all(flag in (0, 1) for flag in has_seam), "a seam flag is not 0 or 1")
        need(n_stored == sum(len(last[v]) - 1 for v in range(n_verts) if has_seam[v] and last[v]))
        self.n, codes, self.of_corners = n_verts, iter(stored), [None] * len(vertices)
        for vertex, corners in enumerate(last):
            rows = []
            for _ in corners:
                code = next(codes) if has_seam[vertex] and rows else 0
                rows.append(self.row(code, rows) if rows else vertex)
            for corner, row in zip(corners, rows, strict=True):
                self.of_corners[corner] = row

    def row(self, code, previous):
        if code == 1:
            self.n += 1
            return self.n - 1
        need(0 <= code <= len(previous), "a corner refers to a row that does not exist")
        return previous[-max(code, 1)]

    def pairs(self, pairs):
        """Return the pairs of rows of pairs of corners."""
        return [(self.of_corners[a], self.of_corners[b]) for a, b in pairs]


def read_surface(container, polygons, memory, positions):
    """Return the surface, in output order; `positions` are those of the frames, or None."""
    n_verts, hard_edges = container.header.n_verts, container.all_of("HARD_EDGES")
    need(len(hard_edges) < 2)
    n_faces, images = len(polygons.sizes), list(map(read_image, container.all_of("IMAGE")))
    materials = [read_material(data, len(images)) for data in container.all_of("MATERIAL")]
    names = {material["name"] for material in materials}
    need(len(names) == len(materials), "two materials have the same name")
    return {
        "polygons": None if polygons.is_plain else polygons.sizes,
        "triangle corners": [corner for triangle in polygons.corners for corner in triangle],
        "attributes": [
            read_attribute(payload, polygons, n_verts, memory, positions, name != "ATTRIBUTE")
            for name, payload in container.leading
            if name in ("ATTRIBUTE", "ATTRIBUTE_FROM_POINTS")
        ],
        "groups": [read_groups(data, n_faces) for data in container.all_of("GROUPS")],
        "parts": [
            part
            for data in container.all_of("PARTS")
            for part in read_parts(data, n_verts, n_faces)
        ],
        "materials": materials,
        "images": images,
        "hard edges": [pair for data in hard_edges for pair in read_hard_edges(data, polygons)],
    }
