"""Header and sections: the bytes of a stream, cut up and checked."""

import struct
import zlib
from dataclasses import dataclass

from conformance.bits import need

METHODS = ("pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft", "reel", "lossless", "grid")
NAMES = {
    0: "END",
    1: "CONNECTIVITY",
    2: "ORDER",
    3: "ANCHOR_VERTICES",
    4: "SHAPE",
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
    129: "PROMISE",
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
}
MOST_NAME_BYTES = 4096
MAGIC = b"\x89REEL\r\n\x1a"


@dataclass
class Header:
    """The header, as it is stored."""

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
    """Bytes that are taken from the front."""

    def __init__(self, data):
        self.data, self.position = data, 0

    def take(self, n):
        need(self.position + n <= len(self.data), "the bytes end too early")
        found = self.data[self.position : self.position + n]
        self.position += n
        return found

    def rest(self):
        return self.take(len(self.data) - self.position)

    def byte(self):
        return self.take(1)[0]

    def number(self, kind):
        """A number of the kinds of `struct`, little-endian."""
        return struct.unpack("<" + kind, self.take(struct.calcsize(kind)))[0]

    def varint(self):
        value = 0
        for place in range(9):
            byte = self.byte()
            value += (byte % 128) << (7 * place)
            if byte < 128:
                return value
        return need(False, "a varint does not end")

    def text(self):
        return self.take(self.varint()).decode()

    def end(self):
        need(self.position == len(self.data), "bytes are left over")


def read_header(payload):
    need(payload.take(8) == MAGIC and payload.number("H") == 3, "this is no stream of version 3")
    n_frames, n_verts, n_faces = (payload.number("I") for _ in range(3))
    fps, vertex_type, method = payload.number("d"), payload.byte(), payload.byte()
    laplacian, order = payload.byte(), payload.byte()
    origin, scale = tuple(payload.number("d") for _ in range(3)), payload.number("d")
    n_name_bytes = payload.number("H")
    need(n_name_bytes <= MOST_NAME_BYTES, "the name is too long")
    name = payload.take(n_name_bytes).decode()
    check(payload, 0)
    need(vertex_type in (4, 8) and laplacian < 3 and order < 3 and n_verts and n_faces)
    return Header(
        n_frames, n_verts, n_faces, fps, vertex_type, METHODS[method], laplacian, order, origin,
        scale, name,
    )  # fmt: skip


def check(payload, start):
    """Refuse a wrong checksum of what stands between `start` and here."""
    found = zlib.crc32(payload.data[start : payload.position])
    need(payload.number("I") == found, "a checksum is wrong")


def read_sections(payload):
    """Number of the first byte, name and payload of each section up to END."""
    while True:
        start = payload.position
        number = payload.byte()
        section = payload.take(payload.varint())
        check(payload, start)
        need(number in NAMES or number >= 128, "a section is unknown")
        if number in NAMES:
            yield start, NAMES[number], section
        if number == 0:
            payload.end()
            return


@dataclass
class Container:
    """A stream cut up: sections before the blocks; of each block a dict of them for each track."""

    header: Header
    leading: list
    blocks: list

    def all_of(self, name):
        return [payload for other, payload in self.leading if other == name]

    def only(self, name):
        (payload,) = self.all_of(name)
        return payload


IN_BLOCKS = (
    *("BASIS", "ANCHORS", "COEFFICIENTS", "EXACT", "FIELDS", "CORRECTIONS"),
    *("VALUES", "MISSING", "ANCHOR_RESIDUALS"),
)


def read_container(data):
    """A whole stream, its index compared with its blocks."""
    payload = Payload(data)
    container = Container(read_header(payload), [], [])
    index, begins, end = (None, b""), [], None
    for start, name, section in read_sections(payload):
        if name == "BLOCK":
            container.blocks.append([])
            begins.append([])
        if name in ("BLOCK", "TRACK_BLOCK"):
            need(container.blocks and (name == "BLOCK") != bool(container.blocks[-1]))
            container.blocks[-1].append({name: section})
            begins[-1].append(start)
        elif name in IN_BLOCKS:
            need(container.blocks and name not in container.blocks[-1][-1], "out of place")
            container.blocks[-1][-1][name] = section
        elif name in ("INDEX", "END"):
            end = start if end is None else end
            if name == "INDEX":
                index = start, section
            else:
                need(section == (b"" if index[0] is None else struct.pack("<Q", index[0])))
        else:
            need(not container.blocks, "a section stands behind the blocks")
            container.leading.append((name, section))
    check_blocks(container, index[1], begins, end)
    return container


def check_blocks(container, index, begins, end):
    """Refuse blocks without all tracks, and an index that says otherwise than the blocks."""
    n_tracks = 1 + len(container.all_of("TRACK"))
    need(all(len(block) == n_tracks for block in container.blocks), "a track is missing")
    lengths = [Payload(block[0]["BLOCK"]).varint() for block in container.blocks]
    need(container.header.n_frames in (0, sum(lengths)), "frames are missing")
    if index:
        places = Payload(index)
        need(places.varint() == begins[0][0] and places.varint() == len(lengths))
        starts = [*(start for block in begins for start in block), end]
        for number, length in enumerate(lengths):
            need(places.varint() == length)
            for place in range(number * n_tracks, (number + 1) * n_tracks):
                need(places.varint() == starts[place + 1] - starts[place])
        places.end()
