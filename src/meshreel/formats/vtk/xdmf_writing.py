"""Writer for XDMF: a temporal collection of grids in XML, with numbers in an HDF5 file."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.hdf import HdfOutput, Node, hdf_output
from meshreel.formats.notes import listed, written_times
from meshreel.formats.options import WriteOptions
from meshreel.formats.surfaces.cells import POLYGON, Cells, written_cells
from meshreel.formats.vtk.output_arrays import OutputArray, output_arrays, xml_text
from meshreel.formats.vtk.xdmf_grid import UNIT, VTK_CELLS
from meshreel.formats.vtk.xml_arrays import ATTRIBUTE_KIND, TRACK_KIND
from meshreel.model.geometry.polygons import ragged_indices
from meshreel.model.surface import Domain

NUMBER_TYPES = {"f": "Float", "i": "Int", "u": "UInt"}
BYTE_TYPES = {"i": "Char", "u": "UChar"}
SHAPES = {1: "Scalar", 3: "Vector", 9: "Tensor"}
"""AttributeType by number of components; other counts are a Matrix."""

SIZED = (1, 3, POLYGON)
"""VTK types of cells whose XDMF types are stored with their size."""


def xdmf_data_files(path: Path, n_frames: int) -> list[Path]:
    """Return the path of the HDF5 file that stores the numbers of an XDMF file."""
    return [path.with_name(f"{path.name}.h5")]


def write_xdmf(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write the XML file and its HDF5 file, which has a dataset for each array of each frame."""
    times = written_times(stream.timing, stream.n_frames, stream.notes).tolist()
    [(name, data_path)] = stream.data_files
    grids: list[str] = []
    with hdf_output(data_path) as output:
        for number, segment in enumerate(stream.segments()):
            root = output.root
            above = ""
            if stream.n_segments > 1:
                above = f"segments/{number}/"
                root = root.create_group(above)
            numbers = _HdfItems(root, f"{name}:/{above}")
            for index, grid in enumerate(_grids(numbers, segment, output)):
                frame = stream.starts[number] + index
                grids.append(
                    f'<Grid Name="frame {frame}" GridType="Uniform">\n'
                    f'<Time Value="{times[frame]!r}"/>\n{grid}</Grid>\n'
                )
    title = quoteattr(xml_text(stream.name) or path.stem)
    text = [
        '<?xml version="1.0"?>\n<Xdmf Version="3.0">\n<Domain>\n',
        f'<Grid Name={title} GridType="Collection" CollectionType="Temporal">\n',
        *grids,
        "</Grid>\n</Domain>\n</Xdmf>\n",
    ]
    path.write_text("".join(text), encoding="utf-8")


def _grids(numbers: "_HdfItems", segment: FrameStream, output: HdfOutput) -> Iterator[str]:
    """Yield the contents of the grid of each frame of a segment."""
    arrays = output_arrays(segment.surface, segment.tracks, ".xdmf", segment.notes)
    topology = _topology(numbers, segment)
    static = {
        number: numbers.item(f"data/{number}", _flat(array.values))
        for number, array in enumerate(arrays)
        if array.values is not None
    }
    for index, frame in output.frames(segment):
        points = numbers.item(f"points/{index}", frame)
        values = segment.values(index)
        items = static | {
            number: numbers.item(f"data/{number}/{index}", _flat(values[array.track]))
            for number, array in enumerate(arrays)
            if array.track
        }
        data = "".join(_attribute(array, items[number]) for number, array in enumerate(arrays))
        yield f'{topology}<Geometry GeometryType="XYZ">\n{points}</Geometry>\n{data}'


class _HdfItems:
    """Writes datasets to the HDF5 file, and returns the XML elements that refer to them."""

    def __init__(self, root: Node, place: str) -> None:
        self._root, self._place = root, place

    def item(self, place: str, values: npt.NDArray[Any]) -> str:
        """Write an array to a path in the file; return its DataItem element."""
        self._root[place] = values
        kind, width = values.dtype.kind, values.dtype.itemsize
        number = BYTE_TYPES.get(kind, "") if width == 1 else NUMBER_TYPES[kind]
        dimensions = " ".join(map(str, values.shape))
        facts = f'Dimensions="{dimensions}" NumberType="{number}" Precision="{width}"'
        text = f"{self._place}{place}".replace("&", "&amp;").replace("<", "&lt;")
        return f'<DataItem {facts} Format="HDF">{text}</DataItem>\n'


def _flat(values: Any) -> npt.NDArray[Any]:
    """Drop the second axis of values with one component."""
    found: npt.NDArray[Any] = values[:, 0] if values.shape[1] == 1 else values
    return found


def _attribute(one: OutputArray, item: str) -> str:
    center = "node" if one.domain is Domain.VERTEX else "cell"
    shape = SHAPES.get(one.n_columns, "Matrix")
    facts = f'Name={quoteattr(one.name)} AttributeType="{shape}" Center="{center.title()}"'
    facts += f' {TRACK_KIND if one.track else ATTRIBUTE_KIND}="{one.kind}"'
    facts += f" {UNIT}={quoteattr(one.unit)}" if one.unit else ""
    return f"<Attribute {facts}>\n{item}</Attribute>\n"


def _topology(numbers: _HdfItems, stream: FrameStream) -> str:
    """Return the Topology element of the faces or cells, which all frames share."""
    cells = written_cells(stream.faces, stream.surface)
    types, counts = cells.types, cells.counts
    if others := sorted({*types.tolist()} - VTK_CELLS.keys()):
        raise FormatError(
            f"XDMF has no cells of type {listed(map(str, others))} of VTK; write .vtu or .vtkhdf"
        )
    if (types == types[0]).all() and (counts == counts[0]).all():
        kind, extra = VTK_CELLS[int(types[0])][0], f' NodesPerElement="{counts[0]}"'
        values = cells.points.reshape(len(counts), -1)
    else:
        kind, extra, values = "Mixed", "", _mixed(cells)
    facts = f'TopologyType="{kind}" NumberOfElements="{len(counts)}"{extra}'
    return f"<Topology {facts}>\n{numbers.item('faces', values)}</Topology>\n"


def _mixed(cells: Cells) -> npt.NDArray[np.int64]:
    """Encode a mixed topology: each cell begins with its type, some also with their size."""
    counts = cells.counts
    has_size = np.isin(cells.types, SIZED)
    heads = np.where(has_size, 2, 1)
    starts = np.cumsum(heads + counts) - heads - counts
    found = np.empty(int((heads + counts).sum()), np.int64)
    found[starts] = [VTK_CELLS[kind][1] for kind in cells.types.tolist()]
    found[starts[has_size] + 1] = counts[has_size]
    found[ragged_indices(starts + heads, counts)] = cells.points
    return found
