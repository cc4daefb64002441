"""Frames to XDMF: a collection of grids in XML, whose numbers are in an HDF5 file beside."""

from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import numpy.typing as npt

from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.hdf.reading import Node
from meshreel.formats.hdf.writing import hdf_output
from meshreel.formats.options import WriteOptions
from meshreel.formats.vtk.written_arrays import (
    FRAME_RATE,
    WrittenArray,
    written_arrays,
    xml_text,
)
from meshreel.formats.vtk.xdmf_grid import ATTRIBUTE_KIND, CENTERS, TRACK_KIND, UNIT
from meshreel.model.geometry.fans import join_fans
from meshreel.model.geometry.ragged import ragged_indices

NUMBER_TYPES = {"f": "Float", "i": "Int", "u": "UInt"}
OF_A_BYTE = {"i": "Char", "u": "UChar"}
SHAPES = {1: "Scalar", 3: "Vector", 9: "Tensor"}
"""What XDMF calls data of so many numbers; of others it is a matrix."""

TYPES = {3: "Triangle", 4: "Quadrilateral"}
POLYGON, TRIANGLE, QUAD = 3, 4, 5
"""Numbers of the types of cells in a mixed topology."""


def xdmf_numbers(path: Path, n_frames: int) -> list[Path]:
    """The file with the numbers, beside that which describes them."""
    return [path.with_name(f"{path.name}.h5")]


def write_xdmf(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write the file and that of its numbers, a dataset for each array of each frame."""
    if not stream.fps:
        stream.notes.append(f"the frame rate is unknown; written as {FRAME_RATE:g} fps")
    arrays = written_arrays(stream.surface, stream.tracks, ".xdmf", stream.notes)
    [(name, beside)] = stream.beside
    grids = []
    with hdf_output(beside) as output:
        numbers = _Numbers(output.root, name)
        topology = _topology(numbers, stream)
        still = {
            number: numbers.item(f"data/{number}", _flat(one.values))
            for number, one in enumerate(arrays)
            if one.values is not None
        }
        for index, frame in output.frames(stream):
            points = numbers.item(f"points/{index}", frame)
            values = stream.values(index)
            items = still | {
                number: numbers.item(f"data/{number}/{index}", _flat(values[one.track]))
                for number, one in enumerate(arrays)
                if one.track
            }
            data = "".join(_attribute(one, items[number]) for number, one in enumerate(arrays))
            time = stream.start_s + index / (stream.fps or FRAME_RATE)
            grids.append(
                f'<Grid Name="frame {index}" GridType="Uniform">\n<Time Value="{time!r}"/>\n'
                f'{topology}<Geometry GeometryType="XYZ">\n{points}</Geometry>\n{data}</Grid>\n'
            )
    title = quoteattr(xml_text(stream.name) or path.stem)
    text = [
        '<?xml version="1.0"?>\n<Xdmf Version="3.0">\n<Domain>\n',
        f'<Grid Name={title} GridType="Collection" CollectionType="Temporal">\n',
        *grids,
        "</Grid>\n</Domain>\n</Xdmf>\n",
    ]
    path.write_text("".join(text), encoding="utf-8")


class _Numbers:
    """Datasets in a file, and how XDMF names them."""

    def __init__(self, root: Node, file: str) -> None:
        self._root, self._file = root, file

    def item(self, place: str, values: npt.NDArray[Any]) -> str:
        """The element of an array, which is written to a place in the file."""
        self._root[place] = values
        kind, width = values.dtype.kind, values.dtype.itemsize
        number = OF_A_BYTE.get(kind, "") if width == 1 else NUMBER_TYPES[kind]
        dimensions = " ".join(map(str, values.shape))
        facts = f'Dimensions="{dimensions}" NumberType="{number}" Precision="{width}"'
        text = f"{self._file}:/{place}".replace("&", "&amp;").replace("<", "&lt;")
        return f'<DataItem {facts} Format="HDF">{text}</DataItem>\n'


def _flat(values: Any) -> npt.NDArray[Any]:
    """Values of one number each as an array of one axis."""
    found: npt.NDArray[Any] = values[:, 0] if values.shape[1] == 1 else values
    return found


def _attribute(one: WrittenArray, item: str) -> str:
    center = next(center for center, domain in CENTERS.items() if domain is one.domain)
    shape = SHAPES.get(one.n_columns, "Matrix")
    facts = f'Name={quoteattr(one.name)} AttributeType="{shape}" Center="{center.title()}"'
    facts += f' {TRACK_KIND if one.track else ATTRIBUTE_KIND}="{one.kind}"'
    facts += f" {UNIT}={quoteattr(one.unit)}" if one.unit else ""
    return f"<Attribute {facts}>\n{item}</Attribute>\n"


def _topology(numbers: _Numbers, stream: FrameStream) -> str:
    """The element of the faces, which are the same in all frames."""
    counts = stream.surface.sizes(len(stream.faces)).astype(np.int64)
    corners = join_fans(counts, stream.faces).astype(np.int64)
    if (counts == counts[0]).all():
        width = int(counts[0])
        kind, extra = TYPES.get(width, "Polygon"), f' NodesPerElement="{width}"'
        values = corners.reshape(-1, width)
    else:
        kind, extra, values = "Mixed", "", _mixed(counts, corners)
    facts = f'TopologyType="{kind}" NumberOfElements="{len(counts)}"{extra}'
    return f"<Topology {facts}>\n{numbers.item('faces', values)}</Topology>\n"


def _mixed(counts: npt.NDArray[np.int64], corners: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
    """Cells that each begin with their type, and polygons then with their number of corners."""
    is_polygon = counts > 4
    heads = np.where(is_polygon, 2, 1)
    starts = np.cumsum(heads + counts) - heads - counts
    found = np.empty(int((heads + counts).sum()), np.int64)
    found[starts] = np.select([counts == 3, counts == 4], [TRIANGLE, QUAD], POLYGON)
    found[starts[is_polygon] + 1] = counts[is_polygon]
    found[ragged_indices(starts + heads, counts)] = corners
    return found
