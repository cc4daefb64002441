"""The worked example of docs/format.md: a tiny stream byte by byte, two payloads bit by bit.

`python -m conformance.example` prints the lines that stand in the page.
"""

from contextlib import ExitStack
from unittest.mock import patch

from conformance import bits, connectivity, fields
from conformance.connectivity import read_faces
from conformance.container import NAMES, Payload, read_container, read_header, read_sections
from conformance.fields import FieldReader
from conformance.hierarchy import passes_of, resolutions_of

HEADER = (
    *(("magic", 8), ("version", 2), ("frames", 4), ("vertices", 4), ("faces", 4), ("fps", 8)),
    *(("vertex type, method, Laplacian, order", 4), ("origin", 24), ("scale", 8)),
    *(("name length", 2), ("checksum", 4)),
)
"""Fields of the header of a stream without a name, with their bytes."""


def hexadecimal(data):
    """Bytes in hexadecimal; those of many zeros shortened."""
    text = data.hex(" ").upper()
    return f"{len(data)} x 00" if len(data) > 8 and not any(data) else text


def lines_of(data):
    """A line for each field of the header and each section."""
    payload, start = Payload(data), 0
    read_header(payload)
    for name, size in HEADER:
        yield start, hexadecimal(data[start : start + size]), name
        start += size
    for begin, name, section in list(read_sections(payload)):
        sized = Payload(data[begin + 1 :])
        sized.varint()
        head, end = begin + 1 + sized.position, begin + 1 + sized.position + len(section)
        parts = (data[begin:head], section, data[end : end + 4])
        assert NAMES[data[begin]] == name
        yield begin, " | ".join(hexadecimal(part) for part in parts if part), name


class Traced(bits.BitStream):
    """A bit stream that notes what it reads."""

    notes: list

    def bit(self, probability):
        found = super().bit(probability)
        self.notes.append(f"{probability}:{found}")
        return found

    def raw(self, n):
        found = super().raw(n)
        self.notes.append(f"raw {n}:{found}")
        return found


def traced(read):
    """The bits that a function reads, with the probability of each by 65536."""
    Traced.notes = []
    with ExitStack() as patches:
        for module in (connectivity, fields):
            patches.enter_context(patch.object(module, "BitStream", Traced))
        found = read()
    return found, " ".join(Traced.notes)


def example_lines(data):
    """The lines of the page for a stream."""
    container, found = read_container(data), []
    for start, text, name in lines_of(data):
        found.append(f"{start:3}  {text}  {name}")
    header = container.header
    coded = container.only("CONNECTIVITY")
    faces, notes = traced(lambda: read_faces(coded, header.n_verts, header.n_faces))
    found.append(f"CONNECTIVITY: {notes} = {faces}")
    passes = passes_of(resolutions_of(faces, header.n_verts, 1))
    row, notes = traced(
        lambda: FieldReader(container.blocks[0][0]["COEFFICIENTS"], passes).read_row(0)
    )
    found.append(f"COEFFICIENTS: {notes} = {[row[i] for i in range(len(row))]}")
    return found


if __name__ == "__main__":
    from conformance.make import FOLDER

    print("\n".join(example_lines((FOLDER / "example.reel").read_bytes())))
