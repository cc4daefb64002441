"""The original order of faces and vertices: ORDER of docs/format.md."""

from conformance.bits import BitStream, NamedBits, need, sign_class


def rotated(corner, by):
    """Return the corner, or side, that is `by` after this one in its face."""
    return corner // 3 * 3 + (corner + by) % 3


def twins_of(faces):
    """Return the twin of each side, or the side itself."""
    sides, twins = {}, list(range(3 * len(faces)))
    for side in twins:
        a, b = faces[side // 3][side % 3], faces[side // 3][(side + 1) % 3]
        sides.setdefault((min(a, b), max(a, b)), []).append(side)
    for on_edge in sides.values():
        for one, other in zip(on_edge[::2], on_edge[1::2], strict=False):
            twins[one], twins[other] = other, one
    return twins


class Leaps:
    """Leaps of one kind between members of lists."""

    def __init__(self, bits, name):
        self.bits, self.name, self.last, self.reached = bits, name, 0, None

    def read(self, ascending):
        """Return the member of an ascending list that the next leap reaches."""
        start = self.reached
        position = 0 if start is None else sum(number < start for number in ascending)
        context = min(9, abs(self.last).bit_length())
        self.last = self.bits.integer(self.name, context, sign_class(self.last))
        self.reached = ascending[(position + self.last) % len(ascending)]
        return self.reached


class FaceOrder:
    """First corners of the listed faces."""

    FAR = 18
    ACROSS_OPEN, ANY = 18, 19

    def __init__(self, bits, n_faces, twins):
        self.bits, self.n_faces, self.twins = bits, n_faces, twins
        self.corners, self.listed = [], set()
        self.open_sides, self.n_opened = {}, 0
        self.leap, self.leap_any = Leaps(bits, "leap"), Leaps(bits, "any")
        self.ways, self.last_turn = [self.FAR, self.FAR], 0

    def read(self):
        for _ in range(self.n_faces):
            way, side, w = self.read_way()
            turn = self.read_turn(w)
            self.list_face(rotated(side, turn))
            self.ways, self.last_turn = [way, self.ways[0]], turn
        return self.corners

    def across(self, side):
        twin = self.twins[side]
        return twin if twin != side and twin // 3 not in self.listed else None

    def near(self):
        """Return, by way, the side at which each face near the last two is entered."""
        entered = {}
        for way in range(18):
            w = way - 6
            back, by = (way // 3, way % 3) if way < 6 else (w // 6, w // 2 % 3)
            if back >= len(self.corners):
                continue
            side = self.across(rotated(self.corners[-1 - back], by))
            if way >= 6 and side is not None:
                side = self.across(rotated(side, 1 + way % 2))
            if side is not None and all(side // 3 != other // 3 for other in entered.values()):
                entered[way] = side
        return entered

    def read_way(self):
        """Return the way of the next face, its entered side, and the way of its turn."""
        h, earlier = self.ways
        near = self.near()
        if near and self.bits.bit(("near", h), earlier):
            *others, last = near
            chosen = (way for way in others if self.bits.bit(("is", way, h), earlier))
            way = next(chosen, last)
            return way, near[way], way
        if self.open_sides and self.bits.bit(("open", h)):
            side = self.open_sides[self.leap.read(list(self.open_sides))]
            return self.FAR, self.twins[side], self.ACROSS_OPEN
        face = self.leap_any.read([i for i in range(self.n_faces) if i not in self.listed])
        return self.FAR, 3 * face, self.ANY

    def read_turn(self, w):
        context = self.ways[0], self.last_turn
        turn = self.bits.bit(("turn", w, 0), context)
        return turn + (turn and self.bits.bit(("turn", w, 1), context))

    def list_face(self, corner):
        self.corners.append(corner)
        self.listed.add(corner // 3)
        sides = [rotated(corner, k) for k in range(3)]
        self.open_sides = {
            time: side for time, side in self.open_sides.items() if self.twins[side] not in sides
        }
        for side in sides:
            if self.across(side) is not None:
                self.open_sides[self.n_opened] = side
                self.n_opened += 1


def neighbors_in_order(n_verts, faces):
    """Return the neighbors of each vertex, face by face and corner by corner."""
    around = [[] for _ in range(n_verts)]
    for face in faces:
        for k in range(3):
            around[face[k]] += [face[(k + 1) % 3], face[(k + 2) % 3]]
    return around


def read_items(bits, kind, n_verts, around):
    """Return the numbers of the vertices, or cells, in the original order; with their neighbors."""
    leap, leap_any = Leaps(bits, ("leap", kind)), Leaps(bits, ("any", kind))
    h, earlier, vertices = 6, 6, []
    coded, again, times, opener = set(), set(), {}, {}
    for _ in range(n_verts):
        vertex, following = None, vertices[-1] + 1 if vertices else 0
        follows = following < n_verts and following not in coded
        if follows and bits.bit(("next", kind, h, earlier, following in times)):
            vertex, way = following, 0
        if vertex is None and vertices:
            near = [v for v in dict.fromkeys(around[vertices[-1]]) if v not in coded]
            near = [v for v in near if v != following][:16]
            near.sort(key=lambda v: times[v])
            for j, v in enumerate(near):
                if bits.bit(("is it", kind, min(j, 4), min(len(near), 7), h)):
                    vertex, way = v, 1 + min(j, 3)
                    break
        opens = {time: v for v, time in times.items() if v not in coded}
        if vertex is None and opens and bits.bit(("open item", kind, h)):
            vertex, way = opens[leap.read(sorted(opens))], 5
        if vertex is None:
            vertex, way = leap_any.read([v for v in range(n_verts) if v not in coded]), 6
        vertices.append(vertex)
        coded.add(vertex)
        for v in dict.fromkeys(around[vertex]):
            if v in coded:
                continue
            if v not in times:
                times[v], opener[v] = len(times), vertex
            elif v not in again:
                siblings = [u for u in times if opener[u] == opener[v]]
                first = min((u for u in siblings if u not in coded | again), key=times.get)
                times[first], times[v] = times[v], times[first]
                again.add(v)
        h, earlier = way, h
    return vertices


def read_order(payload, faces, n_verts):
    """Return the internal numbers of vertices in output order, the faces, and their numbers."""
    if not payload:
        return list(range(n_verts)), faces, list(range(len(faces)))
    need(payload[0] in (1, 2), "ORDER has an unknown kind")
    need(len(payload) == 1 or payload[-1], "ORDER ends in a zero byte")
    bits = NamedBits(BitStream(payload[1:]))
    if payload[0] == 1:
        numbers, listed, of_faces = range(n_verts), faces, list(range(len(faces)))
    else:
        corners = FaceOrder(bits, len(faces), twins_of(faces)).read()
        of_faces = [c // 3 for c in corners]
        listed = [tuple(faces[c // 3][(c + k) % 3] for k in range(3)) for c in corners]
        numbers = list(dict.fromkeys(v for face in listed for v in face))
        numbers += sorted(set(range(n_verts)) - set(numbers))
    number_of = {vertex: number for number, vertex in enumerate(numbers)}
    renumbered = [tuple(number_of[v] for v in face) for face in listed]
    around = neighbors_in_order(n_verts, renumbered)
    internal = [numbers[v] for v in read_items(bits, "vertices", n_verts, around)]
    bits.stream.end()
    output = {vertex: number for number, vertex in enumerate(internal)}
    return internal, [tuple(output[v] for v in face) for face in listed], of_faces
