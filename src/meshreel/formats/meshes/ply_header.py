"""Parser for PLY headers: the elements of a file and their encoding."""

from dataclasses import dataclass

from meshreel.errors import FormatError

ENCODINGS = ("ascii", "binary_little_endian", "binary_big_endian")
HEADER_END = b"end_header"
KEYWORDS = ("format", "element", "property", "end_header")

TYPE_CODES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4", "double": "f8", "float32": "f4", "float64": "f8",
    **{f"int{8 * width}": f"i{width}" for width in (1, 2, 4, 8)},
    **{f"uint{8 * width}": f"u{width}" for width in (1, 2, 4, 8)},
}  # fmt: skip
"""Numpy type codes for the names of the PLY specification and those of later exporters."""


@dataclass(frozen=True)
class PlyProperty:
    """A column of an element: one number per row, or a list preceded by its length."""

    name: str
    """Name in the file."""
    code: str
    """Numpy type code of the numbers, without byte order."""
    count_code: str = ""
    """Numpy type code of the length of a list; empty for a single number per row."""


@dataclass(frozen=True)
class PlyElement:
    """A table of the file: name, number of rows, and columns."""

    name: str
    n_rows: int
    properties: tuple[PlyProperty, ...] = ()

    def property_named(self, *names: str) -> PlyProperty:
        """Return the first property with one of the given names.

        Raises
        ------
        FormatError
            If there is none.
        """
        for candidate in self.properties:
            if candidate.name in names:
                return candidate
        raise FormatError(
            f"element {self.name!r} needs a property {' or '.join(names)}; it has "
            f"{', '.join(p.name for p in self.properties) or 'none'}"
        )


@dataclass(frozen=True)
class PlyHeader:
    """Encoding, elements in file order, and the byte offset of the data.

    `skipped` describes ignored lines that begin with no PLY keyword, such as "line 3 'made by'".
    """

    encoding: str
    elements: tuple[PlyElement, ...]
    body_start: int
    skipped: tuple[str, ...] = ()
    textures: tuple[str, ...] = ()
    """Names of images in comments."""


def read_ply_header(data: bytes) -> PlyHeader:
    """Parse the header of a PLY file.

    Raises
    ------
    FormatError
        If the data is not a PLY file, or a header line is invalid, which the error names.
    """
    if data[:3] != b"ply" or data[3:4] not in (b"\n", b"\r"):
        raise FormatError("does not begin with a line 'ply'; it is not a PLY file")
    end, body_start = _end_of_header(data)
    encoding, elements, skipped, textures = "", list[PlyElement](), list[str](), list[str]()
    text = data[:end].decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    for number, line in enumerate(text.split("\n"), start=1):
        match line.split():
            case ["format", str(name), _] if name in ENCODINGS:
                encoding = name
            case ["element", str(name), str(count)] if count.isdecimal() and len(count) < 19:
                elements.append(PlyElement(name, int(count)))
            case ["property", *words] if elements:
                elements[-1] = _with_property(elements[-1], words, number)
            case ["comment", "TextureFile" | "texture", *words] if words:
                textures.append(" ".join(words))
            case [] | ["ply" | "comment", *_]:  # comments are for people
                pass
            case words if words[0] not in KEYWORDS and (
                words[0] == "obj_info" or TYPE_CODES.keys().isdisjoint(words)
            ):
                skipped.append(f"line {number} {line.strip()[:60]!r}")
            case _:  # misspelled properties too: ignoring them would shift the data
                raise FormatError(f"line {number}: {line[:60]!r} is not a line of a PLY header")
    if not encoding:
        raise FormatError(f"the header has no format line; expected one of {', '.join(ENCODINGS)}")
    return PlyHeader(encoding, tuple(elements), body_start, tuple(skipped), tuple(textures))


def _end_of_header(data: bytes) -> tuple[int, int]:
    """Offsets of the newline before "end_header" and of the body.

    All lines end like the first one, with LF, CRLF or CR; the last line may mix LF and CRLF.
    """
    is_mac = data[3:4] == b"\r" and data[4:5] != b"\n"
    line_ends = [b"\r"] if is_mac else [b"\r\n", b"\n"]
    end = data.find(line_ends[-1] + HEADER_END)
    after = end + len(line_ends[-1] + HEADER_END)
    line_end = next((ending for ending in line_ends if data.startswith(ending, after)), None)
    if end < 0 or line_end is None:
        raise FormatError("the header has no line 'end_header'; the file is truncated or damaged")
    return end, after + len(line_end)


def _with_property(element: PlyElement, words: list[str], number: int) -> PlyElement:
    match words:
        case ["list", count_type, value_type, name]:
            new_property = PlyProperty(name, _code(value_type, number), _code(count_type, number))
        case [value_type, name]:
            new_property = PlyProperty(name, _code(value_type, number))
        case _:
            raise FormatError(f"line {number}: a property needs a type and a name; got {words}")
    if new_property.count_code.startswith("f"):
        raise FormatError(f"line {number}: the length of a list must be an integer; got {words}")
    if any(new_property.name == before.name for before in element.properties):
        raise FormatError(f"line {number}: property {new_property.name!r} is declared twice")
    return PlyElement(element.name, element.n_rows, (*element.properties, new_property))


def _code(type_name: str, number: int) -> str:
    if type_name not in TYPE_CODES:
        raise FormatError(
            f"line {number}: {type_name[:40]!r} is not a PLY type; "
            f"expected one of {', '.join(TYPE_CODES)}"
        )
    return TYPE_CODES[type_name]
