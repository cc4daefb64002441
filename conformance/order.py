"""The given order of faces and vertices: ORDER of docs/format.md."""

from conformance.bits import BitStream, NamedBits, need, sign_class


def rotated(corner, by):
    """The corner, or side, `by` places behind in its face."""
    return corner // 3 * 3 + (corner + by) % 3


def twins_of(faces):
    """The twin of each side, or the side itself."""
    sides, twins = {}, list(range(3 * len(faces)))
    for side in twins:
        a, b = faces[side // 3][side % 3], faces[side // 3][(side + 1) % 3]
        sides.setdefault((min(a, b), max(a, b)), []).append(side)
    for on_edge in sides.values():
        for one, other in zip(on_edge[::2], on_edge[1::2], strict=False):
            twins[one], twins[other] = other, one
    return twins


class Leaps:
    """Leaps of one kind."""

    def __init__(self, bits, name):
        self.bits, self.name, self.last, self.reached = bits, name, 0, None

    def read(self, ascending):
        """The number reached in a list, from the one reached before."""
        start = self.reached
        place = 0 if start is None else sum(number < start for number in ascending)
        context = min(9, abs(self.last).bit_length())
        self.last = self.bits.integer(self.name, context, sign_class(self.last))
        self.reached = ascending[(place + self.last) % len(ascending)]
        return self.reached


class FaceOrder:
    """First corners of the listed faces."""

    FAR = 18
    ACROSS_OPEN, ANY = 18, 19

    def __init__(self, bits, n_faces, twins):
        self.bits, self.n_faces, self.twins = bits, n_faces, twins
        self.corners, self.listed = [], set()
        self.open_sides, self.n_opened = {}, 0
        self.leap, self.anew = Leaps(bits, "leap"), Leaps(bits, "any")
        self.ways, self.turned = [self.FAR, self.FAR], 0

    def read(self):
        for _ in range(self.n_faces):
            way, arrived, w = self.read_way()
            turn = self.read_turn(w)
            self.list_face(rotated(arrived, turn))
            self.ways, self.turned = [way, self.ways[0]], turn
        return self.corners

    def across(self, side):
        twin = self.twins[side]
        return twin if twin != side and twin // 3 not in self.listed else None

    def near(self):
        """By its way, the side arrived at of each face near the last two."""
        found = {}
        for way in range(18):
            w = way - 6
            back, by = (way // 3, way % 3) if way < 6 else (w // 6, w // 2 % 3)
            if back >= len(self.corners):
                continue
            arrived = self.across(rotated(self.corners[-1 - back], by))
            if way >= 6 and arrived is not None:
                arrived = self.across(rotated(arrived, 1 + way % 2))
            if arrived is not None and all(arrived // 3 != one // 3 for one in found.values()):
                found[way] = arrived
        return found

    def read_way(self):
        """The way a face is found, the side arrived at, and the way for its turn."""
        h, before = self.ways
        near = self.near()
        if near and self.bits.bit(("near", h), before):
            *others, last = near
            chosen = (one for one in others if self.bits.bit(("is", one, h), before))
            way = next(chosen, last)
            return way, near[way], way
        if self.open_sides and self.bits.bit(("open", h)):
            side = self.open_sides[self.leap.read(list(self.open_sides))]
            return self.FAR, self.twins[side], self.ACROSS_OPEN
        face = self.anew.read([one for one in range(self.n_faces) if one not in self.listed])
        return self.FAR, 3 * face, self.ANY

    def read_turn(self, w):
        context = self.ways[0], self.turned
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


def neighbours_in_order(n_verts, faces):
    """Of each vertex its neighbours, face by face and corner by corner at it."""
    around = [[] for _ in range(n_verts)]
    for face in faces:
        for k in range(3):
            around[face[k]] += [face[(k + 1) % 3], face[(k + 2) % 3]]
    return around


def read_vertices(bits, n_verts, faces):
    """Names of vertices in the given order."""
    leap, anew = Leaps(bits, "leap of vertices"), Leaps(bits, "any of vertices")
    h, before, came, times, found = 6, 6, set(), {}, []
    around = neighbours_in_order(n_verts, faces)
    for _ in range(n_verts):
        vertex, following = None, found[-1] + 1 if found else 0
        follows = following < n_verts and following not in came
        if follows and bits.bit(("next", h, before, following in times)):
            vertex, way = following, 0
        if vertex is None and found:
            near = [one for one in dict.fromkeys(around[found[-1]]) if one not in came]
            near = [one for one in near if one != following][:16]
            near.sort(key=lambda one: times[one])
            for j, one in enumerate(near):
                if bits.bit(("is it", min(j, 4), min(len(near), 7), h)):
                    vertex, way = one, 1 + min(j, 3)
                    break
        opens = {time: one for one, time in times.items() if one not in came}
        if vertex is None and opens and bits.bit(("open vertex", h)):
            vertex, way = opens[leap.read(sorted(opens))], 5
        if vertex is None:
            vertex, way = anew.read([one for one in range(n_verts) if one not in came]), 6
        found.append(vertex)
        came.add(vertex)
        for one in around[vertex]:
            if one not in came:
                times.setdefault(one, len(times))
        h, before = way, h
    return found


def read_order(payload, faces, n_verts):
    """Internal number of each vertex in the given order, and the faces in given numbers."""
    if not payload:
        return list(range(n_verts)), faces
    need(payload[0] in (1, 2), "the order is of an unknown kind")
    need(len(payload) == 1 or payload[-1], "a zero byte is at the end")
    bits = NamedBits(BitStream(payload[1:]))
    if payload[0] == 1:
        names, listed = range(n_verts), faces
    else:
        corners = FaceOrder(bits, len(faces), twins_of(faces)).read()
        listed = [tuple(faces[c // 3][(c + k) % 3] for k in range(3)) for c in corners]
        names = list(dict.fromkeys(one for face in listed for one in face))
        names += sorted(set(range(n_verts)) - set(names))
    name_of = {vertex: name for name, vertex in enumerate(names)}
    renamed = [tuple(name_of[one] for one in face) for face in listed]
    internal = [names[one] for one in read_vertices(bits, n_verts, renamed)]
    bits.stream.end()
    given = {vertex: number for number, vertex in enumerate(internal)}
    return internal, [tuple(given[one] for one in face) for face in listed]
