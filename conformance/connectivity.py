"""The internal faces of a mesh: CONNECTIVITY of docs/format.md."""

from dataclasses import dataclass, field, replace

from conformance.bits import BitStream, Model, NamedBits, SymbolModel, clip, need, new_symbol_model
from conformance.order import twins_of

N_STACKS = 12
INITIAL = {"cap": (2048, 4), "copy": (2048, 4), "far": (2048, 4)}
"""Initial models that differ from the default."""


@dataclass(eq=False)
class Node:
    """A node of a ring; those of caps have no vertex."""

    vertex: int | None
    degree: int
    remaining: int = 0
    across: int = 6
    turned: int = 0
    behind: int | None = None
    number: int = -1
    next: "Node" = field(default=None, repr=False)
    prev: "Node" = field(default=None, repr=False)

    @property
    def is_cap(self):
        return self.vertex is None


def link(a, b):
    a.next, b.prev = b, a


def degree_class(degree):
    return 0 if degree < 4 else degree - 3 if degree <= 9 else 6


def node_class(node):
    return 7 if node.is_cap else degree_class(node.degree)


def remaining_class(node):
    return min(node.remaining, 7)


def flank(node, side):
    """Return the node, and up to three more by `next` or `prev` while one edge remains."""
    nodes = [node]
    while len(nodes) < 4 and nodes[-1].remaining == 1:
        nodes.append(getattr(nodes[-1], side))
    return nodes


class Walk:
    """Reader of the internal faces."""

    def __init__(self, data, n_verts, n_faces):
        self.stream = BitStream(data)
        self.bits = NamedBits(self.stream)
        for name, model in INITIAL.items():
            self.bits.models[name] = Model(*model)
        self.n_verts, self.n_faces, self.faces = n_verts, n_faces, []
        for k in range(2, 10):
            self.bits.models["meets", k] = Model(512, 6)
        self.degrees = [new_symbol_model() for _ in range(17)]
        self.degrees_at = [SymbolModel() for _ in range(513)]
        self.twins = list(range(3 * n_faces))
        self.stacks = [[] for _ in range(N_STACKS)]
        self.nodes, self.released, self.n_numbers = {}, [], 0
        self.n_visited = self.n_closing = self.copied = 0

    def read(self):
        if self.stream.raw(1):
            self.read_listed(self.n_faces)
            self.twins = twins_of(self.faces)
        else:
            self.read_walks()
        self.stream.end()
        return self.faces, self.twins

    def read_listed(self, n_faces):
        a = 0
        for _ in range(n_faces):
            a += self.bits.integer("corner 0")
            b, c = (a + self.bits.integer(f"corner {k}") for k in (1, 2))
            need(all(0 <= v < self.n_verts for v in (a, b, c)), "a corner is not a vertex")
            self.faces.append((a, b, c))

    def read_walks(self):
        n_unused, n_flat, self.n_caps = (self.bits.count("amounts") for _ in range(3))
        self.pinched, self.turns = self.stream.raw(1), self.stream.raw(1)
        self.n_walked = self.n_faces - n_flat
        need(n_unused <= self.n_verts and n_flat <= self.n_faces)
        need(self.n_caps <= 3 * self.n_walked, "there are too many caps")
        while len(self.faces) < self.n_walked:
            self.start_component()
            while any(self.stacks):
                number = next(i for i in range(N_STACKS) if self.stacks[i])
                node = self.stacks[number][-1]
                if number == 0:
                    self.fill(node)
                else:
                    self.grow(node, node.next)
        need(self.n_caps == 0 and self.n_visited == self.n_verts - n_unused)
        self.read_listed(n_flat)

    def start_component(self):
        a = self.read_point(self.n_caps and self.bits.bit("starts open"), None, None)
        b = self.read_point(False, None, None)
        self.is_first = True
        link(a, b)
        link(b, a)
        for node in (a, b):
            node.remaining = node.degree - 1
            self.stack_of(node).append(node)

    def fill(self, n):
        """Add the face between a node without remaining edges and its neighbors."""
        p, q = n.prev, n.next
        is_last = q.next is p and p.remaining == q.remaining == 0
        need(is_last or (p is not q and p.remaining and q.remaining), "a ring cannot be filled")
        turned, opposite, last = self.add_face(n, q, p)
        self.join(last, p.behind)
        if is_last:
            self.join(opposite, q.behind)
            for node in (p, q, n):
                self.release(node)
            return
        p.turned, p.across, p.behind = turned, n.degree, opposite
        link(p, q)
        self.set_remaining(p, p.remaining - 1)
        self.set_remaining(q, q.remaining - 1)
        self.release(n)

    def grow(self, n, m):
        """Add the face at the edge from n to m, to a new point or to a node."""
        if self.meets_node(n, m):
            w = self.read_target(n, m)
            need(w is not n and w is not m and w.remaining >= 2, "a ring cannot be joined there")
            share = self.bits.count("share")
            need(share <= w.remaining - 2, "there are too few edges")
            new = replace(w, remaining=w.remaining - 2 - share)
            turned, opposite, last = self.add_face(n, m, w)
            self.take_number(new)
            link(w.prev, new)
            link(new, m)
            link(n, w)
        else:
            new = self.read_point(self.n_caps and self.bits.bit("cap"), n, m)
            new.remaining = new.degree - 2
            turned, opposite, last = self.add_face(n, m, new)
            link(n, new)
            link(new, m)
        new.across, n.across = n.degree, m.degree
        new.turned = n.turned = turned
        new.behind, n.behind = opposite, last
        self.stack_of(new).append(new)
        if new.prev is not n:
            self.set_remaining(w, share)
        self.set_remaining(n, n.remaining - 1)
        self.set_remaining(m, m.remaining - 1)

    def meets_node(self, n, m):
        k, node = 2, m.next
        while node is not n and k < 9:
            node, k = node.next, k + 1
        at = tuple(map(remaining_class, (n, m, n.prev, m.next)))
        return self.stream.in_context(self.bits.models["meets", k], self.bits.models["meets", at])

    def read_target(self, n, m):
        if self.bits.bit("far"):
            number = self.stream.raw((self.n_numbers - 1).bit_length())
            need(number in self.nodes, "a node does not exist")
            return self.nodes[number]
        side, node = ("prev", n.prev) if self.bits.bit("behind") else ("next", m.next)
        n_steps = self.bits.count("offset")
        need(n_steps <= 23, "a node is too far away")
        for _ in range(n_steps):
            node = getattr(node, side)
        return node

    def read_point(self, is_cap, n, m):
        if is_cap:
            self.n_caps -= 1
            point = Node(None, 2 + self.bits.count("cap degree"))
            need(point.degree - 2 <= 3 * self.n_walked)
        else:
            degree = self.read_degree(n, m)
            point = Node(self.read_vertex(), degree)
        self.take_number(point)
        return point

    def read_vertex(self):
        if self.pinched and self.bits.bit("copy"):
            self.copied += self.bits.integer("copied")
            need(0 <= self.copied < self.n_visited, "a copied vertex does not exist")
            return self.copied
        need(self.n_visited < self.n_verts, "there are too many vertices")
        self.n_visited += 1
        return self.n_visited - 1

    def read_degree(self, n, m):
        around, edge = 16, 512
        if n is not None:
            nodes = flank(n, "prev") + flank(m, "next")
            excess = sum(degree_class(node.degree) - 3 for node in nodes if not node.is_cap)
            around = clip(excess, -7, 8) + 7
            edge = 64 * node_class(n) + 8 * node_class(m) + degree_class(n.across)
        symbol = self.stream.symbol_in_context(self.degrees[around], self.degrees_at[edge])
        return 2 + symbol if symbol < 15 else 17 + self.bits.count("more")

    def add_face(self, a, b, c):
        """Add a face unless it has a cap.

        Returns whether it is flipped, and its sides between b and c, and between c and a.
        """
        is_first, self.is_first = self.is_first, False
        if a.is_cap or b.is_cap or c.is_cap:
            self.n_closing += 1
            need(self.n_closing <= 3 * self.n_walked, "there are too many closing faces")
            return a.turned, None, None
        need(len(self.faces) < self.n_walked, "there are too many faces")
        turned = self.bits.bit(("turned", a.turned)) if self.turns else 0
        side = 3 * len(self.faces)
        corners = (a, c, b) if turned else (a, b, c)
        self.faces.append(tuple(node.vertex for node in corners))
        first, last = (side + 2, side) if turned else (side, side + 2)
        self.join(first, a.behind)
        if is_first:
            b.behind = first
        return turned, side + 1, last

    def join(self, side, other):
        """Make two sides twins, if both are of faces of the mesh."""
        if side is not None and other is not None:
            self.twins[side], self.twins[other] = other, side

    def stack_of(self, node):
        if node.remaining == 0:
            return self.stacks[0]
        return self.stacks[1 if node.is_cap else min(node.remaining + 1, 11)]

    def set_remaining(self, node, remaining):
        self.stack_of(node).remove(node)
        node.remaining = remaining
        self.stack_of(node).append(node)

    def take_number(self, node):
        if self.released:
            node.number = self.released.pop()
        else:
            node.number, self.n_numbers = self.n_numbers, self.n_numbers + 1
        self.nodes[node.number] = node

    def release(self, node):
        self.stack_of(node).remove(node)
        del self.nodes[node.number]
        self.released.append(node.number)


def read_faces(data, n_verts, n_faces):
    """Return the internal faces, as tuples of three vertices, and the twins of their sides."""
    return Walk(data, n_verts, n_faces).read()
