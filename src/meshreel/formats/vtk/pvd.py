"""Reader for ParaView collections (``.pvd``): a list of VTK files and their times."""

import math
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import errors_naming, os_errors_naming
from meshreel.formats.file_references import resolve_reference
from meshreel.formats.frames.field_tracks import (
    Field,
    Key,
    add_field,
    field_tracks,
)
from meshreel.formats.notes import note_left_out
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.merging import merge_meshes, merge_tracks
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.scenes.timing import Neighbours, file_order_times, note_file_order
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.vtk.data_arrays import DataArray
from meshreel.formats.vtk.legacy import read_vtk_legacy
from meshreel.formats.vtk.mesh import VtkMesh
from meshreel.formats.vtk.xml_file import read_vtk_xml
from meshreel.formats.vtk.xml_tree import parse_xml
from meshreel.model.surface import Domain, Surface
from meshreel.model.tracks import TrackSource
from meshreel.model.validation import validate_fps

Read = TypeVar("Read")

READERS = {".vtu": read_vtk_xml, ".vtp": read_vtk_xml, ".vtk": read_vtk_legacy}


def read_pvd(path: Path, options: ReadOptions) -> Sequence[SceneMesh]:
    """Return the meshes of a collection, one for each numbered part.

    Raises
    ------
    FormatError
        If the file is not a collection, or refers to unsupported files.
    """
    with os_errors_naming(path):
        root = parse_xml(path.read_bytes())
    if root.tag != "VTKFile" or root.get("type") != "Collection":
        raise FormatError(f"is {root.tag} of type {root.get('type', '')!r}; expected a Collection")
    parts: dict[tuple[str, str], list[tuple[float, Path]]] = {}
    for element in root.findall("Collection/DataSet"):
        part = element.get("group", ""), element.get("part", "0")
        parts.setdefault(part, []).append((_time(element), _file(path, element, options)))
    if not parts:
        raise FormatError("lists no files")
    return [
        read_or_defer_error(name, partial(_scene_mesh, name, files, options))
        for (group, part), files in parts.items()
        for name in [path.stem if len(parts) == 1 else f"/{group or 'part'}_{part}"]
    ]


def _time(element: Element) -> float:
    text = element.get("timestep", "0")
    try:
        time = float(text)
    except ValueError:
        time = math.nan
    if not math.isfinite(time):
        raise FormatError(f"has the timestep {text[:40]!r}; expected a finite number")
    return time


def _file(path: Path, element: Element, options: ReadOptions) -> Path:
    found = resolve_reference(path, element.get("file", ""), allow_outside=options.allow_outside)
    if found.suffix.lower() not in READERS:
        raise FormatError(f"refers to {found.name}; {', '.join(READERS)} files are supported")
    return found


def _scene_mesh(name: str, files: list[tuple[float, Path]], options: ReadOptions) -> SceneMesh:
    pieces: dict[float, list[Path]] = {}
    for time, file in sorted(files, key=lambda one: one[0]):
        pieces.setdefault(time, []).append(file)
    frames, times = list(pieces.values()), np.array(list(pieces))
    several = next((time for time, found in pieces.items() if len(found) > 1), None)
    if several is not None and not options.merge:
        fps = validate_fps(options.fps or 0.0)
        if not fps:
            raise InvalidInputError(
                f"lists {len(pieces[several])} files for the time {several:g} without part "
                "numbers; merge the files of each time into one mesh with --merge (merge=True), "
                "or read each file as a frame, in file order, with --fps (fps=)"
            )
        frames, times = [[file] for _, file in files], file_order_times(len(files), fps)
        note_file_order(fps, options.notes)
    read = _PieceFrames(name, times, frames, options.notes)
    return SceneMesh(name, times, read.frame, read.surface, tracks=read.tracks)


class _PieceFrames:
    """Frames that consist of one file or of several files merged into one mesh.

    Parameters
    ----------
    name : str
    times : float64 array of shape (T,)
    files : list of list of Path
        The files of each frame.
    notes : list of str
    """

    def __init__(self, name: str, times: Floats, files: list[list[Path]], notes: list[str]) -> None:
        self._name, self._times, self._notes = name, times, notes
        series: list[list[Path]] = [[] for _ in range(max(len(one) for one in files))]
        places = []
        for one in files:
            places.append([len(series[number]) for number in range(len(one))])
            for number, file in enumerate(one):
                series[number].append(file)
        self._places, self._pieces = places, [_FileFrames(one, notes) for one in series]

    def frame(self, index: int) -> PolygonMesh:
        return self._mesh(index).frame(0)

    def surface(self, index: int) -> Surface:
        """Return the static data of a frame; merged frames have a part for each file."""
        return self._mesh(index).surface(0)

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return the tracks of consecutive frames that share their faces."""
        counts = {len(self._places[index]) for index in frames}
        if len(counts) > 1:  # pieces cannot be matched between frames
            note_left_out(self._notes, "fields of frames that differ in their number of files")
            return {}
        places = [[Neighbours(place, place) for place in self._places[index]] for index in frames]
        if counts == {1}:
            first = places[0][0].before
            return self._pieces[0].tracks(range(first, first + len(frames)))
        pieces = [
            SceneMesh(f"/piece_{number}", self._times, piece.frame, tracks=piece.tracks)
            for number, piece in enumerate(self._pieces[: counts.pop()])
        ]
        return merge_tracks(pieces, places, self._notes)

    def _mesh(self, index: int) -> SceneMesh:
        time = self._times[index : index + 1]
        meshes = []
        for number, place in enumerate(self._places[index]):
            piece = self._pieces[number]
            frame, surface = partial(_at, piece.frame, place), partial(_at, piece.surface, place)
            meshes.append(SceneMesh(f"/piece_{number}", time, frame, surface))
        return merge_meshes(meshes, self._name, self._notes) if len(meshes) > 1 else meshes[0]


def _at(read: Callable[[int], Read], place: int, _: int) -> Read:
    return read(place)


class _FileFrames:
    """Frames stored in one file each; remembers which arrays changed between the frames read."""

    def __init__(self, files: list[Path], notes: list[str]) -> None:
        self._files, self._notes = files, notes
        self._checksums: dict[Key, int] = {}
        self._changing: set[Key] = set()
        self._attributes: set[Key] = set()
        self._fields: dict[int, dict[Key, Field]] = {}
        self._last: tuple[int, VtkMesh] | None = None

    def frame(self, index: int) -> PolygonMesh:
        """Return the surface of a frame, and compare its arrays with those of earlier frames."""
        mesh = self._read(index)
        fields: dict[Key, Field] = {}
        with errors_naming(self._files[index]):
            for domain, array in _arrays(mesh):
                values, key = array.values, (domain, array.name)
                add_field(fields, key, array.field)
                checksum = zlib.crc32(np.ascontiguousarray(values).data)
                if array.kind and not array.is_track:
                    self._attributes.add(key)
                if self._checksums.setdefault(key, checksum) != checksum:
                    self._changing.add(key)
            self._fields[index] = fields
            return mesh.polygons

    def surface(self, index: int) -> Surface:
        """Return the arrays of a frame that were the same in all frames read so far."""
        mesh, changing = self._read(index), self._changing_keys()
        static = {
            domain: tuple(
                one
                for side, one in _arrays(mesh)
                if side is domain and (side, one.name) not in changing
            )
            for domain in (Domain.VERTEX, Domain.FACE)
        }
        with errors_naming(self._files[index]):
            mesh = replace(mesh, point_data=static[Domain.VERTEX], cell_data=static[Domain.FACE])
            return mesh.surface(self._notes)

    def tracks(self, frames: range) -> Mapping[str, TrackSource]:
        """Return tracks for the arrays that changed or were missing in some frames read so far."""
        changing = self._changing_keys()
        fields = [
            {key: field for key, field in self._fields[index].items() if key in changing}
            for index in frames
        ]
        mesh = self._read(frames.start)
        sizes = {Domain.VERTEX: len(mesh.polygons.vertices), Domain.FACE: len(mesh.polygons.counts)}

        def read(index: int, key: Key) -> npt.NDArray[Any]:
            path, mesh = self._files[frames[index]], self._read(frames[index])
            [array] = [one for side, one in _arrays(mesh) if (side, one.name) == key]
            with errors_naming(path):
                return mesh.values_on_surface(array, key[0])

        return field_tracks(fields, sizes, read, self._notes)

    def _changing_keys(self) -> set[Key]:
        """Arrays that changed, are missing in some of the frames read, or are declared tracks."""
        everything = [pair for fields in self._fields.values() for pair in fields.items()]
        counts = Counter(key for key, _ in everything)
        declared = {key for key, field in everything if field.is_track}
        incomplete = {key for key in counts if counts[key] < len(self._fields)}
        # Attributes written by meshreel change only with the faces.
        return (self._changing | declared | incomplete) - self._attributes

    def _read(self, index: int) -> VtkMesh:
        if self._last is None or self._last[0] != index:
            path = self._files[index]
            with os_errors_naming(path):
                data = path.read_bytes()
            with errors_naming(path):
                self._last = index, READERS[path.suffix.lower()](data)
        return self._last[1]


def _arrays(mesh: VtkMesh) -> list[tuple[Domain, DataArray]]:
    at_points = [(Domain.VERTEX, one) for one in mesh.point_data]
    return at_points + [(Domain.FACE, one) for one in mesh.cell_data]
