"""Writers for VTK XML files: polygons (``.vtp``), cells (``.vtu``) and collections (``.pvd``).

Arrays are binary AppendedData, which VTK reads bit for bit. Arrays that all frames share, such as
faces, are compressed once.
"""

import zlib
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.options import WriteOptions
from meshreel.formats.surfaces.cells import written_cells
from meshreel.formats.vtk.output_arrays import OutputArray, output_arrays
from meshreel.formats.vtk.xml_arrays import ATTRIBUTE_KIND, NUMBERS, TRACK_KIND, UNITS
from meshreel.model.notes import written_times
from meshreel.model.sequence import Vertices
from meshreel.model.surface import Domain

STATIC_LEVEL, FRAME_LEVEL = 6, 0
"""zlib levels: shared arrays are compressed once, arrays of each frame are stored."""

TYPE_NAMES = {code: name for name, code in NUMBERS.items()}


def pvd_pieces(path: Path, n_frames: int) -> list[Path]:
    """Return the paths of the frame files of a collection, in a folder next to it."""
    folder, width = path.with_name(f"{path.stem}_frames"), max(4, len(str(n_frames - 1)))
    return [folder / f"{path.stem}_{index:0{width}d}.vtu" for index in range(n_frames)]


def write_pvd(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a collection and a VTU file for each frame, with the data of its segment."""
    times = written_times(stream.timing, stream.n_frames, stream.notes).tolist()
    rows: list[str] = []
    pieces = iter(stream.data_files)
    for segment in stream.segments():
        encode = FileEncoder(".pvd", segment)
        for index, frame in enumerate(segment.frames()):
            name, piece = next(pieces)
            piece.write_bytes(encode(frame, segment.values(index)))
            file, time = quoteattr(name), times[len(rows)]
            rows.append(f'<DataSet timestep="{time!r}" group="" part="0" file={file}/>\n')
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1">\n<Collection>\n'
    text = "".join([head, *rows, "</Collection>\n</VTKFile>\n"])
    path.write_text(text, encoding="utf-8")


class FileEncoder:
    """Encodes frames as files of polygons, or of cells; encodes what they share once.

    Parameters
    ----------
    extension : str
        ".vtp" for polygons; others for cells.
    """

    def __init__(self, extension: str, stream: FrameStream) -> None:
        surface = stream.surface
        self._arrays = output_arrays(surface, stream.tracks, extension, stream.notes)
        mesh_cells = written_cells(stream.faces, surface)
        self._kind, self._cell_tag = "PolyData", "Polys"
        other_counts = "".join(f'NumberOf{kind}="0" ' for kind in ("Verts", "Lines", "Strips"))
        self._n_cells = f'{other_counts}NumberOfPolys="{len(mesh_cells.counts)}"'
        cells: dict[str, Values] = {
            "connectivity": mesh_cells.points,
            "offsets": np.cumsum(mesh_cells.counts, dtype=np.int64),
        }
        if extension != ".vtp":
            self._kind, self._cell_tag = "UnstructuredGrid", "Cells"
            self._n_cells = f'NumberOfCells="{len(mesh_cells.counts)}"'
            cells["types"] = mesh_cells.types
        self._cells = {name: _encode(values, STATIC_LEVEL) for name, values in cells.items()}
        self._static = [
            None if array.values is None else _encode(array.values, STATIC_LEVEL)
            for array in self._arrays
        ]

    def __call__(self, vertices: Vertices, values: Mapping[str, Values]) -> bytes:
        """Encode a frame: positions of shape (V, 3), and values of shape (N, C) of each track."""
        appended = _Appended()
        opening = (
            f'<VTKFile type="{self._kind}" version="1.0" byte_order="LittleEndian" '
            'header_type="UInt64" compressor="vtkZLibDataCompressor">'
        )
        encoded = [
            (array, static or _encode(values[array.track], FRAME_LEVEL))
            for array, static in zip(self._arrays, self._static, strict=True)
        ]
        head = [
            f'<?xml version="1.0"?>\n{opening}\n<{self._kind}>\n',
            f'<Piece NumberOfPoints="{len(vertices)}" {self._n_cells}>\n',
        ]
        for tag, is_of_points in (("PointData", True), ("CellData", False)):
            pairs = [pair for pair in encoded if (pair[0].domain is Domain.VERTEX) == is_of_points]
            roles = (f" {array.role}={quoteattr(array.name)}" for array, _ in pairs if array.role)
            elements = (appended.array(array.name, data, array) for array, data in pairs)
            head.append(f"<{tag}{''.join(roles)}>\n{''.join(elements)}</{tag}>\n")
        points = appended.array("Points", _encode(vertices, FRAME_LEVEL))
        cells = "".join(appended.array(name, data) for name, data in self._cells.items())
        head += [
            f"<Points>\n{points}</Points>\n<{self._cell_tag}>\n{cells}</{self._cell_tag}>\n",
            f'</Piece>\n</{self._kind}>\n<AppendedData encoding="raw">\n_',
        ]
        tail = b"\n</AppendedData>\n</VTKFile>\n"
        return b"".join(["".join(head).encode(), *appended.pieces, tail])


vtp_encoder, vtu_encoder = (partial(FileEncoder, extension) for extension in (".vtp", ".vtu"))
"""Encoders of frames as polygons and as cells."""

Encoded = tuple[str, bytes]
"""XML attributes of an array, and its data: a header with the sizes, and one compressed block."""


def _encode(values: Values, level: int) -> Encoded:
    """Encode an array of shape (N,) or (N, C) with the given zlib level."""
    code = values.dtype.str[1:]
    plain = np.ascontiguousarray(values, f"<{code}").tobytes()
    header = f'type="{TYPE_NAMES[code]}"'
    if values.ndim == 2:
        header += f' NumberOfComponents="{values.shape[1]}"'
    packed = zlib.compress(plain, level)
    sizes = (1, len(plain), 0, len(packed))  # blocks, block size, size of a smaller last, packed
    return header, b"".join(size.to_bytes(8, "little") for size in sizes) + packed


class _Appended:
    """Collects encoded arrays for the AppendedData element."""

    def __init__(self) -> None:
        self.pieces: list[bytes] = []
        self._size = 0

    def array(self, name: str, encoded: Encoded, array: OutputArray | None = None) -> str:
        """Append an encoded array; return its DataArray element."""
        header, data = encoded
        header += f" Name={quoteattr(name)}"
        if array is not None:
            header += f' {TRACK_KIND if array.track else ATTRIBUTE_KIND}="{array.kind}"'
        opening = f'<DataArray {header} format="appended" offset="{self._size}"'
        self.pieces.append(data)
        self._size += len(data)
        if array is None or not array.unit:
            return f"{opening}/>\n"
        unit = escape(" ".join(array.unit.split()))
        key = f'<InformationKey name="{UNITS}" location="vtkDataArray">{unit}</InformationKey>'
        return f"{opening}>{key}</DataArray>\n"
