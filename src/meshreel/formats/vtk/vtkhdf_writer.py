"""Writer for VTKHDF: animated polygons or cells, which are stored once per segment."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.formats.arrays.named_arrays import surface_arrays
from meshreel.formats.arrays.named_tracks import array_name
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.frames.steps import TEXTURE_COORDINATES
from meshreel.formats.hdf import HdfOutput, Node, describe_track, hdf_output, write_array
from meshreel.formats.options import WriteOptions
from meshreel.formats.surfaces.cells import written_cells
from meshreel.formats.vtk.vtkhdf_steps import (
    DATA,
    GRID_GROUPS,
    IS_ATTRIBUTE,
    MESHREEL_GROUP,
    PLACES,
    POLY_DATA_GROUPS,
    ROOT,
    SEGMENT_STARTS,
    segment_group,
)
from meshreel.model.notes import listed, note_unwritten_tracks, written_times
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.tracks import TrackKind, TrackSource

VERSION = (2, 3)
CHUNK_ROWS = 1 << 14  # minimum, so that small frames share a chunk


def write_vtkhdf(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a VTKHDF file, frame by frame; each segment is a partition.

    Attributes and tracks of vertices and faces become data arrays if all segments have them. A
    second group next to VTKHDF stores the surface of each segment for meshreel, including what VTK
    cannot represent.
    """
    shared = SharedData.of(stream.meshes())
    times = written_times(stream.timing, stream.n_frames, stream.notes)
    _note_losses(stream, shared)
    dtype = stream.dtype
    with hdf_output(path) as output:
        root = output.root.create_group(ROOT)
        root.attrs["Version"] = np.array(VERSION, np.int64)
        has_cells = any(mesh.surface.cells is not None for mesh in stream.meshes())
        root.attrs.create("Type", np.bytes_("UnstructuredGrid" if has_cells else "PolyData"))
        _write_surfaces(output.root.create_group(MESHREEL_GROUP), stream)
        points = _Rows(root, "Points", stream.n_frames)
        partitions = _Partitions(root, stream.n_segments, has_cells=has_cells)
        arrays = _DataArrays(root, stream, shared)
        for segment in stream.segments():
            partitions.add(segment)
            arrays.add(segment, output)
            for _, frame in output.frames(segment):
                points.append(frame.astype(dtype, copy=False))
        steps = _write_steps(root, times)
        steps["PointOffsets"] = np.array(points.starts, np.int64)
        partitions.finish(steps)
        arrays.finish(steps)


def _note_losses(stream: SegmentedStream, shared: SharedData) -> None:
    note_unwritten_tracks(
        shared.other_tracks, ".vtkhdf", stream.notes, "those of some segments only"
    )
    if shared.other_data:
        text = f"only some segments have {listed(shared.other_data)}; only meshreel reads it back"
        stream.notes.changed("data of some segments", text)


def _write_steps(root: Node, times: Floats) -> Node:
    n_steps = len(times)
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(n_steps)
    steps["Values"] = times
    steps["NumberOfParts"] = np.ones(n_steps, np.int64)
    return steps


class _Rows:
    """A dataset that grows by blocks of rows.

    Parameters
    ----------
    n_blocks : int
        Expected number of blocks of about the same size.

    Attributes
    ----------
    starts : list of int
        First row of each step.
    """

    def __init__(self, group: Node, name: str, n_blocks: int) -> None:
        self._group, self._name, self._n_blocks = group, name, n_blocks
        self._n_rows = 0
        self.starts: list[int] = []
        self.dataset: Any = None

    def append(self, values: npt.NDArray[Any], n_steps: int = 1) -> None:
        """Append the rows of one step, or of several that share them."""
        n_rows, first = len(values), self._n_rows
        if self.dataset is None:
            chunk = max(1, min(max(n_rows, CHUNK_ROWS), n_rows * self._n_blocks))
            self.dataset = self._group.create_dataset(
                self._name,
                (0, *values.shape[1:]),
                values.dtype,
                maxshape=(None, *values.shape[1:]),
                chunks=(chunk, *values.shape[1:]),
            )
        self._n_rows += n_rows
        self.dataset.resize(self._n_rows, axis=0)
        self.dataset[first:] = values
        self.starts += [first] * n_steps


class _Partitions:
    """Writes the faces or cells of each segment as a partition, and the partition of each step."""

    def __init__(self, root: Node, n_segments: int, *, has_cells: bool) -> None:
        self._root = root
        kinds, self._filled = (GRID_GROUPS, "") if has_cells else (POLY_DATA_GROUPS, "Polygons")
        self._groups = {name: root.create_group(name) if name else root for name in kinds}
        group = self._groups[self._filled]
        self._offsets = _Rows(group, "Offsets", n_segments)
        self._connectivity = _Rows(group, "Connectivity", n_segments)
        self._types = _Rows(group, "Types", n_segments) if has_cells else None
        self._sizes: list[tuple[int, int, int, int]] = []

    def add(self, segment: FrameStream) -> None:
        """Write the faces or cells of a segment."""
        cells = written_cells(segment.faces, segment.surface)
        self._offsets.append(np.concatenate([[0], np.cumsum(cells.counts, dtype=np.int64)]))
        self._connectivity.append(cells.points)
        if self._types is not None:
            self._types.append(cells.types)
        sizes = len(cells.counts), len(cells.points)
        self._sizes.append((segment.n_frames, segment.n_verts, *sizes))

    def finish(self, steps: Node) -> None:
        """Write the sizes of all partitions, and where each step begins."""
        n_frames, n_points, n_faces, n_corners = np.array(self._sizes, np.int64).T
        n_parts = len(n_frames)
        self._root["NumberOfPoints"] = n_points
        steps["PartOffsets"] = np.repeat(np.arange(n_parts), n_frames)
        none = np.zeros(n_parts, np.int64)
        for name, group in self._groups.items():
            is_filled = name == self._filled
            group["NumberOfCells"] = n_faces if is_filled else none
            group["NumberOfConnectivityIds"] = n_corners if is_filled else none
            if not is_filled:
                group["Offsets"], group["Connectivity"] = none, none[:0]
        column = [*self._groups].index(self._filled)
        for name, counts in (("CellOffsets", n_faces), ("ConnectivityIdOffsets", n_corners)):
            firsts = np.zeros((n_parts, len(self._groups)), np.int64)
            firsts[1:, column] = np.cumsum(counts[:-1])
            steps[name] = np.repeat(firsts, n_frames, axis=0)


class _DataArrays:
    """Writes attributes, face groups and tracks as point and cell data.

    Parameters
    ----------
    shared : SharedData
        What all segments have.
    """

    def __init__(self, root: Node, stream: SegmentedStream, shared: SharedData) -> None:
        self._root, self._stream, self._shared = root, stream, shared
        self._arrays: dict[tuple[Any, ...], tuple[str, _Rows]] = {}
        for place in DATA:
            root.create_group(place)

    def add(self, segment: FrameStream, output: HdfOutput) -> None:
        """Write the data of a segment."""
        has_uv = False
        own = self._shared.only(segment)
        of_cells = Domain.FACE if segment.surface.cells is None else Domain.CELL
        for number, attribute in enumerate(own.surface.attributes):
            if attribute.domain not in (Domain.VERTEX, of_cells):
                segment.notes.changed(attribute.name, _corner_note(attribute))
                continue
            key = "attribute", number
            dataset = self._add_constant(
                segment, key, attribute.domain, attribute.name, attribute.per_item()
            )
            if attribute.kind is Kind.UV and not has_uv:
                dataset.attrs.create("Attribute", np.bytes_(TEXTURE_COORDINATES))
                has_uv = True
        for groups in own.surface.groups if of_cells is Domain.FACE else ():
            place = "group", groups.name
            self._add_constant(segment, place, Domain.FACE, groups.name, groups.numbers)
        for name, track in own.tracks.items():
            self._add_track(output, name, track)

    def finish(self, steps: Node) -> None:
        """Write the first row of each array in each step."""
        for place in DATA:
            steps.create_group(f"{place}Offsets")
        for place, rows in self._arrays.values():
            name = rows.dataset.name.rpartition("/")[2]
            steps[f"{place}Offsets"][name] = np.array(rows.starts, np.int64)

    def _add_constant(
        self,
        segment: FrameStream,
        key: tuple[Any, ...],
        domain: Domain,
        name: str,
        values: npt.NDArray[Any],
    ) -> Any:
        """Write an array that is the same in all steps of a segment; return the dataset."""
        rows = self._rows(key, domain, name, self._stream.n_segments)
        rows.append(values, segment.n_frames)
        rows.dataset.attrs[IS_ATTRIBUTE] = True
        return rows.dataset

    def _add_track(self, output: HdfOutput, name: str, track: TrackSource) -> None:
        """Write the values of all steps of a segment."""
        rows = self._rows(("track", name), track.domain, name, self._stream.n_frames)
        for _, block in output.blocks(track):
            for values in block:
                rows.append(values if track.shape[2] > 1 else values[:, 0])
        describe_track(rows.dataset, name, track)
        if track.kind is TrackKind.NORMAL:
            rows.dataset.attrs.create("Attribute", np.bytes_(NORMALS))

    def _rows(self, key: tuple[Any, ...], domain: Domain, name: str, n_blocks: int) -> _Rows:
        if key not in self._arrays:
            place = PLACES[domain]
            array = _unique_name(self._root[place], name)
            self._arrays[key] = place, _Rows(self._root[place], array, n_blocks)
        return self._arrays[key][1]


def _corner_note(attribute: Attribute) -> str:
    return (
        f"{attribute.kind} {attribute.name!r} has a value for each {attribute.domain}, which the "
        "file does not support; only meshreel reads it back"
    )


def _unique_name(group: Node, name: str) -> str:
    """Return a valid name for an array that is not used in the group yet."""
    name = array_name(name)
    while name in group:
        name += "_"
    return name


def _write_surfaces(group: Node, stream: SegmentedStream) -> None:
    """Write the whole surface of each segment for meshreel."""
    write_array(group, "fps", np.asarray(np.float64(stream.timing.fps)))
    write_array(group, "name", np.asarray(np.str_(stream.name)))
    if stream.n_segments > 1:
        write_array(group, SEGMENT_STARTS, np.array(stream.starts[:-1], np.int64))
    for number, mesh in enumerate(stream.meshes()):
        own = group
        if stream.n_segments > 1:
            own = group.create_group(segment_group(number))
        _write_surface(own, mesh.surface)


def _write_surface(group: Node, surface: Surface) -> None:
    for name, array in surface_arrays(surface).items():
        if name != "face_sizes":  # the polygons of VTKHDF have them
            write_array(group, name, array)
