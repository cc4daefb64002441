"""Writer for VTKHDF: an animated PolyData whose faces are stored once."""

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.arrays.named_arrays import surface_arrays
from meshreel.formats.arrays.named_tracks import array_name
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.hdf.reading import Node, write_array
from meshreel.formats.hdf.track_attributes import describe_track
from meshreel.formats.hdf.writing import HdfOutput, hdf_output
from meshreel.formats.options import WriteOptions
from meshreel.formats.vtk.data_arrays import TEXTURE_COORDINATES
from meshreel.formats.vtk.vtkhdf import MESHREEL_GROUP, ROOT
from meshreel.formats.vtk.vtkhdf_steps import PLACES, POLY_DATA_GROUPS
from meshreel.model.geometry.fans import join_fans
from meshreel.model.surface import Attribute, Kind
from meshreel.model.tracks import TrackKind, TrackSource

VERSION = (2, 3)
FRAME_RATE = 24.0  # for sequences without a frame rate
CHUNK_ROWS = 1 << 14  # minimum, so that small frames share a chunk


def write_vtkhdf(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write a VTKHDF file, frame by frame.

    Attributes and tracks of vertices and faces become data arrays. A second group next to VTKHDF
    stores the whole surface for meshreel, including what VTK cannot represent.
    """
    with hdf_output(path) as output:
        file = output.root
        root = file.create_group(ROOT)
        root.attrs["Version"] = np.array(VERSION, np.int64)
        root.attrs.create("Type", np.bytes_("PolyData"))
        root["NumberOfPoints"] = np.array([stream.n_verts], np.int64)
        _write_faces(root, stream)
        steps = _write_steps(root, stream)
        _write_data(root, steps, stream)
        _write_surface(file.create_group(MESHREEL_GROUP), stream)
        points = root.create_dataset(
            "Points",
            (0, 3),
            stream.dtype,
            maxshape=(None, 3),
            chunks=(min(max(stream.n_verts, CHUNK_ROWS), stream.n_verts * stream.n_frames), 3),
        )
        for index, frame in output.frames(stream):
            points.resize((index + 1) * stream.n_verts, axis=0)
            points[index * stream.n_verts :] = frame
        for name, track in stream.tracks.items():
            _write_track(output, root, steps, name, track)


def _write_faces(root: Node, stream: FrameStream) -> None:
    sizes = stream.surface.sizes(len(stream.faces))
    corners = join_fans(sizes, stream.faces)
    offsets = np.concatenate([[0], np.cumsum(sizes, dtype=np.int64)])
    for name in POLY_DATA_GROUPS:
        is_filled = name == "Polygons"
        group = root.create_group(name)
        group["NumberOfCells"] = np.array([len(sizes) if is_filled else 0], np.int64)
        group["NumberOfConnectivityIds"] = np.array([len(corners) if is_filled else 0], np.int64)
        group["Offsets"] = offsets if is_filled else np.zeros(1, np.int64)
        group["Connectivity"] = corners.astype(np.int64) if is_filled else np.empty(0, np.int64)


def _write_steps(root: Node, stream: FrameStream) -> Node:
    if not stream.fps:
        stream.notes.append(f"the frame rate is unknown; written as {FRAME_RATE:g} fps")
    n_steps = stream.n_frames
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(n_steps)
    steps["Values"] = stream.start_s + np.arange(n_steps) / (stream.fps or FRAME_RATE)
    steps["PointOffsets"] = np.arange(n_steps, dtype=np.int64) * stream.n_verts
    steps["NumberOfParts"] = np.ones(n_steps, np.int64)
    steps["PartOffsets"] = np.zeros(n_steps, np.int64)
    shape = n_steps, len(POLY_DATA_GROUPS)
    steps["CellOffsets"] = steps["ConnectivityIdOffsets"] = np.zeros(shape, np.int64)
    return steps


def _write_data(root: Node, steps: Node, stream: FrameStream) -> None:
    """Write the part of the surface that VTK supports: point data, cell data and face groups."""
    for place in PLACES.values():
        root.create_group(place)
        steps.create_group(f"{place}Offsets")
    first_uv = next((one for one in stream.surface.of_kind(Kind.UV) if one.domain in PLACES), None)
    for one in stream.surface.attributes:
        if one.domain in PLACES:
            dataset = _add_array(root, steps, PLACES[one.domain], one.name, one.per_item())
            if one is first_uv:
                dataset.attrs.create("Attribute", np.bytes_(TEXTURE_COORDINATES))
        else:
            stream.notes.append(_corner_note(one))
    for groups in stream.surface.groups:
        _add_array(root, steps, "CellData", groups.name, groups.numbers)


def _corner_note(attribute: Attribute) -> str:
    return (
        f"{attribute.kind} {attribute.name!r} has a value for each face corner, which VTK does "
        "not support; only meshreel reads it back"
    )


def _add_array(root: Node, steps: Node, place: str, name: str, values: npt.NDArray[Any]) -> Node:
    """Write an array that is the same in all steps."""
    name = _unique_name(root[place], name)
    dataset = root[place].create_dataset(name, data=values)
    steps[f"{place}Offsets"][name] = np.zeros(steps.attrs["NSteps"], np.int64)
    return dataset


def _unique_name(group: Node, name: str) -> str:
    """Return a valid name for an array that is not used in the group yet."""
    name = array_name(name)
    while name in group:
        name += "_"
    return name


def _write_track(output: HdfOutput, root: Node, steps: Node, name: str, track: TrackSource) -> None:
    """Write the values of all steps into one dataset, and the first row of each step."""
    place = PLACES[track.domain]
    array = _unique_name(root[place], name)
    n_frames, n_items, n_columns = track.shape
    row = (n_columns,) if n_columns > 1 else ()
    n_rows = n_frames * n_items
    chunk = min(max(n_items, CHUNK_ROWS), n_rows), *row
    dataset = root[place].create_dataset(array, (n_rows, *row), track.dtype, chunks=chunk)
    describe_track(dataset, name, track)
    if track.kind is TrackKind.NORMAL:
        dataset.attrs.create("Attribute", np.bytes_(NORMALS))
    steps[f"{place}Offsets"][array] = np.arange(n_frames, dtype=np.int64) * n_items
    for start, values in output.blocks(track):
        rows = slice(start * n_items, (start + len(values)) * n_items)
        dataset[rows] = values.reshape(-1, *row)


def _write_surface(group: Node, stream: FrameStream) -> None:
    """Write the whole surface for meshreel."""
    about: dict[str, npt.NDArray[Any]] = {
        "fps": np.asarray(np.float64(stream.fps)),
        "name": np.asarray(np.str_(stream.name)),
    }
    for name, array in (about | surface_arrays(stream.surface)).items():
        if name != "face_sizes":  # the polygons of VTKHDF have them
            write_array(group, name, array)
