"""Cells and their surface: CELLS of docs/format.md."""

from collections import defaultdict
from dataclasses import dataclass, field
from itertools import pairwise

from conformance.bits import BitStream, NamedBits, need, stripped
from conformance.container import Payload
from conformance.order import read_items


@dataclass(frozen=True, eq=False)
class Shape:
    """Corners, edges and sides of cells; `solid` if the sides are faces."""

    n_corners: int
    edges: list
    sides: list
    solid: bool


def corners_of(text):
    """Return lists of corners, each a word of letters a, b, c, ..."""
    return [["abcdefghijkl".index(letter) for letter in word] for word in text.split()]


def shape_of(n_corners, edges, sides=""):
    return Shape(n_corners, corners_of(edges), corners_of(sides or edges), bool(sides))


POINT, LINE = Shape(1, [], [], False), Shape(2, [[0, 1]], [], False)
TRIANGLE, QUAD = shape_of(3, "ab bc ca"), shape_of(4, "ab bc cd da")
TETRA = shape_of(4, "ab bc ca ad bd cd", "abd bcd cad acb")
PYRAMID = shape_of(5, "ab bc cd da ae be ce de", "adcb abe bce cde dae")
WEDGE = shape_of(6, "ab bc ca de ef fd ad be cf", "acb def abed bcfe cadf")
HEXAHEDRON = shape_of(8, "ab bc cd da ef fg gh he ae bf cg dh", "aehd bcgf abfe dhgc adcb efgh")
PENTAGONAL = shape_of(
    10,
    "ab bc cd de ea fg gh hi ij jf af bg ch di ej",
    "aedcb fghij abgf bchg cdih deji eafj",
)
HEXAGONAL = shape_of(
    12,
    "ab bc cd de ef fa gh hi ij jk kl lg ag bh ci dj ek fl",
    "afedcb ghijkl abhg bcih cdji dekj eflk fagl",
)
SHAPES = (
    *(POINT, LINE, TRIANGLE, QUAD, TETRA),
    *(PYRAMID, WEDGE, HEXAHEDRON, PENTAGONAL, HEXAGONAL),
)


@dataclass(frozen=True)
class Type:
    """A cell type: its shape, whether edges have nodes, sides with a node, a node inside."""

    shape: Shape
    has_mids: bool = False
    centers: tuple = ()
    has_middle: bool = False

    @property
    def n_nodes(self):
        n_mids = len(self.shape.edges) if self.has_mids else 0
        return self.shape.n_corners + n_mids + len(self.centers) + self.has_middle


TYPES = {
    1: Type(POINT), 3: Type(LINE), 5: Type(TRIANGLE), 9: Type(QUAD), 10: Type(TETRA),
    12: Type(HEXAHEDRON), 13: Type(WEDGE), 14: Type(PYRAMID), 15: Type(PENTAGONAL),
    16: Type(HEXAGONAL), 21: Type(LINE, True), 22: Type(TRIANGLE, True), 23: Type(QUAD, True),
    24: Type(TETRA, True), 25: Type(HEXAHEDRON, True), 26: Type(WEDGE, True),
    27: Type(PYRAMID, True), 28: Type(QUAD, True, (), True),
    29: Type(HEXAHEDRON, True, (0, 1, 2, 3, 4, 5), True), 32: Type(WEDGE, True, (2, 3, 4)),
    33: Type(HEXAHEDRON, True, (2, 1, 3, 0)), 34: Type(TRIANGLE, True, (), True),
}  # fmt: skip
CODES = list(TYPES)


@dataclass(eq=False)
class Cell:
    """A cell; `known` has the nodes of corners that are known already."""

    code: int
    nodes: list
    known: dict = field(default_factory=dict)
    entry: int | None = None

    @property
    def type(self):
        return TYPES[self.code]

    @property
    def shape(self):
        return self.type.shape

    def side(self, k):
        """Return the corners of a side."""
        return [self.nodes[corner] for corner in self.shape.sides[k]]


@dataclass(eq=False)
class Side:
    """A side of a visited cell."""

    cell: Cell
    number: int
    is_open: bool = True

    def __post_init__(self):
        self.nodes = self.cell.side(self.number)


@dataclass
class Edge:
    """An edge of visited cells."""

    n_cells: int = 0
    middle: int | None = None


MAX_LOOKED, MAX_PROPOSED, MAX_CANDIDATES, MAX_AROUND = 64, 8, 4, 48


class CellReader:
    """Reader of cells."""

    def __init__(self, data, n_cells, n_nodes, n_verts):
        self.stream = BitStream(stripped(data))
        self.bits = NamedBits(self.stream)
        self.n_cells, self.n_nodes, self.n_verts = n_cells, n_nodes, n_verts
        self.cells, self.n_named = [], 0
        self.sides, self.next_side = [], 0
        self.sides_at = defaultdict(list)  # (side, corner) at a node, the latest last
        self.edges_at = defaultdict(list)  # (higher node, edge) at its lower node
        self.outer = set()

    def read(self):
        if self.stream.raw(1):
            self.read_list()
        else:
            self.walk()
        self.stream.end()
        need(sum(cell.type.n_nodes for cell in self.cells) == self.n_nodes, "nodes are missing")
        return self.cells

    def read_type(self):
        last = self.cells[-1].code if self.cells else 1
        if self.bits.bit(("same type", TYPES[last].shape)):
            return last
        number = self.stream.raw(5)
        need(number < len(CODES), "a cell type is unknown")
        return CODES[number]

    def read_list(self):
        last = defaultdict(lambda: [0] * 27)
        for _ in range(self.n_cells):
            code = self.read_type()
            shape, previous, step, h = TYPES[code].shape, last[code], 0, 0
            for i in range(TYPES[code].n_nodes):
                more = self.bits.integer(("step", shape, h) if i else ("first", shape))
                step, h = step + more, int(more != 0)
                previous[i] += step
                need(0 <= previous[i] < self.n_verts, "a node does not exist")
            self.cells.append(Cell(code, previous[: TYPES[code].n_nodes]))

    def walk(self):
        while len(self.cells) < self.n_cells:
            if self.next_side == len(self.sides):
                self.read_cell(None)
                continue
            side = self.sides[self.next_side]
            self.next_side += 1
            if not side.is_open:
                continue
            side.is_open = False
            if self.read_is_next(side):
                self.read_cell(side)
            else:
                self.outer |= set(side.nodes)

    def open_at(self, node):
        """Return the open sides at a node with its corner there, the latest first."""
        sides = [pair for pair in reversed(self.sides_at[node]) if pair[0].is_open]
        return sides[:MAX_LOOKED]

    def edge(self, a, b):
        low, high = min(a, b), max(a, b)
        for other, edge in list(reversed(self.edges_at[low]))[:MAX_LOOKED]:
            if other == high:
                return edge
        return None

    def cells_at(self, a, b):
        edge = self.edge(a, b)
        return min(edge.n_cells, 7) if edge else 0

    def read_is_next(self, side):
        n_outer, n_met, most, n = 0, 0, 0, len(side.nodes)
        for i, a in enumerate(side.nodes):
            b = side.nodes[(i + 1) % n]
            n_outer += a in self.outer
            for other, corner in self.open_at(a):
                size = len(other.nodes)
                if b in (other.nodes[(corner + 1) % size], other.nodes[corner - 1]):
                    most, n_met = max(most, self.cells_at(a, b)), n_met + 1
                    break
        return self.bits.bit(("next", min(n_outer, 4), min(n_met, 4), n, most))

    def read_cell(self, gate):
        cell = Cell(self.read_type(), [])
        cell.nodes = [0] * cell.type.n_nodes
        used = sum(other.type.n_nodes for other in self.cells) + cell.type.n_nodes
        need(used <= self.n_nodes, "there are too many nodes")
        if gate is not None:
            self.enter(cell, gate)
        for corner in range(cell.shape.n_corners):
            if corner not in cell.known:
                cell.nodes[corner] = cell.known[corner] = self.read_corner(cell, corner)
        self.read_middles(cell, gate)
        self.cells.append(cell)
        self.count_edges(cell)
        self.join_sides(cell)

    def enter(self, cell, gate):
        node = 1
        for _ in range(7):
            node = 2 * node + self.bits.bit(("entry", cell.shape, gate.number, node))
        entry, n = node - 128, len(gate.nodes)
        number, turn, forward = entry // 12, entry // 2 % 6, entry % 2
        need(number < len(cell.shape.sides) and turn < n, "a side does not exist")
        corners = cell.shape.sides[number]
        need(len(corners) == n, "a side has another number of corners")
        for i, corner in enumerate(corners):
            place = (turn + i if forward else turn - i) % n
            cell.nodes[corner] = cell.known[corner] = gate.nodes[place]
        cell.entry = number

    def read_corner(self, cell, corner):
        candidates = self.candidates(cell, corner)
        for i, (node, votes, most) in enumerate(candidates):
            context = i, len(candidates), min(votes, 3), most
            if self.bits.bit(("candidate", cell.shape, *context)):
                return node
        around = self.around(cell, [node for node, *_ in candidates])
        return self.read_other(("new", cell.shape, len(candidates)), around)

    def candidates(self, cell, corner):
        """Return nodes for a corner, with their votes and most cells at an edge."""
        votes, most = {}, {}
        for corners in cell.shape.sides:
            if corner not in corners:
                continue
            size = len(corners)
            pairs = [(i, corners[i], corners[(i + 1) % size]) for i in range(size)]
            known = [pair for pair in pairs if pair[1] in cell.known and pair[2] in cell.known]
            if not known:
                continue
            i, *ends = known[0]
            a, b = (cell.known[end] for end in ends)
            steps, n_met = (corners.index(corner) - i) % size, 0
            for side, place in self.open_at(a):
                nodes = side.nodes
                if len(nodes) != size or n_met == 2:
                    continue
                if nodes[(place + 1) % size] == b:
                    node = nodes[(place + steps) % size]
                elif nodes[place - 1] == b:
                    node = nodes[place - steps]
                else:
                    continue
                n_met += 1
                is_full = node not in votes and len(votes) == MAX_PROPOSED
                if node in cell.known.values() or is_full:
                    continue
                votes[node] = votes.get(node, 0) + 1
                most[node] = max(most.get(node, 0), self.cells_at(a, b))
        ranked = sorted(votes, key=lambda node: (-votes[node], -most[node]))
        return [(node, votes[node], most[node]) for node in ranked[:MAX_CANDIDATES]]

    def around(self, cell, candidates):
        """Return nodes of open sides at the corners of the entered side."""
        corners = [] if cell.entry is None else cell.shape.sides[cell.entry]
        sides = (side for corner in corners for side, _ in self.open_at(cell.nodes[corner]))
        nodes = dict.fromkeys(node for side in sides for node in side.nodes)
        excluded = {*candidates, *cell.known.values()}
        return [node for node in nodes if node not in excluded][:MAX_AROUND]

    def read_other(self, name, around=()):
        """Return a new node, one around, or an earlier one."""
        if self.bits.bit(name):
            need(self.n_named < self.n_verts, "there are too many vertices")
            self.n_named += 1
            return self.n_named - 1
        size = min(len(around), 15)
        if around and self.bits.bit(("is around", size)):
            place = self.bits.count(("place", size))
            need(place < len(around), "a node is not around")
            return around[place]
        back = self.bits.count("back")
        need(back < self.n_named, "a node does not exist")
        return self.n_named - 1 - back

    def read_middle(self, shared):
        if shared is not None and self.bits.bit("shared"):
            return shared
        return self.read_other("new middle")

    def read_middles(self, cell, gate):
        slot = cell.shape.n_corners
        for a, b in cell.shape.edges if cell.type.has_mids else ():
            edge = self.edge(cell.nodes[a], cell.nodes[b])
            cell.nodes[slot] = self.read_middle(edge.middle if edge else None)
            slot += 1
        for number in cell.type.centers:
            side = gate if number == cell.entry else self.same_side(cell, number)
            cell.nodes[slot] = self.read_middle(center_of(side) if side else None)
            slot += 1
        if cell.type.has_middle:
            cell.nodes[slot] = self.read_middle(None)

    def same_side(self, cell, number):
        """Return the open side with the nodes of a side of the cell, or None."""
        nodes = set(cell.side(number))
        for side, _ in self.open_at(min(nodes)):
            if set(side.nodes) == nodes:
                return side
        return None

    def count_edges(self, cell):
        for i, (a, b) in enumerate(cell.shape.edges):
            a, b = cell.nodes[a], cell.nodes[b]
            edge = self.edge(a, b)
            if edge is None:
                edge = Edge()
                self.edges_at[min(a, b)].append((max(a, b), edge))
            edge.n_cells += 1
            if cell.type.has_mids and edge.middle is None:
                edge.middle = cell.nodes[cell.shape.n_corners + i]

    def join_sides(self, cell):
        for number in range(len(cell.shape.sides)):
            if number == cell.entry:
                continue
            met = self.same_side(cell, number)
            if met is not None:
                met.is_open = False
                continue
            side = Side(cell, number)
            self.sides.append(side)
            for corner, node in enumerate(side.nodes):
                self.sides_at[node].append((side, corner))


def center_of(side):
    """Return the node on a side, or None."""
    kind = side.cell.type
    if side.number not in kind.centers:
        return None
    first = kind.shape.n_corners + len(kind.shape.edges)
    return side.cell.nodes[first + kind.centers.index(side.number)]


@dataclass
class Cells:
    """Cells of a mesh in output order, and their surface: see `read_cells`."""

    cells: list
    sizes: list
    owners: list
    links: list
    neighbors: list


def paired(cells):
    """Return the pairs of cells and sides with the same nodes, as a dict both ways."""
    same, mates = defaultdict(list), {}
    for i, cell in enumerate(cells):
        for k in range(len(cell.shape.sides)):
            same[frozenset(cell.side(k))].append((i, k))
    for several in same.values():
        for one, other in zip(several[::2], several[1::2], strict=False):
            mates[one], mates[other] = other, one
    return mates


def surface_of(cells):
    """Return the triangles of the surface, and the corners and the cell of each face."""
    mates, triangles, sizes, owners = paired(cells), [], [], []
    for i, cell in enumerate(cells):
        if cell.shape.solid:
            sides = [cell.side(k) for k in range(len(cell.shape.sides)) if (i, k) not in mates]
        else:
            sides = [cell.nodes[: cell.shape.n_corners]]
        for side in sides:
            outline = list(dict.fromkeys(side))
            if len(outline) < 3:
                continue
            triangles += [(outline[0], b, c) for b, c in pairwise(outline[1:])]
            sizes.append(len(outline))
            owners.append(i)
    return triangles, sizes, owners


def links_of(cells):
    """Return pairs of vertices that edges join."""
    links = []
    for cell in cells:
        shape, kind, nodes = cell.shape, cell.type, cell.nodes
        ends = [(nodes[a], nodes[b]) for a, b in shape.edges]
        if not kind.has_mids:
            links += ends
            continue
        mids = nodes[shape.n_corners : shape.n_corners + len(ends)]
        centers = nodes[shape.n_corners + len(ends) :]
        for (a, b), middle in zip(ends, mids, strict=True):
            links += [(a, middle), (b, middle)]
        for number, center in zip(kind.centers, centers, strict=False):
            side = set(shape.sides[number])
            on_side = [m for edge, m in zip(shape.edges, mids, strict=True) if side >= set(edge)]
            links += [(middle, center) for middle in on_side]
        if kind.has_middle:
            links += [(node, centers[-1]) for node in centers[:-1] or mids]
    return links


def neighbors_of(pairs, n):
    """Return the neighbors of each of n items, ascending."""
    around = [set() for _ in range(n)]
    for a, b in pairs:
        if a != b:
            around[a].add(b)
            around[b].add(a)
    return [sorted(numbers) for numbers in around]


def across_sides(cells):
    """Return pairs of cells that share a side."""
    return [(a, b) for (a, _), (b, _) in paired(cells).items()]


def read_order(payload, cells, n_verts):
    """Return the internal numbers of cells, and of vertices, in output order."""
    if not payload:
        return list(range(len(cells))), list(range(n_verts))
    need(payload[0] == 3, "ORDER has an unknown kind")
    need(len(payload) == 1 or payload[-1], "ORDER ends in a zero byte")
    bits = NamedBits(BitStream(payload[1:]))
    around = neighbors_of(across_sides(cells), len(cells))
    listed = read_items(bits, "cells", len(cells), around)
    names = list(dict.fromkeys(node for i in listed for node in cells[i].nodes))
    names += sorted(set(range(n_verts)) - set(names))
    name_of = {vertex: name for name, vertex in enumerate(names)}
    links = [(name_of[a], name_of[b]) for a, b in links_of(cells)]
    vertices = read_items(bits, "vertices", n_verts, neighbors_of(links, n_verts))
    bits.stream.end()
    return listed, [names[vertex] for vertex in vertices]


def read_cells(container):
    """Return the internal faces, the order of vertices, the output faces, and `Cells`."""
    header, payload = container.header, Payload(container.only("CELLS"))
    n_cells, n_nodes, n_faces = (payload.varint() for _ in range(3))
    need(0 < n_cells <= 2**26 and n_cells <= n_nodes <= 2**28, "there are too many cells")
    need(header.order != 1, "cells have no order of vertices alone")
    others = ("CONNECTIVITY", "EDIT", "POLYGONS")
    need(not any(map(container.all_of, others)), "cells come with other faces")
    internal = CellReader(payload.rest(), n_cells, n_nodes, header.n_verts).read()
    faces, sizes, _ = surface_of(internal)
    need((len(faces), len(sizes)) == (header.n_faces, n_faces), "the surface has other faces")
    need(bool(container.all_of("ORDER")) == (header.order == 0), "ORDER is missing or not needed")
    payload = b"" if header.order else container.only("ORDER")
    order, vertices = read_order(payload, internal, header.n_verts)
    number_of = {vertex: number for number, vertex in enumerate(vertices)}
    output = [Cell(internal[i].code, [number_of[v] for v in internal[i].nodes]) for i in order]
    listed, sizes, owners = surface_of(output)
    links = links_of(internal), across_sides(output)
    return faces, vertices, listed, Cells(output, sizes, owners, *links)
