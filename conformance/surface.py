"""The surface of a mesh: what docs/format.md says of POLYGONS to IMAGE, and of HARD_EDGES."""

import struct
from itertools import accumulate

from conformance.bits import integers, need
from conformance.container import Payload
from conformance.order import rotated, twins_of
from conformance.patterns import nothing, read_patterns, row_before
from conformance.rounding import single

KINDS, DOMAINS = ("uv", "color", "other"), ("vertex", "face", "corner")
EACH, INDEXED, SHARED = range(3)
SLOTS = ("base_color", "metallic", "roughness", "normal", "occlusion", "emissive")
MATERIAL_NUMBERS = (1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.5)
TEXTURE_NUMBERS = (0.0, 0.0, 0.0, 1.0, 1.0)


class Polygons:
    """How triangles make up faces."""

    def __init__(self, payload, triangles):
        self.triangles, self.is_plain = triangles, payload is None
        self.sizes = [3] * len(triangles)
        if payload is not None:
            payload = Payload(payload)
            n_faces = payload.varint()
            need(n_faces <= len(triangles))
            (above,) = integers(payload.rest(), [n_faces])
            self.sizes = [3 + one for one in above]
            need(all(one >= 0 for one in above) and sum(self.sizes) == self.n_corners)

    @property
    def n_corners(self):
        return len(self.triangles) + 2 * len(self.sizes)

    def fans(self):
        """Of each triangle the numbers of its corners, counted through all faces."""
        found, first = [], 0
        for size in self.sizes:
            found += [(first, first + k, first + k + 1) for k in range(1, size - 1)]
            first += size
        return found

    def vertices_of_corners(self):
        vertices = [None] * self.n_corners
        for fan, triangle in zip(self.fans(), self.triangles, strict=True):
            for corner, vertex in zip(fan, triangle, strict=True):
                if vertices[corner] is None:
                    vertices[corner] = vertex
        return vertices


class AlongFaces:
    """Rows in the order in which they come along the faces, each with what it is expected from."""

    def __init__(self, faces, n_rows):
        self.faces, self.twins, self.n_rows = faces, twins_of(faces), n_rows
        self.every = [row for face in faces for row in face]
        self.corners = [[] for _ in range(n_rows)]
        for corner, row in enumerate(self.every):
            self.corners[row].append(corner)
        self.came, self.known, self.visited = [], set(), set()
        self.stacks = ([], [], [], [])

    def find(self):
        for i, face in enumerate(self.faces):
            if i not in self.visited:
                self.visited.add(i)
                for k in range(3):
                    last = self.came[-1][0] if self.came else None
                    self.come(face[k], face[k - 1] if k else last)
                for k in range(3):
                    self.push(3 * i + k)
                self.go_on()
        for row in range(self.n_rows):
            self.come(row, row - 1 if row else None)
        return self.came

    def go_on(self):
        while any(self.stacks):
            twin = self.twins[next(stack for stack in reversed(self.stacks) if stack).pop()]
            if twin // 3 not in self.visited:
                self.visited.add(twin // 3)
                self.come(self.every[rotated(twin, 2)], self.every[twin])
                self.push(rotated(twin, 1))
                self.push(rotated(twin, 2))

    def come(self, row, near):
        if row not in self.known:
            self.came.append((row, self.parallelograms(row) or ([] if near is None else [(near,)])))
            self.known.add(row)

    def push(self, side):
        twin = self.twins[side]
        if twin != side and twin // 3 not in self.visited:
            row = self.every[rotated(twin, 2)]
            full = row in self.known
            self.stacks[3 if full else min(3, len(self.parallelograms(row)))].append(side)

    def parallelograms(self, row):
        found = []
        for corner in self.corners[row][:32]:
            side = rotated(corner, 1)
            twin = self.twins[side]
            triple = self.every[side], self.every[rotated(side, 1)], self.every[rotated(twin, 2)]
            if twin != side and self.known.issuperset(triple) and len(found) < 8:
                found.append(triple)
        return found


def read_references(payload, places):
    """The row of each item."""
    payload = Payload(payload)
    n_explicit, seen, is_first = payload.varint(), set(), []
    for place in places:
        is_first.append(place not in seen)
        seen.add(place)
    n_first = sum(is_first)
    rows = integers(payload.rest(), [n_first, len(places) - n_first, n_explicit])
    first, later, explicit = iter(rows[0]), iter(rows[1]), accumulate(rows[2])
    n_new, last, found = 0, {}, []
    for place, is_new in zip(places, is_first, strict=True):
        code = next(first if is_new else later)
        need(code in (0, 1, 2))
        if code == 1:
            last[place], n_new = n_new, n_new + 1
        elif code == 2:
            last[place] = next(explicit)
        need(place in last)
        found.append(last[place])
    return found


def divisor(form):
    return 10.0**form if form < 10 else {10: 255.0, 11: 65535.0}.get(form) or 2.0 ** (form - 64)


def read_attribute(payload, polygons, n_verts, memory):
    payload = Payload(payload)
    kind, domain = KINDS[payload.byte()], DOMAINS[payload.byte()]
    number_type, width = "Bifd"[payload.byte()], payload.byte()
    name, layout, n_rows = payload.text(), payload.byte(), payload.varint()
    references = payload.take(payload.varint())
    form, way = payload.byte(), payload.byte()
    vertices = polygons.vertices_of_corners()
    n_items = {"vertex": n_verts, "face": len(polygons.sizes), "corner": len(vertices)}[domain]
    need(1 <= width <= 16 and layout in (EACH, INDEXED, SHARED))
    memory.need(n_rows * (32 + 8 * width), "a table")
    rows = list(range(n_items))
    if layout == EACH:
        need(n_rows == n_items and not references)
    else:
        rows = read_references(references, vertices if domain == "corner" else [0] * n_items)
    need(way < (2 if domain == "face" else 3) and all(0 <= one < n_rows for one in rows))
    if way == 2:
        corners = polygons.triangles if domain == "vertex" else polygons.fans()
        used = [tuple(rows[corner] for corner in three) for three in corners]
        expected = AlongFaces(used, n_rows).find()
    else:
        expected = (nothing, row_before)[way](n_rows)
    stored = number_type if form == 255 else "i"
    table = read_patterns(payload.rest(), width, stored, expected)
    if form != 255:
        need(number_type in "fd" and (form <= 11 or 64 <= form <= 88))
        table = [divided(row, width, form, number_type) for row in table]
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


def divided(row, width, form, number_type):
    numbers = [struct.unpack("<i", one)[0] / divisor(form) for one in row]
    numbers = map(single, numbers) if number_type == "f" else numbers
    return tuple(struct.pack("<" + number_type, one) for one in numbers)


def read_groups(payload, n_faces):
    payload = Payload(payload)
    name = payload.text()
    labels = [payload.text() for _ in range(payload.varint())]
    (differences,) = integers(payload.rest(), [n_faces])
    numbers = list(accumulate(differences))
    need(all(-1 <= one < len(labels) for one in numbers), "there is no such group")
    return {"name": name, "labels": labels, "numbers": numbers}


def read_parts(payload):
    payload = Payload(payload)
    parts = []
    for _ in range(payload.varint()):
        n_verts, n_faces = payload.varint(), payload.varint()
        parts.append([payload.text(), n_verts, n_faces])
    payload.end()
    return parts


def shared_edges(polygons):
    """Edges that two sides of faces or more lie on, as pairs of vertices, lower first, in order."""
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
    need(1 <= n_hard <= len(edges), "there are not as many edges between faces")
    (between,) = integers(payload.rest(), [n_hard])
    numbers = list(accumulate((one + 1 for one in between), initial=-1))[1:]
    need(min(between) >= 0 and numbers[-1] < len(edges), "there is no such edge between faces")
    return [edges[one] for one in numbers]


def read_numbers(payload, defaults):
    """Numbers with the defaults of those that are not there."""
    present = payload.varint()
    need(present < 2 ** len(defaults))
    return [payload.number("d") if present >> i & 1 else one for i, one in enumerate(defaults)]


def read_material(payload):
    payload = Payload(payload)
    name, flags = payload.text(), payload.byte()
    numbers, slots = read_numbers(payload, MATERIAL_NUMBERS), payload.byte()
    textures = {
        slot: read_texture(payload) for place, slot in enumerate(SLOTS) if slots >> place & 1
    }
    payload.end()
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
    return {
        "image": image,
        "uv": uv,
        "wrap": [wrap & 15, wrap >> 4],
        "channels": "".join(one for i, one in enumerate("rgba") if channels >> i & 1),
        "filters": [filters & 15, filters >> 4],
        "numbers": read_numbers(payload, TEXTURE_NUMBERS),
    }


def read_image(payload):
    payload = Payload(payload)
    return {"name": payload.text(), "type": payload.text(), "data": payload.rest()}


def polygons_of(container, faces):
    """What polygons the faces make up as they go out."""
    return Polygons(next(iter(container.all_of("POLYGONS")), None), faces)


def graphs_of(polygons):
    """Of faces and of corners: pairs of those next to each other, and how many there are."""
    fans, twins = polygons.fans(), twins_of(polygons.triangles)
    of_triangle = [face for face, size in enumerate(polygons.sizes) for _ in range(size - 2)]
    vertices = [vertex for triangle in polygons.triangles for vertex in triangle]
    corners = [corner for fan in fans for corner in fan]
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
    """The rows that corners share: `of_corners`, and how many there are."""

    def __init__(self, payload, vertices, n_verts):
        payload = Payload(payload)
        n_stored, last = payload.varint(), [[] for _ in range(n_verts)]
        for corner, vertex in enumerate(vertices):
            last[vertex].append(corner)
        need(n_stored <= len(vertices), "rows are of more corners than there are")
        has_seam, stored = integers(payload.rest(), [n_verts, n_stored])
        need(all(one in (0, 1) for one in has_seam), "a vertex neither has a seam nor has none")
        need(n_stored == sum(len(last[v]) - 1 for v in range(n_verts) if has_seam[v] and last[v]))
        self.n, codes, self.of_corners = n_verts, iter(stored), [None] * len(vertices)
        for vertex, corners in enumerate(last):
            found = []
            for _ in corners:
                code = next(codes) if has_seam[vertex] and found else 0
                found.append(self.row(code, found) if found else vertex)
            for corner, row in zip(corners, found, strict=True):
                self.of_corners[corner] = row

    def row(self, code, before):
        if code == 1:
            self.n += 1
            return self.n - 1
        need(0 <= code <= len(before), "a corner has the row of none before")
        return before[-max(code, 1)]

    def pairs(self, pairs):
        """Pairs of rows for pairs of corners."""
        return [(self.of_corners[one], self.of_corners[other]) for one, other in pairs]


def read_surface(container, polygons, memory):
    """All that is said of the faces and vertices as they go out."""
    n_verts, hard_edges = container.header.n_verts, container.all_of("HARD_EDGES")
    need(len(hard_edges) < 2)
    return {
        "polygons": None if polygons.is_plain else polygons.sizes,
        "attributes": [
            read_attribute(one, polygons, n_verts, memory) for one in container.all_of("ATTRIBUTE")
        ],
        "groups": [read_groups(one, len(polygons.sizes)) for one in container.all_of("GROUPS")],
        "parts": [part for one in container.all_of("PARTS") for part in read_parts(one)],
        "materials": list(map(read_material, container.all_of("MATERIAL"))),
        "images": list(map(read_image, container.all_of("IMAGE"))),
        "hard edges": [pair for one in hard_edges for pair in read_hard_edges(one, polygons)],
    }
