"""Files that the library VTK reads: Exodus II, OpenFOAM, CGNS and Fluent.

Its readers run in a separate process, which damaged files may end. The process stores points,
cells and arrays of all steps in a temporary file, equal ones once; frames are read from it on
demand.
"""

import json
import math
import os
import re
import signal
import subprocess
import sys
import weakref
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from hashlib import blake2b
from importlib import import_module
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.frames.field_tracks import Field
from meshreel.formats.frames.steps import (
    DataArray,
    Piece,
    Step,
    StepFrames,
    join_pieces,
    loaded_array,
)
from meshreel.formats.frames.stored_frames import RawArray, identity
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import Reading
from meshreel.formats.scenes.scene_mesh import SceneMesh
from meshreel.formats.scenes.timing import ascending_times
from meshreel.formats.surfaces.cells import VTK_POLYHEDRON, Cells, CellSurface, cell_mesh
from meshreel.model.surface import Domain
from meshreel.runtime.extras import VTK

EXODUS, OPENFOAM, CGNS, FLUENT = "Exodus II", "OpenFOAM", "CGNS", "Fluent"
READERS = {
    EXODUS: ("vtkIOExodus", "vtkExodusIIReader", (".e", ".ex2", ".exo", ".g")),
    OPENFOAM: ("vtkIOGeometry", "vtkOpenFOAMReader", (".foam",)),
    CGNS: ("vtkIOCGNSReader", "vtkCGNSReader", (".cgns",)),
    FLUENT: ("vtkIOGeometry", "vtkFLUENTReader", (".cas",)),
}
"""Module, class and file extensions of the reader of each format."""

SETTINGS = ("EnableAllBases", "EnableAllPointArrays", "EnableAllCellArrays", "CreateCellToPointOff")
"""Methods that are called on the readers that have them."""

UNREAD = ("NODE_SET", "SIDE_SET", "ELEM_SET", "EDGE_SET", "FACE_SET", "EDGE_BLOCK", "FACE_BLOCK")
"""Objects of Exodus II that are not read."""

USER_NUMBERS = {"node_num_map", "elem_num_map", "elem_map"}
"""Variables of Exodus II with user numbers."""

OPENFOAM_MESH = {"points", "faces", "owner", "neighbour", "boundary"}
"""Files of a mesh that moves."""

CGNS_NODES = {
    "CGNSLibraryVersion_t", "CGNSBase_t", "Zone_t", "ZoneType_t", "ZoneBC_t", "GridCoordinates_t",
    "Elements_t", "FlowSolution_t", "DataArray_t", "GridLocation_t", "IndexRange_t", "IndexArray_t",
    "Rind_t", "BaseIterativeData_t", "ZoneIterativeData_t", "ZoneGridConnectivity_t",
    '"int[IndexDimension]"',
}  # fmt: skip
"""Labels of the nodes of CGNS that are read, or hold others."""

CELL_ZONES = ("fluid", "solid")
"""Types of zones of Fluent that have cells."""

BLOCK_NAMES = Domain.FACE, "block name"
"""Key of the names of blocks or zones, which become groups of faces and cells."""

INVENTED = ("ElementBlockIds", "Base/Zone", "ispatch", "issurface")
"""Field data that VTK adds."""

NO_NAME = "(no name)"
UNNAMED = re.compile(rf"Unnamed block ID: \d+|internalMesh|{re.escape(NO_NAME)}")
"""Names of blocks that VTK or `_text` invents."""

WEDGE, MIRRORED = 13, (0, 2, 1, 3, 5, 4)  # type, and nodes of the mirror image

STORE = "from meshreel.formats.vtk.library_readers import store; import sys; store(*sys.argv[1:])"
MIN_MEMORY, MEMORY_RATIO = 1 << 32, 64
MIN_SECONDS, BYTES_PER_SECOND = 60, 1 << 20
"""Limits of memory and processor time: a constant, and a share of the files in the folder."""

CONTENTS, ARRAYS, MAX_LOG_BYTES = "contents.json", "arrays", 1 << 16
ERRORS = re.compile(r"(?:ERR\| (?:\w+ \(0x\w+\): )?|^[\w.]*Error: )([^\x1b\n]*)", re.MULTILINE)
"""Errors of VTK and of Python in the log of the process."""


def read_with_library(title: str, path: Path, reading: Reading) -> Sequence[SceneMesh]:
    """Return the mesh of a file of a format, whose blocks are joined.

    Raises
    ------
    FormatError
        If VTK is not installed or fails, or the file has no mesh.
    """
    VTK.load()
    steps = _StoredSteps()
    command = [sys.executable, "-P", "-c", STORE, title, str(path.resolve()), str(steps.folder)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with (steps.folder / "log").open("w+b") as log:
        code = subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment, check=False
        ).returncode
        log.seek(0)
        errors = ERRORS.findall(log.read(MAX_LOG_BYTES).decode("utf-8", "replace"))
    if code or errors:
        end = signal.Signals(-code).name if code < 0 else code
        reason = errors[0].strip()[:200] if errors else f"its process ended with {end}"
        text = f"is not {title}, or is damaged: {READERS[title][1]} of VTK failed ({reason})"
        raise FormatError(text)
    contents = json.loads((steps.folder / CONTENTS).read_text("utf-8"))
    reading.notes.left_out_items(contents["left_out"])
    steps.rows = contents["steps"]
    for number, (start_byte, shape, code) in enumerate(contents["arrays"]):
        stored = RawArray(steps.folder / ARRAYS, start_byte, tuple(shape), np.dtype(code))
        field = Field(stored.dtype, math.prod(shape[1:]))
        read = partial(stored.read, 0, shape[0])
        steps.arrays.append((read, partial(identity, number), partial(identity, field)))
    times_s = ascending_times(np.array(contents["times"]), "step", reading)
    frames = StepFrames(steps.step, reading.notes)
    return [SceneMesh(path.stem, times_s, frames.frame, frames.surface, tracks=frames.tracks)]


class _StoredSteps:
    """The steps in a temporary folder, which exists as long as this object."""

    def __init__(self) -> None:
        self.folder = Path(mkdtemp(prefix="meshreel-vtk-"))
        weakref.finalize(self, rmtree, self.folder, ignore_errors=True)
        self.arrays: list[tuple[Callable[..., Any], ...]] = []
        """What reads, identifies and describes each array, as of `DataArray`."""
        self.rows: Sequence[Any] = ()
        """Numbers of points and cells of each step, and numbers of its arrays: of its cells, points
        and data."""
        self._last: tuple[object, CellSurface] | None = None
        self._steps: dict[int, Step] = {}  # those with the last surface

    def step(self, index: int) -> Step:
        """Return a step, whose values are read on demand."""
        if index in self._steps:
            return self._steps[index]
        n_points, n_cells, cells, points, data = self.rows[index]
        if self._last is None or self._last[0] != (n_points, cells):
            surface = cell_mesh(Cells(*(self.arrays[number][0]() for number in cells)), n_points)
            self._last, self._steps = ((n_points, cells), surface), {}
        arrays = [DataArray(Domain(key), name, *self.arrays[number]) for number, key, name in data]
        step = Step(n_points, n_cells, self._last[1], self.arrays[points][0], arrays)
        self._steps[index] = step
        return step


def store(title: str, path: str, folder: str) -> None:
    """Store the steps of a file in a folder; called in a separate process."""
    _limit(Path(path).parent.glob("**/*" if title == OPENFOAM else "*"))
    pipeline: Any = import_module("vtkmodules.vtkCommonExecutionModel")
    module, name, _ = READERS[title]
    reader: Any = getattr(import_module(f"vtkmodules.{module}"), name)()
    reader.SetFileName(path)
    reader.UpdateInformation()
    left_out = [*_configure(reader)]
    if unread := UNREAD_CONTENTS.get(title):
        with suppress(ImportError, TypeError):  # without h5py, or 64-bit netCDF-3
            left_out += unread(reader)
    key = pipeline.vtkStreamingDemandDrivenPipeline.TIME_STEPS()
    times = reader.GetOutputInformation(0).Get(key)
    steps: list[Any] = []
    with Path(folder, ARRAYS).open("wb") as file:
        arrays = _ArrayFile(file)
        for time in times or [None]:
            reader.Update() if time is None else reader.UpdateTimeStep(time)
            pieces = [*_pieces(reader.GetOutputDataObject(0), left_out)]
            if not pieces:
                raise FormatError("it has no mesh")
            mesh, others = join_pieces(pieces, same_points=title == EXODUS)
            left_out += others
            cells = _with_positive_wedges(mesh) if title in (OPENFOAM, FLUENT) else mesh.cells
            values = {array.key: array.read() for array in mesh.arrays}
            if not (values[BLOCK_NAMES] != "").any():
                del values[BLOCK_NAMES]
            mesh_arrays = [*map(arrays.add, vars(cells).values())], arrays.add(mesh.points)
            data = [(arrays.add(array), *key) for key, array in values.items()]
            steps.append((len(mesh.points), len(cells.types), *mesh_arrays, data))
    contents: Any = {"times": times or [0.0], "arrays": arrays.descriptions, "steps": steps}
    contents["left_out"] = [*dict.fromkeys(left_out)]
    Path(folder, CONTENTS).write_text(json.dumps(contents), "utf-8")


class _ArrayFile:
    """Stores arrays in a file, equal ones once."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._numbers: dict[tuple[Any, ...], int] = {}
        self.descriptions: list[tuple[int, tuple[int, ...], str]] = []
        """First byte, shape and number type of each stored array."""

    def add(self, values: npt.NDArray[Any]) -> int:
        """Store an array, unless an equal one is stored, and return its number."""
        data = values.tobytes()
        key = values.shape, values.dtype.str, blake2b(data).digest()
        if key not in self._numbers:
            self._numbers[key] = len(self.descriptions)
            self.descriptions.append((self._file.tell(), *key[:2]))
            self._file.write(data)
        return self._numbers[key]


def _with_positive_wedges(mesh: Piece) -> Cells:
    """Return the cells; VTK 9.7 mirrors wedges that it builds from their faces."""
    starts = np.cumsum(mesh.cells.counts) - mesh.cells.counts
    rows = starts[mesh.cells.types == WEDGE][:, None] + np.arange(6)
    nodes = mesh.cells.points.copy()
    a, b, c, *others = np.moveaxis(np.asarray(mesh.points, float)[nodes[rows]], 1, 0)
    heights = np.einsum("ij,ij->i", np.cross(b - a, c - a), sum(others) - (a + b + c))
    rows = rows[heights < 0]
    nodes[rows] = nodes[rows][:, MIRRORED]
    return replace(mesh.cells, points=nodes)


def _limit(files: Iterable[Path]) -> None:
    """Limit memory and time of this process, unless on Windows: damaged files declare any sizes."""
    with suppress(ImportError, OSError, ValueError):
        resource: Any = import_module("resource")
        size = sum(file.lstat().st_size for file in files)
        resource.setrlimit(resource.RLIMIT_AS, (MIN_MEMORY + MEMORY_RATIO * size,) * 2)
        resource.setrlimit(resource.RLIMIT_CPU, (MIN_SECONDS + size // BYTES_PER_SECOND,) * 2)


def _configure(reader: Any) -> Iterator[tuple[str, str]]:
    """Select all arrays of meshes; yield subject and name of all else, for notes."""
    for setting in SETTINGS:
        getattr(reader, setting, lambda: None)()
    for index in range(getattr(reader, "GetNumberOfPatchArrays", lambda: 0)()):
        if not reader.GetPatchArrayStatus(name := reader.GetPatchArrayName(index)):
            yield "patches", _text(name)
    if hasattr(reader, "GetZoneSectionSelection"):  # Fluent
        zones = reader.GetZoneSectionSelection()
        for name in [zones.GetArrayName(index) for index in range(zones.GetNumberOfArrays())]:
            if _text(name).rpartition(":")[2] not in CELL_ZONES:
                zones.DisableArray(name)
                yield "zones of faces", _text(name)
    if hasattr(reader, "SetSqueezePoints"):  # Exodus II
        reader.SetSqueezePoints(False)  # or coordinates become float32
        reader.SetApplyDisplacements(False)
        for kind in (reader.NODAL, reader.ELEM_BLOCK, reader.GLOBAL):
            reader.SetAllArrayStatus(kind, 1)
        for unread in UNREAD:
            kind, subject = getattr(reader, unread), f"{unread.lower().replace('_', ' ')}s"
            for index in range(reader.GetNumberOfObjects(kind)):
                yield subject, _text(reader.GetObjectName(kind, index))
            for index in range(reader.GetNumberOfObjectArrays(kind)):
                yield f"results of {subject}", _text(reader.GetObjectArrayName(kind, index))
        for block in range(reader.GetNumberOfObjects(kind := reader.ELEM_BLOCK)):
            for index in range(reader.GetNumberOfObjectAttributes(kind, block)):
                yield "attributes", _text(reader.GetObjectAttributeName(kind, block, index))


def _user_numbers(reader: Any) -> Iterator[tuple[str, str]]:
    """Yield subject and name of user numbers in Exodus II, unless they count from 1."""
    path = reader.GetFileName()
    with Path(path).open("rb") as start:
        is_classic = start.read(3) == b"CDF"
    # VTK crashes when it reads the numbers of nodes that no element has.
    library: Any = import_module("scipy.io" if is_classic else "h5py")
    with library.netcdf_file(path) if is_classic else library.File(path) as file:
        variables = (file.variables if is_classic else file).items()
        maps = {name: np.array(values[:]) for name, values in variables if name in USER_NUMBERS}
        del variables  # or the file cannot be closed
    for name, numbers in maps.items():
        if (numbers != np.arange(1, len(numbers) + 1)).any():
            yield "user numbers", name


def _other_nodes(reader: Any) -> Iterator[tuple[str, str]]:
    """Yield label and name of the nodes of CGNS that VTK does not read, such as boundaries."""
    nodes: dict[tuple[str, str], None] = {}
    solutions, pointers = dict[str, None](), set[str]()

    def visit(path: str, node: Any) -> None:
        label = bytes(node.attrs.get("label", b"")).partition(b"\0")[0].decode("latin-1")
        name = path.rpartition("/")[2]
        if name == "FlowSolutionPointers":
            pointers.update(node[" data"][()].tobytes().decode("latin-1").split())
        elif label == "FlowSolution_t":
            solutions[name] = None
        elif label and label not in CGNS_NODES:
            nodes[f"nodes {label}", name] = None

    try:
        with import_module("h5py").File(reader.GetFileName()) as file:
            file.visititems(visit)
        others = (name for name in solutions if pointers and name not in pointers)
        nodes |= {("solutions that no step refers to", name): None for name in others}
    except OSError:  # the older encoding ADF
        nodes["nodes", "all but coordinates, elements and solutions"] = None
    yield from nodes


def _other_files(reader: Any) -> Iterator[tuple[str, str]]:
    """Yield the files of a case of OpenFOAM that VTK does not read, such as fluxes and zones."""
    folder = Path(reader.GetFileName()).parent
    kinds = ("Cell", "Point", "Lagrangian")
    names = {
        getattr(reader, f"Get{kind}ArrayName")(index)
        for kind in kinds
        for index in range(getattr(reader, f"GetNumberOf{kind}Arrays")())
    }
    for pattern in ("[0-9]*/**/*", "constant/**/*Zones", "constant/**/sets/*"):
        for file in sorted(folder.glob(pattern)):
            if file.is_file() and file.name.removesuffix(".gz") not in names | OPENFOAM_MESH:
                yield "files", str(file.relative_to(folder))
    yield "units", "dimensions of fields"


UNREAD_CONTENTS = {EXODUS: _user_numbers, OPENFOAM: _other_files, CGNS: _other_nodes}
"""Functions that list what the readers of VTK do not tell."""


def _pieces(output: Any, left_out: list[tuple[str, str]]) -> Iterator[Piece]:
    """Yield the blocks of a step; append the contents that are left out to the list."""
    filters: Any = import_module("vtkmodules.vtkFiltersCore")
    blocks = output.NewIterator()
    blocks.InitTraversal()
    while not blocks.IsDoneWithTraversal():
        block = blocks.GetCurrentDataObject()
        block_name = _text(blocks.GetCurrentMetaData().Get(output.NAME()))
        blocks.GoToNextItem()
        if not block.GetNumberOfPoints():
            continue
        converter = filters.vtkAppendFilter()  # to an unstructured grid
        converter.AddInputData(block)
        converter.Update()
        grid = converter.GetOutput()
        block_name = "" if UNNAMED.fullmatch(block_name) else block_name
        names = np.full(grid.GetNumberOfCells(), block_name)
        arrays = [loaded_array(*BLOCK_NAMES, names)]
        for domain, data in (
            (Domain.VERTEX, grid.GetPointData()),
            (Domain.FACE, grid.GetCellData()),
            (None, grid.GetFieldData()),
        ):
            for index in range(data.GetNumberOfArrays()):
                array, name = data.GetAbstractArray(index), _text(data.GetArrayName(index))
                if domain and array.IsNumeric():
                    arrays.append(loaded_array(domain, name, _values(array)))
                elif name not in INVENTED:
                    left_out.append(("field data" if domain is None else "arrays of text", name))
        yield Piece(_values(grid.GetPoints().GetData()), _cells(grid), tuple(arrays))


def _text(name: str | bytes | None) -> str:
    """Return a name, which may be bytes if it is damaged."""
    return name.decode("latin-1") if isinstance(name, bytes) else name or NO_NAME


def _cells(grid: Any) -> Cells:
    cells = Cells(_values(grid.GetCellTypes()), *_lists(grid.GetCells()))
    if not (cells.types == VTK_POLYHEDRON).any():
        return cells
    n_faces, faces = _lists(grid.GetPolyhedronFaceLocations())
    return cells.with_faces(n_faces, faces, *_lists(grid.GetPolyhedronFaces()))


def _lists(lists: Any) -> Iterator[npt.NDArray[np.int64]]:
    """Yield the length of each list of a vtkCellArray, and the numbers of all."""
    yield np.diff(_values(lists.GetOffsetsArray())).astype(np.int64)
    yield _values(lists.GetConnectivityArray()).astype(np.int64)


def _values(array: Any) -> npt.NDArray[Any]:
    support: Any = import_module("vtkmodules.util.numpy_support")
    return np.array(support.vtk_to_numpy(array))  # VTK may reuse its memory


FORMATS = tuple(
    SequenceFormat(extension, title, read_meshes=partial(read_with_library, title), extra=VTK)
    for title, (_, _, extensions) in READERS.items()
    for extension in extensions
)
