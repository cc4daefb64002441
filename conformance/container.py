"""Header, sections and segments of a stream, parsed and checked."""

import math
import struct
import zlib
from dataclasses import dataclass, field, replace
from itertools import pairwise

from conformance.bits import need

METHODS = ("pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft", "reel", "lossless", "grid")
NAMES = {
    0: "END",
    1: "CONNECTIVITY",
    2: "ORDER",
    3: "ANCHOR_VERTICES",
    4: "SHAPE",
    5: "SEGMENT",
    6: "REFERENCE",
    7: "EDIT",
    8: "CELLS",
    16: "BLOCK",
    17: "BASIS",
    18: "ANCHORS",
    19: "COEFFICIENTS",
    20: "EXACT",
    21: "FIELDS",
    22: "CORRECTIONS",
    23: "TRACK_BLOCK",
    24: "VALUES",
    25: "MISSING",
    26: "ANCHOR_RESIDUALS",
    27: "ROUNDING",
    129: "ERROR_BOUND",
    130: "INDEX",
    131: "POLYGONS",
    132: "ATTRIBUTE",
    133: "GROUPS",
    134: "PARTS",
    135: "START",
    136: "MATERIAL",
    137: "IMAGE",
    138: "TRACK",
    139: "HARD_EDGES",
    140: "TIMES",
    141: "ATTRIBUTE_FROM_POINTS",
}
MAX_NAME_BYTES = 4096
MAX_COMPACT = 1024
MAGIC = b"\x89REEL\r\n\x1a"


@dataclass
class Header:
    """The header of a stream, or that of a further segment."""

    n_frames: int
    n_verts: int
    n_faces: int
    fps: float
    vertex_type: int
    method: str
    laplacian: int
    order: int
    origin: tuple
    scale: float
    name: str


class Payload:
    """Bytes, read from the front."""

    def __init__(self, data):
        self.data, self.position = data, 0
        self.is_compact = False

    def take(self, n):
        need(self.position + n <= len(self.data), "the data ends too early")
        data = self.data[self.position : self.position + n]
        self.position += n
        return data

    def rest(self):
        return self.take(len(self.data) - self.position)

    def byte(self):
        return self.take(1)[0]

    def number(self, kind):
        """Read a little-endian number; `kind` is a letter of `struct`."""
        return struct.unpack("<" + kind, self.take(struct.calcsize(kind)))[0]

    def varint(self):
        value = 0
        for i in range(9):
            byte = self.byte()
            value += (byte % 128) << (7 * i)
            if byte < 128:
                return value
        return need(False, "a varint does not end")

    def text(self):
        return self.take(self.varint()).decode()

    def end(self):
        need(self.position == len(self.data), "the data is longer than expected")


def read_header(payload):
    need(payload.take(8) == MAGIC and payload.byte() == 3, "not a stream of version 3")
    n_frames, n_verts, n_faces = (payload.varint() for _ in range(3))
    rate = payload.varint()
    fps = rate - 1 if rate else payload.number("d")
    need(rate <= 2**32 and math.isfinite(fps) and fps >= 0, "the frames per second are invalid")
    codes = read_codes(payload)
    origin, scale = read_placement(payload, codes)
    n_name_bytes = payload.varint()
    need(n_name_bytes <= MAX_NAME_BYTES, "the name is too long")
    name = payload.take(n_name_bytes).decode()
    vertex_type, method, laplacian, order, _, payload.is_compact = codes
    if payload.is_compact:
        need(len(payload.data) <= MAX_COMPACT, "a compact stream is too long")
    else:
        check_crc(payload, 0)
    return checked(
        Header(
            n_frames, n_verts, n_faces, float(fps), vertex_type, method, laplacian, order,
            origin, scale, name,
        )
    )  # fmt: skip


def read_codes(payload):
    """Return vertex type, method, Laplacian, order, and whether the placement is in doubles.

    Last whether the stream is compact.
    """
    method, form = payload.byte(), payload.byte()
    need(method < len(METHODS) and form < 128, "the form of the header is unknown")
    order, laplacian = form // 2 % 4, form // 8 % 4
    return 8 if form % 2 else 4, METHODS[method], laplacian, order, form // 32 % 2, form >= 64


def read_placement(payload, codes):
    """Return origin and scale."""
    *origin, scale = (payload.number("d" if codes[4] else "f") for _ in range(4))
    return tuple(origin), scale


def checked(header):
    """Return the header after checking its fields."""
    need(header.laplacian < 3 and header.order < 3)
    need(header.n_verts and header.n_faces, "a mesh is empty")
    need(all(math.isfinite(x) for x in (*header.origin, header.scale)) and header.scale > 0)
    return header


def header_of_segment(first, data):
    """Return the header of a segment from the payload of its SEGMENT."""
    payload = Payload(data)
    n_verts, n_faces = payload.varint(), payload.varint()
    codes = read_codes(payload)
    vertex_type, method, laplacian, order, _, is_compact = codes
    need(not is_compact, "a segment is compact")
    origin, scale = first.origin, first.scale
    if payload.position < len(data):
        origin, scale = read_placement(payload, codes)
    payload.end()
    return checked(
        replace(
            first, n_verts=n_verts, n_faces=n_faces, vertex_type=vertex_type, method=method,
            laplacian=laplacian, order=order, origin=origin, scale=scale,
        )
    )  # fmt: skip


def check_crc(payload, start):
    """Compare the checksum that follows with that of the bytes since `start`."""
    crc = zlib.crc32(payload.data[start : payload.position])
    need(payload.number("I") == crc, "a checksum is wrong")


def read_sections(payload):
    """Yield position, name and payload of each section up to END."""
    while True:
        start = payload.position
        number = payload.byte()
        section = payload.take(payload.varint())
        if not payload.is_compact:
            check_crc(payload, start)
        elif number == 0:
            check_crc(payload, 0)
        need(number in NAMES or number >= 128, "a required section is unknown")
        yield start, NAMES.get(number, "unknown"), section
        if number == 0:
            payload.end()
            return


@dataclass
class Container:
    """The sections of a segment: leading ones by name, and a dict for each track of each block.

    `start` is the position of its SEGMENT; `begins` has those of BLOCK and TRACK_BLOCK per block.
    The first `n_shared` leading sections are stored by earlier segments.
    """

    header: Header
    leading: list
    blocks: list
    start: int = 0
    begins: list = field(default_factory=list)
    n_shared: int = 0
    times: list | None = None

    def all_of(self, name):
        return [payload for other, payload in self.leading if other == name]

    def only(self, name):
        (payload,) = self.all_of(name)
        return payload


OF_MESH = (
    *("CONNECTIVITY", "ORDER", "EDIT", "CELLS", "POLYGONS", "ATTRIBUTE", "GROUPS"),
    *("PARTS", "MATERIAL", "IMAGE", "HARD_EDGES", "ATTRIBUTE_FROM_POINTS"),
)
IN_BLOCKS = (
    *("BASIS", "ANCHORS", "COEFFICIENTS", "EXACT", "FIELDS", "CORRECTIONS"),
    *("VALUES", "MISSING", "ANCHOR_RESIDUALS", "ROUNDING"),
)
OF_VALUES = {"BLOCK", "TRACK_BLOCK", "VALUES"}
OF_MODES = {"BLOCK", "BASIS", "FIELDS", "CORRECTIONS", "COEFFICIENTS"}
OF_MODES_OF_A_TRACK = {*OF_MODES, "TRACK_BLOCK", "MISSING"} - {"BLOCK"}
OF_PAPER = {"BLOCK", "BASIS", "ANCHORS", "ANCHOR_RESIDUALS", "EXACT", "COEFFICIENTS"}
LAST = {"COEFFICIENTS", "VALUES"}
REPEATED = {"ATTRIBUTE", "ATTRIBUTE_FROM_POINTS", "GROUPS", "MATERIAL", "IMAGE", "TRACK"}


def read_containers(data):
    """The segments of a whole stream, its index compared with their blocks."""
    payload = Payload(data)
    container = Container(read_header(payload), [], [])
    containers, index, end, after_segment = [container], (None, b""), None, None
    for start, name, section in read_sections(payload):
        is_last = name == "END" or (name == "INDEX" and index[0] is None)
        need(end is None or is_last, "a section follows INDEX or TIMES")
        if name == "unknown":
            continue
        need(not payload.is_compact or name not in ("SEGMENT", "INDEX"), "it is not compact")
        if name == "SEGMENT":
            header = header_of_segment(containers[0].header, section)
            container = Container(header, [], [], start)
            containers.append(container)
            after_segment = payload.position
        elif name == "REFERENCE":
            need(start == after_segment, "REFERENCE does not follow SEGMENT")
            container.leading = referred_sections(containers, Payload(section))
            container.n_shared = len(container.leading)
        elif name in ("BLOCK", "TRACK_BLOCK"):
            if name == "BLOCK":
                container.blocks.append([])
                container.begins.append([])
            need(container.blocks and (name == "BLOCK") != bool(container.blocks[-1]))
            container.blocks[-1].append({name: section})
            container.begins[-1].append(start)
        elif name in IN_BLOCKS:
            group = container.blocks[-1][-1] if container.blocks else {}
            need(group and name not in group and LAST.isdisjoint(group), "a section is misplaced")
            group[name] = section
        elif name == "TIMES" and container.blocks:
            end = start
            containers[0].leading.append((name, section))
        elif name in ("INDEX", "END"):
            end = start if end is None else end
            if name == "INDEX":
                index = start, section
            else:
                need(section == (b"" if index[0] is None else struct.pack("<Q", index[0])))
        else:
            need(not container.blocks, "a section is misplaced after the blocks")
            is_of_file = name in ("START", "TIMES")
            need(not is_of_file or len(containers) == 1, f"{name} is in a further segment")
            container.leading.append((name, section))
    for container in containers:
        names = [name for name, _ in container.leading if name not in REPEATED]
        need(len(set(names)) == len(names), "a section is stored twice")
    lengths = [length for container in containers for length in lengths_of(container)]
    need(
        containers[0].header.n_frames in (0, sum(lengths)),
        "frames are missing",
    )
    set_times(containers, lengths)
    if index[0] is not None:
        check_index(containers, Payload(index[1]), end)
    return containers


def set_times(containers, lengths):
    """Give each segment the times of its frames, if the stream has TIMES."""
    first = containers[0]
    if not first.all_of("TIMES"):
        return
    need(not first.all_of("START"), "there are START and TIMES")
    times = read_times(Payload(first.only("TIMES")), sum(lengths))
    for container in containers:
        n_frames = sum(lengths_of(container))
        container.times, times = times[:n_frames], times[n_frames:]


def read_times(payload, n_frames):
    """Return the times of frames in seconds."""
    times = []
    for i in range(n_frames):
        code = payload.varint()
        if code == 0:
            times.append(payload.number("d"))
        else:
            need(i >= 2, "one of the first two times is not stored as it is")
            a, b = times[-1], times[-2]
            z = code - 1
            rank = rank_of(a + (a - b)) + (z // 2 if z % 2 == 0 else -(z + 1) // 2)
            times.append(double_of(rank))
        need(math.isfinite(times[-1] - times[0]), "a time is not finite")
        need(i == 0 or times[-2] < times[-1], "the times do not ascend")
    payload.end()
    return times


def rank_of(number):
    """Return the number of a double among all in ascending order; 0 is that of 0."""
    bits = struct.unpack("<q", struct.pack("<d", number))[0]
    return bits if bits >= 0 else -(bits + 2**63)


def double_of(rank):
    """Return the double with a rank modulo 2^64."""
    rank = (rank + 2**63) % 2**64 - 2**63
    bits = rank if rank >= 0 else -(2**63) - rank
    return struct.unpack("<d", struct.pack("<q", bits))[0]


def referred_sections(containers, payload):
    """The sections that the REFERENCE of the last segment adds to it."""
    sections, n_ranges = [], 0
    while payload.position < len(payload.data) or not n_ranges:
        sections += sections_of_range(containers, payload)
        n_ranges += 1
    need(n_ranges <= 2, "a reference has more than two ranges")
    return sections


def sections_of_range(containers, payload):
    """The sections of the next range of a REFERENCE."""
    distance, n_skipped, n_sections = (payload.varint() for _ in range(3))
    need(0 < distance < len(containers) and n_sections > 0, "a reference is out of range")
    need(n_skipped + n_sections < 256, "a reference is out of range")
    other = containers[-1 - distance]
    stored = [one for one in other.leading[other.n_shared :] if one[0] in OF_MESH]
    need(n_skipped + n_sections <= len(stored), "a reference adds sections that do not exist")
    shared = stored[n_skipped : n_skipped + n_sections]
    need("ATTRIBUTE_FROM_POINTS" not in dict(shared), "a shared attribute depends on positions")
    return shared


def read_container(data):
    """Return the only segment of a stream."""
    (container,) = read_containers(data)
    return container


def lengths_of(container):
    """Return the frames of each block, after checking that blocks have all tracks."""
    n_tracks = 1 + len(container.all_of("TRACK"))
    need(container.blocks, "a segment has no blocks")
    need(all(len(block) == n_tracks for block in container.blocks), "a block lacks a track")
    groups = [group for block in container.blocks for group in block]
    need(not any(LAST.isdisjoint(group) for group in groups), "a block has no end")
    return [Payload(block[0]["BLOCK"]).varint() for block in container.blocks]


def check_index(containers, index, end):
    """Compare the index with the segments and their blocks."""
    ends = [*(container.start for container in containers[1:]), end]
    for number, container in enumerate(containers):
        first = container.begins[0][0]
        if number:
            header, n_tracks = container.header, len(container.blocks[0])
            expected = [header.n_verts, header.n_faces, n_tracks, first - container.start]
        else:
            expected = [first]
        expected.append(len(container.blocks))
        starts = [*container.begins, [ends[number]]]
        for block, length in enumerate(lengths_of(container)):
            edges = [*starts[block], starts[block + 1][0]]
            expected += [length, *(after - before for before, after in pairwise(edges))]
        need(all(index.varint() == number for number in expected), "the index is wrong")
    index.end()
