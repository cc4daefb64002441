"""The worked example of docs/format.md: a small stream byte by byte, two payloads bit by bit.

`python -m conformance.example` prints the lines of the page.
"""

from contextlib import ExitStack
from unittest.mock import patch

from conformance import bits, connectivity, fields
from conformance.connectivity import read_faces
from conformance.container import NAMES, Payload, read_container, read_header, read_sections
from conformance.fields import FieldReader
from conformance.hierarchy import passes_of, resolutions_of

HEADER = (
    *(("magic", 8), ("version", 1), ("frames, vertices, faces", 3), ("rate", 1), ("method", 1)),
    *(("form", 1), ("origin", 12), ("scale", 4), ("name length", 1), ("checksum", 4)),
)
"""Header fields of the example, with their sizes."""


def hexadecimal(data):
    """Return bytes in hexadecimal; long runs of zeros are abbreviated."""
    text = data.hex(" ").upper()
    return f"{len(data)} x 00" if len(data) > 8 and not any(data) else text


def lines_of(data):
    """Yield position, bytes and name of each header field and section."""
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
    """A bit stream that records the bits it reads."""

    notes: list

    def bit(self, probability):
        bit = super().bit(probability)
        self.notes.append(f"{probability}:{bit}")
        return bit

    def raw(self, n):
        value = super().raw(n)
        self.notes.append(f"raw {n}:{value}")
        return value


def traced(read):
    """Return the result of a function and the bits that it reads, with their probabilities."""
    Traced.notes = []
    with ExitStack() as patches:
        for module in (connectivity, fields):
            patches.enter_context(patch.object(module, "BitStream", Traced))
        result = read()
    return result, " ".join(Traced.notes)


def example_lines(data):
    """Return the lines of the page for a stream."""
    container, lines = read_container(data), []
    for start, text, name in lines_of(data):
        lines.append(f"{start:3}  {text}  {name}")
    header = container.header
    coded = container.only("CONNECTIVITY")
    (faces, _), notes = traced(lambda: read_faces(coded, header.n_verts, header.n_faces))
    lines.append(f"CONNECTIVITY: {notes} = {faces}")
    passes = passes_of(resolutions_of(faces, header.n_verts, 1))
    row, notes = traced(
        lambda: FieldReader(container.blocks[0][0]["COEFFICIENTS"], passes).read_row(0)
    )
    lines.append(f"COEFFICIENTS: {notes} = {[row[i] for i in range(len(row))]}")
    return lines


if __name__ == "__main__":
    from conformance.make import FOLDER

    print("\n".join(example_lines((FOLDER / "example.reel").read_bytes())))
