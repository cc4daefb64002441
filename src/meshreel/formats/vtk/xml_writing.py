"""Frames to XML files of VTK: polygons (``.vtp``) or cells (``.vtu``), and collections of them.

Numbers are in binary behind all elements: VTK reads every one bit for bit. What is the same in all
frames, faces above all, is packed once.
"""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.vtk.cells import POLYGON
from meshreel.formats.vtk.written_arrays import (
    FRAME_RATE,
    WrittenArray,
    written_arrays,
)
from meshreel.formats.vtk.xml_arrays import NUMBERS
from meshreel.formats.vtk.xml_file import ATTRIBUTE_KIND, TRACK_KIND, UNITS
from meshreel.model.geometry.fans import join_fans
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import PLAIN, Domain, Surface
from meshreel.model.tracks import TrackSource

Encode = Callable[..., bytes]

TRIANGLE, QUAD = 5, 9
"""Types of cells that programs know better than polygons of as many corners."""

STILL, MOVING = 6, 0
"""Levels of zlib for what is packed once, and for what every frame has anew: that is not packed."""

TYPE_NAMES = {code: name for name, code in NUMBERS.items()}


def vtp_encoder(
    faces: Faces,
    surface: Surface = PLAIN,
    notes: list[str] | None = None,
    tracks: Mapping[str, TrackSource] | None = None,
) -> Encode:
    """A function from the positions and track values of a frame to the bytes of its VTP file.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    surface : Surface, optional
    notes : list of str, optional
        Gains a sentence on what such a file does not hold.
    tracks : mapping of str to TrackSource, optional
        Of vertices and faces; the function takes their values, of shape (N, C), by their names.
    """
    return _encoder(faces, surface, notes, tracks, ".vtp")


def vtu_encoder(
    faces: Faces,
    surface: Surface = PLAIN,
    notes: list[str] | None = None,
    tracks: Mapping[str, TrackSource] | None = None,
) -> Encode:
    """As `vtp_encoder`, for VTU files."""
    return _encoder(faces, surface, notes, tracks, ".vtu")


def pvd_pieces(path: Path, n_frames: int) -> list[Path]:
    """The files of the frames of a collection, in a folder beside it."""
    folder, width = path.with_name(f"{path.stem}_frames"), max(4, len(str(n_frames - 1)))
    return [folder / f"{path.stem}_{index:0{width}d}.vtp" for index in range(n_frames)]


def write_pvd(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write a collection, and a file of polygons for each frame."""
    if not stream.fps:
        stream.notes.append(f"the frame rate is unknown; written as {FRAME_RATE:g} fps")
    encode = _encoder(stream.faces, stream.surface, stream.notes, stream.tracks, ".pvd")
    rows = []
    pieces = zip(stream.frames(), stream.beside, strict=True)
    for index, (frame, (name, piece)) in enumerate(pieces):
        piece.write_bytes(encode(frame, stream.values(index)))
        time = stream.start_s + index / (stream.fps or FRAME_RATE)
        rows.append(f'<DataSet timestep="{time!r}" group="" part="0" file={quoteattr(name)}/>\n')
    text = "".join(
        [
            '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n',
            *rows,
            "</Collection>\n</VTKFile>\n",
        ]
    )
    path.write_text(text, encoding="utf-8")


def _encoder(
    faces: Faces,
    surface: Surface,
    notes: list[str] | None,
    tracks: Mapping[str, TrackSource] | None,
    ending: str,
) -> Encode:
    arrays = written_arrays(surface, tracks or {}, ending, notes if notes is not None else [])
    counts = surface.sizes(len(faces))
    types = np.full(len(counts), POLYGON, np.uint8)
    types[counts == 3], types[counts == 4] = TRIANGLE, QUAD
    connectivity = {
        "connectivity": _numbers(join_fans(counts, faces).astype(np.int64), STILL),
        "offsets": _numbers(np.cumsum(counts, dtype=np.int64), STILL),
    }
    is_grid = ending == ".vtu"
    connectivity |= {"types": _numbers(types, STILL)} if is_grid else {}
    known = {
        index: _numbers(one.values, STILL)
        for index, one in enumerate(arrays)
        if one.values is not None
    }
    return partial(_file, _Cells(len(counts), connectivity, is_grid=is_grid), arrays, known)


@dataclass(frozen=True)
class _Numbers:
    """The numbers of an array, as a file has them behind its elements.

    Attributes
    ----------
    facts : str
        What the element says of them.
    data : bytes
        One block, behind its sizes.
    """

    facts: str
    data: bytes


def _numbers(values: Values, level: int) -> _Numbers:
    """Those of an array of shape (N,) or (N, C), packed as tightly as a level of zlib says."""
    code = values.dtype.str[1:]
    plain = np.ascontiguousarray(values, f"<{code}").tobytes()
    facts = f'type="{TYPE_NAMES[code]}"'
    if values.ndim == 2:
        facts += f' NumberOfComponents="{values.shape[1]}"'
    packed = zlib.compress(plain, level)
    sizes = (1, len(plain), 0, len(packed))  # blocks, bytes of each, of a last smaller one, packed
    return _Numbers(facts, b"".join(size.to_bytes(8, "little") for size in sizes) + packed)


@dataclass(frozen=True, eq=False)
class _Cells:
    """The faces of all frames, as cells of a grid or as polygons."""

    n_faces: int
    arrays: Mapping[str, _Numbers]
    is_grid: bool

    @property
    def kind(self) -> str:
        """Of the file."""
        return "UnstructuredGrid" if self.is_grid else "PolyData"

    @property
    def counts(self) -> str:
        """How many there are, as the piece says it."""
        if self.is_grid:
            return f'NumberOfCells="{self.n_faces}"'
        others = "".join(f'NumberOf{kind}="0" ' for kind in ("Verts", "Lines", "Strips"))
        return f'{others}NumberOfPolys="{self.n_faces}"'

    def element(self, appended: "_Appended") -> str:
        """The element that holds them."""
        tag = "Cells" if self.is_grid else "Polys"
        text = "".join(appended.array(name, one) for name, one in self.arrays.items())
        return f"<{tag}>\n{text}</{tag}>\n"


def _file(
    cells: _Cells,
    arrays: list[WrittenArray],
    known: Mapping[int, _Numbers],
    vertices: Vertices,
    values: Mapping[str, Values] | None = None,
) -> bytes:
    appended, given, numbered = _Appended(), values or {}, [*enumerate(arrays)]
    numbers = {
        index: known[index] if index in known else _numbers(given[one.track], MOVING)
        for index, one in numbered
    }
    data = [
        _data(appended, tag, [(one, numbers[index]) for index, one in numbered if one.domain is of])
        for tag, of in (("PointData", Domain.VERTEX), ("CellData", Domain.FACE))
    ]
    points = appended.array("Points", _numbers(vertices, MOVING))
    opening = (
        f'<VTKFile type="{cells.kind}" version="1.0" byte_order="LittleEndian" '
        'header_type="UInt64" compressor="vtkZLibDataCompressor">'
    )
    head = [
        f'<?xml version="1.0"?>\n{opening}\n<{cells.kind}>\n',
        f'<Piece NumberOfPoints="{len(vertices)}" {cells.counts}>\n',
        *data,
        f"<Points>\n{points}</Points>\n",
        cells.element(appended),
        f'</Piece>\n</{cells.kind}>\n<AppendedData encoding="raw">\n_',
    ]
    tail = b"\n</AppendedData>\n</VTKFile>\n"
    return b"".join(["".join(head).encode(), *appended.pieces, tail])


def _data(appended: "_Appended", tag: str, arrays: list[tuple[WrittenArray, _Numbers]]) -> str:
    roles = "".join(f" {one.role}={quoteattr(one.name)}" for one, _ in arrays if one.role)
    elements = (appended.array(one.name, numbers, one) for one, numbers in arrays)
    return f"<{tag}{roles}>\n{''.join(elements)}</{tag}>\n"


class _Appended:
    """Numbers that are written behind all elements.

    Attributes
    ----------
    pieces : list of bytes
    """

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        self._size = 0

    def array(self, name: str, numbers: _Numbers, about: WrittenArray | None = None) -> str:
        """The element of an array, whose numbers are taken."""
        facts = f"{numbers.facts} Name={quoteattr(name)}"
        if about is not None:
            facts += f' {TRACK_KIND if about.track else ATTRIBUTE_KIND}="{about.kind}"'
        opening = f'<DataArray {facts} format="appended" offset="{self._size}"'
        self.pieces.append(numbers.data)
        self._size += len(numbers.data)
        if about is None or not about.unit:
            return f"{opening}/>\n"
        unit = escape(" ".join(about.unit.split()))
        key = f'<InformationKey name="{UNITS}" location="vtkDataArray">{unit}</InformationKey>'
        return f"{opening}>{key}</DataArray>\n"
