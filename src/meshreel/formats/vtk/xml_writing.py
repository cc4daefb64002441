"""Writers for VTK XML files: polygons (``.vtp``), cells (``.vtu``) and collections (``.pvd``).

Arrays are binary AppendedData, which VTK reads bit for bit. Arrays that all frames share, such as
faces, are compressed once.
"""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.notes import note_written_rate
from meshreel.formats.options import WriteOptions
from meshreel.formats.surfaces.cells import POLYGON
from meshreel.formats.vtk.output_arrays import (
    FRAME_RATE,
    OutputArray,
    output_arrays,
)
from meshreel.formats.vtk.xml_arrays import ATTRIBUTE_KIND, NUMBERS, TRACK_KIND, UNITS
from meshreel.model.geometry.polygons import join_fans
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import PLAIN, Domain, Surface
from meshreel.model.tracks import TrackSource

Encode = Callable[..., bytes]

TRIANGLE, QUAD = 5, 9
"""VTK cell types for triangles and quads; more programs support them than POLYGON."""

STATIC_LEVEL, FRAME_LEVEL = 6, 0
"""zlib levels: shared arrays are compressed once, arrays of each frame are stored."""

TYPE_NAMES = {code: name for name, code in NUMBERS.items()}


def vtp_encoder(
    faces: Faces,
    surface: Surface = PLAIN,
    notes: list[str] | None = None,
    tracks: Mapping[str, TrackSource] | None = None,
) -> Encode:
    """Return a function that encodes the positions and track values of a frame as a VTP file.

    Parameters
    ----------
    faces : int32 array of shape (M, 3)
    surface : Surface, optional
    notes : list of str, optional
        Receives a sentence for each thing that the file cannot store.
    tracks : mapping of str to TrackSource, optional
        Tracks of vertices and faces; the function takes their values, of shape (N, C), by name.
    """
    return _encoder(faces, surface, notes, tracks, ".vtp")


def vtu_encoder(
    faces: Faces,
    surface: Surface = PLAIN,
    notes: list[str] | None = None,
    tracks: Mapping[str, TrackSource] | None = None,
) -> Encode:
    """Return a function that encodes a frame as a VTU file; see `vtp_encoder`."""
    return _encoder(faces, surface, notes, tracks, ".vtu")


def pvd_pieces(path: Path, n_frames: int) -> list[Path]:
    """Return the paths of the frame files of a collection, in a folder next to it."""
    folder, width = path.with_name(f"{path.stem}_frames"), max(4, len(str(n_frames - 1)))
    return [folder / f"{path.stem}_{index:0{width}d}.vtp" for index in range(n_frames)]


def write_pvd(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a collection and a VTP file for each frame, with the data of its segment."""
    if not stream.fps:
        note_written_rate(stream.notes, FRAME_RATE)
    rows: list[str] = []
    pieces = iter(stream.data_files)
    for segment in stream.segments():
        encode = _encoder(segment.faces, segment.surface, segment.notes, segment.tracks, ".pvd")
        for index, frame in enumerate(segment.frames()):
            name, piece = next(pieces)
            piece.write_bytes(encode(frame, segment.values(index)))
            time = stream.time_of(len(rows), FRAME_RATE)
            file = quoteattr(name)
            rows.append(f'<DataSet timestep="{time!r}" group="" part="0" file={file}/>\n')
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
    extension: str,
) -> Encode:
    arrays = output_arrays(surface, tracks or {}, extension, notes if notes is not None else [])
    counts = surface.sizes(len(faces))
    types = np.full(len(counts), POLYGON, np.uint8)
    types[counts == 3], types[counts == 4] = TRIANGLE, QUAD
    connectivity = {
        "connectivity": _encode(join_fans(counts, faces).astype(np.int64), STATIC_LEVEL),
        "offsets": _encode(np.cumsum(counts, dtype=np.int64), STATIC_LEVEL),
    }
    is_grid = extension == ".vtu"
    connectivity |= {"types": _encode(types, STATIC_LEVEL)} if is_grid else {}
    static = {
        index: _encode(one.values, STATIC_LEVEL)
        for index, one in enumerate(arrays)
        if one.values is not None
    }
    return partial(_file, _Cells(len(counts), connectivity, is_grid=is_grid), arrays, static)


@dataclass(frozen=True)
class _EncodedArray:
    """An array encoded for AppendedData.

    Attributes
    ----------
    facts : str
        XML attributes of the DataArray element.
    data : bytes
        Header with the sizes, and one compressed block.
    """

    facts: str
    data: bytes


def _encode(values: Values, level: int) -> _EncodedArray:
    """Encode an array of shape (N,) or (N, C) with the given zlib level."""
    code = values.dtype.str[1:]
    plain = np.ascontiguousarray(values, f"<{code}").tobytes()
    facts = f'type="{TYPE_NAMES[code]}"'
    if values.ndim == 2:
        facts += f' NumberOfComponents="{values.shape[1]}"'
    packed = zlib.compress(plain, level)
    sizes = (1, len(plain), 0, len(packed))  # blocks, block size, size of a smaller last, packed
    return _EncodedArray(facts, b"".join(size.to_bytes(8, "little") for size in sizes) + packed)


@dataclass(frozen=True, eq=False)
class _Cells:
    """The faces of all frames, as cells of a grid or as polygons."""

    n_faces: int
    arrays: Mapping[str, _EncodedArray]
    is_grid: bool

    @property
    def kind(self) -> str:
        """Type of the VTK file."""
        return "UnstructuredGrid" if self.is_grid else "PolyData"

    @property
    def counts(self) -> str:
        """XML attributes of the Piece with the number of cells."""
        if self.is_grid:
            return f'NumberOfCells="{self.n_faces}"'
        others = "".join(f'NumberOf{kind}="0" ' for kind in ("Verts", "Lines", "Strips"))
        return f'{others}NumberOfPolys="{self.n_faces}"'

    def element(self, appended: "_Appended") -> str:
        """Return the element of the cells, appending their arrays."""
        tag = "Cells" if self.is_grid else "Polys"
        text = "".join(appended.array(name, one) for name, one in self.arrays.items())
        return f"<{tag}>\n{text}</{tag}>\n"


def _file(
    cells: _Cells,
    arrays: list[OutputArray],
    static: Mapping[int, _EncodedArray],
    vertices: Vertices,
    values: Mapping[str, Values] | None = None,
) -> bytes:
    appended, tracks, numbered = _Appended(), values or {}, [*enumerate(arrays)]
    numbers = {
        index: static[index] if index in static else _encode(tracks[one.track], FRAME_LEVEL)
        for index, one in numbered
    }
    data = [
        _data(appended, tag, [(one, numbers[index]) for index, one in numbered if one.domain is of])
        for tag, of in (("PointData", Domain.VERTEX), ("CellData", Domain.FACE))
    ]
    points = appended.array("Points", _encode(vertices, FRAME_LEVEL))
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


def _data(appended: "_Appended", tag: str, arrays: list[tuple[OutputArray, _EncodedArray]]) -> str:
    roles = "".join(f" {one.role}={quoteattr(one.name)}" for one, _ in arrays if one.role)
    elements = (appended.array(one.name, numbers, one) for one, numbers in arrays)
    return f"<{tag}{roles}>\n{''.join(elements)}</{tag}>\n"


class _Appended:
    """Collects encoded arrays for the AppendedData element.

    Attributes
    ----------
    pieces : list of bytes
    """

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        self._size = 0

    def array(self, name: str, numbers: _EncodedArray, about: OutputArray | None = None) -> str:
        """Append an encoded array; return its DataArray element."""
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
