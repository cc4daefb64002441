"""A reader of adaptive bits and integers, written from docs/format.md alone."""


class Bit:
    """An adaptive bit."""

    def __init__(self):
        self.quick = self.slow = 32768
        self.seen = 0

    def ones(self):
        return min(max((self.quick + self.slow) >> 1, 32), 65536 - 32)

    def learn(self, bit):
        rate = 65536 * 2 // (2 * self.seen + 3)
        quick = max(rate, 1024)
        if bit:
            self.quick += (65535 - self.quick) * quick >> 16
            self.slow += (65535 - self.slow) * rate >> 16
        else:
            self.quick -= self.quick * quick >> 16
            self.slow -= self.slow * rate >> 16
        self.seen = min(self.seen + 1, 256)


class Bits:
    """Adaptive bits by name, read from bytes behind which all are 0."""

    def __init__(self, data):
        self.number = int.from_bytes(data[:8].ljust(8, b"\0"), "big")
        self.data, self.position, self.range = data, 8, (1 << 64) - 1
        self.models = {}

    def coded(self, ones):
        part = (self.range >> 16) * ones
        bit = self.number < part
        if bit:
            self.range = part
        else:
            self.number -= part
            self.range -= part
        self.refill()
        return int(bit)

    def raw(self, n):
        """Bits that are as likely as not."""
        self.range >>= n
        found = min(self.number // self.range, (1 << n) - 1)
        self.number -= found * self.range
        self.refill()
        return found

    def refill(self):
        if self.range < 1 << 32:
            word = self.data[self.position : self.position + 4].ljust(4, b"\0")
            self.position += 4
            self.number = self.number << 32 | int.from_bytes(word, "big")
            self.range <<= 32

    def bit(self, name, context=None):
        """An adaptive bit, beside one in a context if there is one."""
        every = self.models.setdefault(name, Bit())
        if context is None:
            bit = self.coded(every.ones())
        else:
            here = self.models.setdefault((name, context), Bit())
            if not here.seen:
                here.quick, here.slow, here.seen = every.quick, every.slow, min(every.seen, 3)
            bit = self.coded((3 * here.ones() + every.ones()) >> 2)
            here.learn(bit)
        every.learn(bit)
        return bit

    def integer(self, name, context=None, sign=0):
        """An adaptive integer of a model of integers."""
        length = 0
        while length < 31 and self.bit((name, "longer", length), context):
            length += 1
        value = min(length, 1)
        if length >= 2:
            value = 2 | self.bit((name, "second", length), context)
        if length >= 3:
            value = 2 * value | self.bit((name, "third", length, value & 1))
        low = length - 3
        while low > 0:
            part = min(low, 16)
            value = value << part | self.raw(part)
            low -= part
        return -value if value and self.bit((name, "negative", sign), context) else value


def sign_context(value):
    return 0 if value == 0 else 1 if value > 0 else 2


def integers(data, lengths):
    """Rows of integers, each with a table of its own."""
    bits, rows = Bits(data), []
    for number, length in enumerate(lengths):
        past, row = 0, []
        for _ in range(length):
            e = (past + 4).bit_length() - 1
            context = min(23, 2 * (e - 2) + ((past + 4) >> (e - 1) & 1))
            row.append(bits.integer(number, context, sign_context(row[-1]) if row else 0))
            past = past // 2 + 2 * abs(row[-1])
        rows.append(row)
    return rows


class Leaps:
    """Leaps of one kind."""

    def __init__(self, bits, name):
        self.bits, self.name, self.last = bits, name, 0

    def to(self, ascending, start):
        """The number reached from `start` in a list of ascending numbers."""
        context = min(9, abs(self.last).bit_length())
        self.last = self.bits.integer(self.name, context, sign_context(self.last))
        place = sum(number < start for number in ascending) + self.last
        return ascending[place % len(ascending)]


def face_order(bits, n_faces, twins):
    """First corner of each listed face."""
    listed, corners, open_sides, opened = set(), [], [], 0
    leap, anew = Leaps(bits, "leap"), Leaps(bits, "any")
    place = start = turned = 0
    h, g = 18, 18

    def across(side):
        twin = twins[side]
        return twin if twin != side and twin // 3 not in listed else None

    for _ in range(n_faces):
        near = {}
        for way in range(18):
            w = way - 6
            back = way // 3 if way < 6 else w // 6
            if back >= len(corners):
                continue
            first = corners[-1 - back]
            by = way % 3 if way < 6 else w // 2 % 3
            arrived = across(first // 3 * 3 + (first + by) % 3)
            if way >= 6 and arrived is not None:
                arrived = across(arrived // 3 * 3 + (arrived % 3 + 1 + way % 2) % 3)
            if arrived is not None and all(arrived // 3 != one // 3 for one in near.values()):
                near[way] = arrived
        way = w = 18
        if near and bits.bit(("near", h), g):
            *others, last = near
            way = next((one for one in others if bits.bit(("is", one, h), g)), last)
            arrived, w = near[way], way
        elif open_sides and bits.bit(("open", h)):
            place = leap.to([time for time, _ in open_sides], place)
            arrived = twins[dict(open_sides)[place]]
        else:
            start = anew.to([face for face in range(n_faces) if face not in listed], start)
            arrived, w = 3 * start, 19
        turn = bits.bit(("turn", w, 0), (h, turned))
        turn += turn and bits.bit(("turn", w, 1), (h, turned))
        corner = arrived // 3 * 3 + (arrived + turn) % 3
        corners.append(corner)
        listed.add(corner // 3)
        sides = [corner // 3 * 3 + (corner + k) % 3 for k in range(3)]
        open_sides = [(time, side) for time, side in open_sides if twins[side] not in sides]
        for side in sides:
            if across(side) is not None:
                open_sides.append((opened, side))
                opened += 1
        h, g, turned = way, h, turn
    return corners


def vertex_order(bits, n_verts, faces):
    """Names of vertices in the given order."""
    leap, anew = Leaps(bits, "leap of vertices"), Leaps(bits, "any of vertices")
    place = start = 0
    h, g, came, times, found = 6, 6, set(), {}, []
    around = [[] for _ in range(n_verts)]
    for face in faces:
        for k in range(3):
            around[face[k]] += [face[(k + 1) % 3], face[(k + 2) % 3]]
    for _ in range(n_verts):
        vertex, following = None, found[-1] + 1 if found else 0
        follows = following < n_verts and following not in came
        if follows and bits.bit(("next", h, g, following in times)):
            vertex, way = following, 0
        if vertex is None and found:
            near = [one for one in dict.fromkeys(around[found[-1]]) if one not in came]
            near = [one for one in near if not (follows and one == following)][:16]
            near.sort(key=lambda one: times[one])
            for j, one in enumerate(near):
                if bits.bit(("is it", min(j, 4), min(len(near), 7), h)):
                    vertex, way = one, 1 + min(j, 3)
                    break
        opens = {time: one for one, time in times.items() if one not in came}
        if vertex is None and opens and bits.bit(("open vertex", h)):
            place, way = leap.to(sorted(opens), place), 5
            vertex = opens[place]
        if vertex is None:
            start, way = anew.to([one for one in range(n_verts) if one not in came], start), 6
            vertex = start
        found.append(vertex)
        came.add(vertex)
        for one in around[vertex]:
            if one not in came:
                times.setdefault(one, len(times))
        h, g = way, h
    return found


def along_faces(faces, twins, n_rows):
    """Rows in the order in which they come, each with what it is expected from."""
    came, visited, stacks = [], set(), ([], [], [], [])
    every = [row for face in faces for row in face]
    corners = [[c for c, one in enumerate(every) if one == row] for row in range(n_rows)]
    known = set()

    def turn(corner, by):
        return corner // 3 * 3 + (corner + by) % 3

    def parallelograms(row):
        found = []
        for corner in corners[row][:32]:
            side = turn(corner, 1)
            triple = every[side], every[turn(side, 1)], every[turn(twins[side], 2)]
            if twins[side] != side and known.issuperset(triple) and len(found) < 8:
                found.append(triple)
        return found

    def come(row, near):
        if row not in known:
            expected = parallelograms(row) or ([] if near is None else [(near,)])
            came.append((row, expected))
            known.add(row)

    def push(side):
        if twins[side] == side or twins[side] // 3 in visited:
            return
        row = every[turn(twins[side], 2)]
        stacks[3 if row in known else min(3, len(parallelograms(row)))].append(side)

    for i, face in enumerate(faces):
        if i in visited:
            continue
        visited.add(i)
        for k in range(3):
            come(face[k], face[k - 1] if k else came[-1][0] if came else None)
        for k in range(3):
            push(3 * i + k)
        while any(stacks):
            twin = twins[next(stack for stack in reversed(stacks) if stack).pop()]
            if twin // 3 in visited:
                continue
            visited.add(twin // 3)
            come(every[turn(twin, 2)], every[twin])
            push(turn(twin, 1))
            push(turn(twin, 2))
    for row in range(n_rows):
        come(row, row - 1 if row else None)
    return came


def patterns(data, width, expected):
    """Rows of int32 by number, read in the order and from what is expected."""
    bits, rows, recent, again = Bits(data), {}, [], [0, 0]
    past, signs = [0] * width, [0] * width
    for row, sources in expected:
        repeats = bool(recent) and bits.bit(("again", 2 * again[-2] + again[-1]))
        again.append(int(repeats))
        if repeats:
            node = 1
            for _ in range(6):
                node = 2 * node + bits.bit(("which", node))
            rows[row] = recent.pop(min(node - 64, len(recent) - 1))
        else:
            way = 0 if not sources else 1 if len(sources[0]) == 1 else 2
            values, before = [], 0
            for k in range(width):
                e = (past[k] + 4).bit_length() - 1
                context = way, min(47, 2 * (e - 2) + ((past[k] + 4) >> (e - 1) & 1))
                length = 0
                while length < 32 and bits.bit(("longer", length), context):
                    length += 1
                size = min(length, 1)
                if length >= 2:
                    size = 2 | bits.bit(("second", length), context)
                if length >= 3:
                    size = 2 * size | bits.bit(("third", length, size & 1))
                for place in reversed(range(length - 3)):
                    size = 2 * size | bits.bit(("low", place))
                sign = 0
                if size:
                    sign = 1 + bits.bit(("negative", signs[k], before))
                past[k] = past[k] // 2 + 2 * min(size, 1 << 48)
                signs[k] = before = sign
                origin = [
                    one[0][k] if len(one) == 1 else one[0][k] + one[1][k] - one[2][k]
                    for one in ([rows[r] for r in source] for source in sources)
                ]
                mean = (2 * sum(origin) + len(origin)) // (2 * len(origin)) if origin else 0
                mean = min(max(mean, -(1 << 31)), (1 << 31) - 1)
                value = (mean + (-size if sign == 2 else size) + (1 << 31)) % (1 << 32)
                values.append(value - (1 << 31))
            rows[row] = tuple(values)
        recent = [rows[row], *recent][:64]
    return [rows[row] for row in sorted(rows)]
