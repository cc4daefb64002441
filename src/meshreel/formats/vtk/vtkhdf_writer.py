"""Writer for VTKHDF: animated polygons or cells, which are stored once per segment."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats
from meshreel.formats.arrays.named_tracks import array_name
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.shared_data import SharedData
from meshreel.formats.hdf import HdfOutput, Node, describe_track, hdf_output
from meshreel.formats.options import WriteOptions
from meshreel.formats.surfaces.cells import written_cells
from meshreel.formats.vtk.output_arrays import OutputArray, output_arrays, xml_text
from meshreel.formats.vtk.vtkhdf_steps import (
    DATA,
    DATA_GROUPS,
    GRID_GROUPS,
    IS_ATTRIBUTE,
    POLY_DATA_GROUPS,
    ROOT,
)
from meshreel.model.notes import written_times

VERSION = (2, 3)
CHUNK_ROWS = 1 << 14  # minimum, so that small frames share a chunk


def write_vtkhdf(path: Path, stream: SegmentedStream, options: WriteOptions) -> None:
    """Write a VTKHDF file, frame by frame; each segment is a partition.

    Attributes, groups and tracks of vertices and faces or cells become data arrays if all segments
    have them.
    """
    shared = SharedData.of(stream.meshes())
    times = written_times(stream.timing, stream.n_frames, stream.notes)
    shared.note_others(".vtkhdf", stream.notes)
    dtype = stream.dtype
    with hdf_output(path) as output:
        root = output.root.create_group(ROOT)
        root.attrs["Version"] = np.array(VERSION, np.int64)
        has_cells = any(mesh.surface.cells is not None for mesh in stream.meshes())
        root.attrs.create("Type", np.bytes_("UnstructuredGrid" if has_cells else "PolyData"))
        root.attrs["name"] = xml_text(stream.name)
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
        kinds, self._group_name = (GRID_GROUPS, "") if has_cells else (POLY_DATA_GROUPS, "Polygons")
        self._groups = {name: root.create_group(name) if name else root for name in kinds}
        group = self._groups[self._group_name]
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
        zeros = np.zeros(n_parts, np.int64)
        for name, group in self._groups.items():
            has_cells = name == self._group_name
            group["NumberOfCells"] = n_faces if has_cells else zeros
            group["NumberOfConnectivityIds"] = n_corners if has_cells else zeros
            if not has_cells:
                group["Offsets"], group["Connectivity"] = zeros, zeros[:0]
        column = [*self._groups].index(self._group_name)
        for name, counts in (("CellOffsets", n_faces), ("ConnectivityIdOffsets", n_corners)):
            first_rows = np.zeros((n_parts, len(self._groups)), np.int64)
            first_rows[1:, column] = np.cumsum(counts[:-1])
            steps[name] = np.repeat(first_rows, n_frames, axis=0)


class _DataArrays:
    """Writes attributes, face groups and tracks as point and cell data.

    Parameters
    ----------
    shared : SharedData
        Data that all segments have.
    """

    def __init__(self, root: Node, stream: SegmentedStream, shared: SharedData) -> None:
        self._root, self._stream, self._shared = root, stream, shared
        self._arrays: dict[tuple[str, str], _Rows] = {}
        for group_name in DATA:
            root.create_group(group_name)

    def add(self, segment: FrameStream, output: HdfOutput) -> None:
        """Write the data of a segment."""
        mesh = self._shared.restrict(segment)
        for array in output_arrays(mesh.surface, mesh.tracks, ".vtkhdf", segment.notes):
            if array.values is None:
                track = mesh.tracks[array.track]
                rows = self._rows(array, self._stream.n_frames)
                for _, block in output.blocks(track):
                    for values in block:
                        rows.append(values if array.n_columns > 1 else values[:, 0])
                describe_track(rows.dataset, array.track, track)
            else:
                rows = self._rows(array, self._stream.n_segments)
                rows.append(array.values, segment.n_frames)
                description = {"name": array.name, "kind": str(array.kind), IS_ATTRIBUTE: True}
                rows.dataset.attrs.update(description)
            if array.role:
                rows.dataset.attrs.create("Attribute", np.bytes_(array.role))

    def finish(self, steps: Node) -> None:
        """Write the first row of each array in each step."""
        for group_name in DATA:
            steps.create_group(f"{group_name}Offsets")
        for (group_name, _), rows in self._arrays.items():
            name = rows.dataset.name.rpartition("/")[2]
            steps[f"{group_name}Offsets"][name] = np.array(rows.starts, np.int64)

    def _rows(self, array: OutputArray, n_blocks: int) -> _Rows:
        key = group_name, _ = DATA_GROUPS[array.domain], array.name
        if key not in self._arrays:
            name = array_name(array.name)
            while name in self._root[group_name]:
                name += "_"
            self._arrays[key] = _Rows(self._root[group_name], name, n_blocks)
        return self._arrays[key]
