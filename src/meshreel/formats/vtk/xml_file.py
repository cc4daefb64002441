"""Reader for VTK XML files with polygons (``.vtp``) or cells (``.vtu``) at one time.

Supports every encoding and compression that VTK writes, and any number of pieces. VTK's own reader
is not used: it allocates whatever size a file declares, so a damaged file can abort the process.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS, TEXTURE_COORDINATES
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.steps import (
    DataArray,
    LeftOut,
    Piece,
    Step,
    join_pieces,
    loaded_array,
)
from meshreel.formats.kinds import VERTEX_FACE, VERTEX_FACE_CELL, FrameFormat
from meshreel.formats.surfaces.cells import (
    POLY_LINE,
    POLY_VERTEX,
    POLYGON,
    POLYHEDRON,
    STRIP,
    VTK_POLYHEDRON,
    Cells,
)
from meshreel.formats.vtk.xml_arrays import (
    ATTRIBUTE_KIND,
    COMPONENTS,
    NUMBERS,
    TEXT,
    TIMES,
    TRACK_KIND,
    UNITS,
    UNPACKERS,
    ArrayCoding,
    parse_xml,
    unread,
)
from meshreel.formats.vtk.xml_writing import vtp_encoder, vtu_encoder
from meshreel.model.surface import Domain

APPENDED = re.compile(rb"<AppendedData([^>]*)>\s*_")
DATA = {"PointData": Domain.VERTEX, "CellData": Domain.FACE}
LEAVES = "InformationKey", "DataArray", "Array"
"""Elements with values; others contain elements."""
UNITS_KEY = f"InformationKey[@name='{UNITS}']"
GROUPS = {"Verts": POLY_VERTEX, "Lines": POLY_LINE, "Polys": POLYGON, "Strips": STRIP}


def read_vtk_xml(data: bytes, read_piece: Callable[[str], bytes] | None = None) -> Step:
    """Parse a ``.vtu`` or ``.vtp`` file, joining its pieces; or a ``.pvtu`` or ``.pvtp`` file.

    Parameters
    ----------
    read_piece : function of a reference, optional
        Returns the contents of a file that a parallel file refers to. Default: those are errors.

    Raises
    ------
    FormatError
        If the data is not such a file, or is damaged.
    """
    pieces, left_out, time_s = _read_pieces(data, read_piece)
    piece, others = join_pieces(pieces)
    return piece.step([*left_out, *others], time_s)


def _read_pieces(
    data: bytes, read_piece: Callable[[str], bytes] | None
) -> tuple[list[Piece], LeftOut, float | None]:
    """Return the pieces of a file, the contents that are left out, and the time if it has one."""
    appended, is_raw = b"", False
    if data.startswith(b"# vtk"):
        raise FormatError("is a legacy file of VTK; give it the extension .vtk")
    if match := APPENDED.search(data):
        end = data.rfind(b"</AppendedData")
        appended = data[match.end() : end if end > 0 else len(data)]
        is_raw = b"raw" in match[1]
        data = data[: match.start()] + b"</VTKFile>"
    root = parse_xml(data)
    kind = root.get("type", "")
    is_parallel = read_piece is not None and kind in ("PUnstructuredGrid", "PPolyData")
    if root.tag != "VTKFile" or not (is_parallel or kind in ("UnstructuredGrid", "PolyData")):
        raise FormatError(
            f"is {root.tag} of type {kind!r}; expected a VTKFile of type UnstructuredGrid or "
            "PolyData"
        )
    compressor = root.get("compressor", "")
    if compressor and compressor not in UNPACKERS:
        raise FormatError(f"is compressed by {compressor}; {', '.join(UNPACKERS)} are supported")
    order = ">" if root.get("byte_order") == "BigEndian" else "<"
    header = "u8" if root.get("header_type") == "UInt64" else "u4"
    coding = ArrayCoding(order, header, UNPACKERS.get(compressor), appended, is_raw)
    elements = root.findall(f"{kind}/Piece")
    if not elements:
        raise FormatError("has no Piece")
    containers = {element for element in root.iter() if len(element) and element.tag not in LEAVES}
    pieces: list[Piece] = []
    left_out: list[tuple[str, str]] = []
    for element in elements:
        if is_parallel and read_piece is not None:
            others, names, _ = _read_pieces(read_piece(element.get("Source", "")), None)
            pieces += others
            left_out += names
        else:
            pieces.append(_piece(element, coding, is_grid=kind == "UnstructuredGrid"))
    time_s = None
    for element in root.iterfind(f"{kind}/FieldData/DataArray"):
        if element.get("Name") in TIMES and element.get("NumberOfTuples", "1") == "1":
            time_s = float(coding.read(element, 1).flat[0])
    for element in root.iter(LEAVES[1]):
        components = [text for key, text in element.items() if key.startswith("ComponentName")]
        if components:
            left_out.append((COMPONENTS, f"{element.get('Name')} ({', '.join(components)})"))
    parents = (element for element in root.iter() if element.tag != LEAVES[0])
    return pieces, [*left_out, *unread(parents, coding.taken | containers)], time_s


def _piece(piece: Element, coding: ArrayCoding, *, is_grid: bool) -> Piece:
    element = piece.find("Points/DataArray")
    n_points = _count(piece, "Points", is_stored=element is not None)
    points = np.empty((0, 3), np.float32) if element is None else coding.read(element, n_points)
    if points.size == 0:
        points = points.reshape(0, 3)
    if points.ndim != 2 or points.shape[1] != 3:
        raise FormatError(f"points must have shape (N, 3); got {points.shape}")
    if points.dtype not in (np.float32, np.float64):
        points = points.astype(np.float64)
    coding = replace(coding, max_corners=8 * len(points) + 16)  # numbers of a convex polyhedron
    cells = _grid_cells(piece, coding) if is_grid else _poly_cells(piece, coding)
    counts = {Domain.VERTEX: len(points), Domain.FACE: len(cells.types)}
    return Piece(points, cells, tuple(_arrays(piece, coding, counts)))


def _grid_cells(piece: Element, coding: ArrayCoding) -> Cells:
    group = piece.find("Cells")
    if group is None:
        _count(piece, "Cells", is_stored=False)
        return Cells.join([])
    counts, points = _connectivity(group, coding, _count(piece, "Cells"))
    types = _read_named(group, "types", coding, len(counts))
    cells = Cells(types, counts, points)
    return _with_polyhedra(cells, group, coding) if (types == VTK_POLYHEDRON).any() else cells


def _with_polyhedra(cells: Cells, group: Element, coding: ArrayCoding) -> Cells:
    """Return cells with their polyhedra, whose faces have arrays of their own."""
    if group.find("DataArray[@Name='faceoffsets']") is None:  # VTK 9.4 and later
        names = "polyhedron_to_faces", "polyhedron_offsets"
        n_faces, faces = _connectivity(group, coding, len(cells.types), *names)
        names = "face_connectivity", "face_offsets"
        sizes, nodes = _connectivity(group, coding, len(np.unique(faces)), *names)
        return cells.with_faces(n_faces, faces, sizes, nodes)
    ends = _read_named(group, "faceoffsets", coding, len(cells.types)).astype(np.int64)
    ends = ends[cells.types == VTK_POLYHEDRON]  # others are -1
    counts = np.diff(ends, prepend=0)
    if ((counts < 1) | (counts > coding.max_corners)).any():
        raise FormatError(f"faceoffsets must ascend, in steps of at most {coding.max_corners}")
    points = _read_named(group, "faces", coding, int(ends[-1])).astype(np.int64)
    return cells.with_polyhedra(Cells(np.full(len(ends), POLYHEDRON), counts, points))


def _poly_cells(piece: Element, coding: ArrayCoding) -> Cells:
    groups = []
    for name, kind in GROUPS.items():
        group = piece.find(name)
        if group is None or not len(group):
            _count(piece, name, is_stored=False)
        else:
            counts, points = _connectivity(group, coding, _count(piece, name))
            groups.append(Cells(np.full(len(counts), kind), counts, points))
    return Cells.join(groups)


def _count(piece: Element, name: str, *, is_stored: bool = True) -> int | None:
    """Return the declared number of points or cells of a kind; None if it is not declared."""
    if (count := piece.get(f"NumberOf{name}")) is None:
        return None
    if not (count.strip().isdecimal() and len(count) < 20 and (is_stored or int(count) == 0)):
        expected = "a number" if is_stored else "0, as it has none"
        raise FormatError(f"declares NumberOf{name}={count[:20]!r}; expected {expected}")
    return int(count)


def _connectivity(
    group: Element,
    coding: ArrayCoding,
    n_cells: int | None,
    name: str = "connectivity",
    offsets: str = "offsets",
) -> tuple[Integers, Integers]:
    """Return the point count of each cell, and all point indices; or those of other arrays."""
    ends = _read_named(group, offsets, coding, n_cells).astype(np.int64)
    counts = np.diff(ends, prepend=0)
    if ((counts < 0) | (counts > coding.max_corners)).any():
        raise FormatError(
            f"{offsets} of {group.tag} must ascend from 0, in steps of at most {coding.max_corners}"
        )
    n_corners = int(ends[-1]) if len(ends) else 0
    return counts, _read_named(group, name, coding, n_corners).astype(np.int64)


def _read_named(
    group: Element, name: str, coding: ArrayCoding, count: int | None
) -> npt.NDArray[Any]:
    for element in group.findall("DataArray"):
        if element.get("Name") == name:
            values = coding.read(element, count)
            if values.dtype.kind in "iu" and values.ndim == 1:
                return values
            raise FormatError(f"{name} must be integers; got {values.dtype}")
    raise FormatError(f"{group.tag} has no array {name!r}")


def _arrays(
    piece: Element, coding: ArrayCoding, counts: Mapping[Domain, int]
) -> Iterator[DataArray]:
    for tag, domain in DATA.items():
        group = piece.find(tag)
        if group is None:
            continue
        roles = {group.get(role, ""): role for role in (TEXTURE_COORDINATES, NORMALS)}
        for element in group:
            if element.get("type") in (*NUMBERS, TEXT):
                name, units = element.get("Name", ""), element.find(UNITS_KEY)
                coding.taken.update([] if units is None else [units])
                unit = "" if units is None else " ".join((units.text or "").split())
                yield loaded_array(
                    domain,
                    name,
                    coding.read(element, counts[domain], allows_text=True),
                    roles.get(name, ""),
                    element.get(TRACK_KIND, element.get(ATTRIBUTE_KIND, "")),
                    unit,
                    is_track=TRACK_KIND in element.attrib,
                )


def read_frame(data: bytes) -> Frame:
    """Read a frame; raises as `read_vtk_xml`, or if two arrays share a name."""
    return read_vtk_xml(data).frame()


FORMATS = (
    FrameFormat(".vtu", "VTK cells", read_frame, vtu_encoder, track_domains=VERTEX_FACE_CELL),
    FrameFormat(".vtp", "VTK polygons", read_frame, vtp_encoder, track_domains=VERTEX_FACE),
)
