"""Reader for VTK XML files with polygons (``.vtp``) or cells (``.vtu``) at one time.

Supports every encoding and compression that VTK writes, and any number of pieces. VTK's own reader
is not used: it allocates whatever size a file declares, so a damaged file can abort the process.
"""

import re
from collections.abc import Iterator
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Integers
from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.frames.frame import Frame
from meshreel.formats.frames.steps import (
    TEXTURE_COORDINATES,
    TIMES,
    DataArray,
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
    TRACK_KIND,
    UNITS,
    UNPACKERS,
    ArrayCoding,
    parse_xml,
)
from meshreel.formats.vtk.xml_writing import vtp_encoder, vtu_encoder
from meshreel.model.notes import listed
from meshreel.model.surface import Domain

APPENDED = re.compile(rb"<AppendedData([^>]*)>\s*_")
DATA = {"PointData": Domain.VERTEX, "CellData": Domain.FACE}
GROUPS = {"Verts": POLY_VERTEX, "Lines": POLY_LINE, "Polys": POLYGON, "Strips": STRIP}


def read_vtk_xml(data: bytes) -> Step:
    """Parse a ``.vtu`` or ``.vtp`` file, joining its pieces.

    Raises
    ------
    FormatError
        If the data is not such a file, or is damaged.
    """
    appended, is_raw = b"", False
    if match := APPENDED.search(data):
        end = data.rfind(b"</AppendedData")
        appended = data[match.end() : end if end > 0 else len(data)]
        is_raw = b"raw" in match[1]
        data = data[: match.start()] + b"</VTKFile>"
    root = parse_xml(data)
    kind = root.get("type", "")
    if root.tag != "VTKFile" or kind not in ("UnstructuredGrid", "PolyData"):
        raise FormatError(
            f"is {root.tag} of type {kind!r}; expected a VTKFile of type UnstructuredGrid or "
            "PolyData"
        )
    coding = _coding(root, appended, is_raw)
    elements = root.findall(f"{kind}/Piece")
    if not elements:
        raise FormatError("has no Piece")
    is_grid = kind == "UnstructuredGrid"
    piece, left_out = join_pieces(
        [_piece(element, coding, is_grid=is_grid) for element in elements]
    )
    return piece.step((*left_out, *_left_out(root.find(kind))))


def _left_out(grid: Element | None) -> Iterator[str]:
    """Describe field data and text arrays, which are left out."""
    elements = [] if grid is None else [*grid.iterfind("FieldData/*")]
    names = [element.get("Name", "") for element in elements]
    if field := [name for name in names if name not in TIMES]:
        yield f"field data: {listed(field)}"
    data = [] if grid is None else [*grid.iterfind("Piece/PointData/*"),
                                    *grid.iterfind("Piece/CellData/*")]  # fmt: skip
    if texts := list(dict.fromkeys(array.get("Name", "") for array in data if _is_text(array))):
        yield f"arrays of text: {listed(texts)}"


def _is_text(element: Element) -> bool:
    return element.tag == "Array" or element.get("type") == "String"


def _coding(root: Element, appended: bytes, is_raw: bool) -> ArrayCoding:
    compressor = root.get("compressor", "")
    if compressor and compressor not in UNPACKERS:
        raise FormatError(f"is compressed by {compressor}; {', '.join(UNPACKERS)} are supported")
    return ArrayCoding(
        ">" if root.get("byte_order") == "BigEndian" else "<",
        "u8" if root.get("header_type") == "UInt64" else "u4",
        UNPACKERS.get(compressor),
        appended,
        is_raw,
    )


def _piece(piece: Element, coding: ArrayCoding, *, is_grid: bool) -> Piece:
    element = piece.find("Points/DataArray")
    points = np.empty((0, 3), np.float32) if element is None else coding.read(element)
    if points.size == 0:
        points = points.reshape(0, 3)
    if points.ndim != 2 or points.shape[1] != 3:
        raise FormatError(f"points must have shape (N, 3); got {points.shape}")
    if points.dtype not in (np.float32, np.float64):
        points = points.astype(np.float64)
    _check_count(piece, "Points", len(points))
    cells = _grid_cells(piece, coding) if is_grid else _poly_cells(piece, coding)
    return Piece(points, cells, tuple(_arrays(piece, coding)))


def _grid_cells(piece: Element, coding: ArrayCoding) -> Cells:
    group = piece.find("Cells")
    if group is None:
        _check_count(piece, "Cells", 0)
        return Cells.join([])
    counts, points = _connectivity(group, coding)
    _check_count(piece, "Cells", len(counts))
    types = _read_named(group, "types", coding)
    if len(types) != len(counts):
        raise FormatError(f"has {len(types)} types for {len(counts)} cells")
    cells = Cells(types, counts, points)
    return _with_polyhedra(cells, group, coding) if (types == VTK_POLYHEDRON).any() else cells


def _with_polyhedra(cells: Cells, group: Element, coding: ArrayCoding) -> Cells:
    """Return cells with their polyhedra, whose faces have arrays of their own."""
    if group.find("DataArray[@Name='faceoffsets']") is None:  # VTK 9.4 and later
        n_faces, faces = _connectivity(group, coding, "polyhedron_to_faces", "polyhedron_offsets")
        sizes, nodes = _connectivity(group, coding, "face_connectivity", "face_offsets")
        return cells.with_faces(n_faces, faces, sizes, nodes)
    points = _read_named(group, "faces", coding).astype(np.int64)
    ends = _read_named(group, "faceoffsets", coding).astype(np.int64)
    if len(ends) != len(cells.types):
        raise FormatError(f"has {len(ends)} faceoffsets for {len(cells.types)} cells")
    ends = ends[cells.types == VTK_POLYHEDRON]  # others are -1
    counts = np.diff(ends, prepend=0)
    if (counts < 1).any() or ends[-1] != len(points):
        raise FormatError(f"faceoffsets do not fit {len(points)} numbers of faces")
    return cells.with_polyhedra(Cells(np.full(len(ends), POLYHEDRON), counts, points))


def _poly_cells(piece: Element, coding: ArrayCoding) -> Cells:
    groups = []
    for name, kind in GROUPS.items():
        group = piece.find(name)
        if group is None or not len(group):
            _check_count(piece, name, 0)
        else:
            counts, points = _connectivity(group, coding)
            _check_count(piece, name, len(counts))
            groups.append(Cells(np.full(len(counts), kind), counts, points))
    return Cells.join(groups)


def _check_count(piece: Element, name: str, n_found: int) -> None:
    """Raise an error if the declared number of points or cells differs from the arrays."""
    count = piece.get(f"NumberOf{name}", str(n_found)).strip()
    if (count.lstrip("0") or "0") != str(n_found):
        raise FormatError(
            f"declares NumberOf{name}={count[:20]!r}, but its arrays have {n_found}; the file "
            "is damaged or incomplete"
        )


def _connectivity(
    group: Element, coding: ArrayCoding, name: str = "connectivity", offsets: str = "offsets"
) -> tuple[Integers, Integers]:
    """Return the point count of each cell, and all point indices; or those of other arrays."""
    points = _read_named(group, name, coding).astype(np.int64)
    ends = _read_named(group, offsets, coding).astype(np.int64)
    counts = np.diff(ends, prepend=0)
    if len(ends) and ((counts < 0).any() or ends[-1] != len(points)):
        raise FormatError(f"{offsets} of {group.tag} do not fit its {len(points)} corners")
    return counts, points


def _read_named(group: Element, name: str, coding: ArrayCoding) -> npt.NDArray[Any]:
    for element in group.findall("DataArray"):
        if element.get("Name") == name:
            values = coding.read(element)
            if values.dtype.kind in "iu" and values.ndim == 1:
                return values
            raise FormatError(f"{name} must be integers; got {values.dtype}")
    raise FormatError(f"{group.tag} has no array {name!r}")


def _unit(element: Element) -> str:
    unit_key = element.find(f"InformationKey[@name='{UNITS}']")
    return "" if unit_key is None else " ".join((unit_key.text or "").split())


def _arrays(piece: Element, coding: ArrayCoding) -> Iterator[DataArray]:
    for tag, domain in DATA.items():
        group = piece.find(tag)
        if group is None:
            continue
        roles = {group.get(role, ""): role for role in (TEXTURE_COORDINATES, NORMALS)}
        for element in group.findall("DataArray"):
            name = element.get("Name", "")
            if not name.startswith("vtkGhost") and not _is_text(element):
                yield loaded_array(
                    domain,
                    name,
                    coding.read(element),
                    roles.get(name, ""),
                    element.get(TRACK_KIND, element.get(ATTRIBUTE_KIND, "")),
                    _unit(element),
                    is_track=TRACK_KIND in element.attrib,
                )


def read_frame(data: bytes) -> Frame:
    """Read a frame; raises as `read_vtk_xml`, or if two arrays share a name."""
    return read_vtk_xml(data).frame()


FORMATS = (
    FrameFormat(".vtu", "VTK cells", read_frame, vtu_encoder, track_domains=VERTEX_FACE_CELL),
    FrameFormat(".vtp", "VTK polygons", read_frame, vtp_encoder, track_domains=VERTEX_FACE),
)
