"""HDF5 files with one sequence, in datasets named as in `meshreel.formats.arrays.named_arrays`.

Files of other programs are supported too: positions in any dataset of shape (T, V, 3), or
(V, 3, T) as in registered body scans, with ``faces`` in the same group or in a group above.
"""

from collections.abc import Callable, Iterator, Set
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError, InvalidInputError, Keyword
from meshreel.formats.arrays.named_arrays import (
    RESERVED_NAMES,
    Layout,
    described_arrays,
    find_layout,
    has_positions,
    read_description,
    vertex_numbers,
)
from meshreel.formats.arrays.named_tracks import TRACKS_FOLDER, Candidate, array_names, named_tracks
from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.frame_stream import FrameStream, SegmentedStream
from meshreel.formats.frames.stored_frames import CheckedReader, changed_error
from meshreel.formats.hdf import (
    TRACK_ATTRIBUTES,
    Dataset,
    HdfOutput,
    Node,
    describe_track,
    find_dataset,
    find_group,
    hdf_errors,
    hdf_output,
    open_hdf,
    read_all,
    read_text_attribute,
    read_unit,
    require_dataset,
    write_array,
)
from meshreel.formats.kinds import EVERY_DOMAIN, SequenceFormat
from meshreel.formats.options import Reading, WriteOptions
from meshreel.formats.registry import SEQUENCE_FORMATS
from meshreel.formats.scenes.scene_source import open_scene
from meshreel.model.notes import Notes, listed
from meshreel.model.sequence import FrameSource
from meshreel.runtime.extras import HDF

POSITIONS = "vertices"
CHUNK_BYTES = 1 << 16  # minimum, so that small frames share a chunk
MAX_VISITED = 100_000
MAX_LISTED = 20


def open_hdf_sequence(path: Path, reading: Reading) -> FrameSource:
    """Open the sequence of an HDF5 file; large positions stay in the file.

    A file with a group VTKHDF is read by `meshreel.formats.vtk.vtkhdf`.

    Raises
    ------
    FormatError
        If the file is not HDF5, is damaged, or lacks faces.
    InvalidInputError
        If several datasets may be the positions and none is chosen; the message lists them.
    """
    with errors_naming(path), hdf_errors():
        root = open_hdf(path)
        is_vtkhdf = find_group(root, "VTKHDF") is not None
    if is_vtkhdf:  # outside the context: its errors already name the path
        read_meshes = SEQUENCE_FORMATS[".vtkhdf"].read_meshes
        assert read_meshes is not None
        return open_scene(read_meshes, path, reading)
    with errors_naming(path), hdf_errors():
        positions = _find_positions(root, reading)
        if positions.dtype.kind != "f" or positions.dtype.itemsize not in (4, 8):
            raise InvalidInputError(
                f"{positions.name} must be float32 or float64; got {positions.dtype}"
            )
        datasets = _named_datasets(root, positions)
        arrays = {name: read_all(dataset) for name, dataset in datasets.items()}
        candidates = {track.path: track for track in _candidates_next_to(root, positions)}
        read_paths = {dataset.name.strip("/") for dataset in (positions, *datasets.values())}
        _note_left_out(root, read_paths, candidates.keys(), reading.notes)
        name = positions.name.rpartition("/")[2]
        layout = find_layout(
            positions.shape, vertex_numbers(arrays), positions.name, is_documented=name == POSITIONS
        )
        n_frames, n_verts = layout.sizes(positions.shape)
        default_name = path.stem if name == POSITIONS else name
        description = read_description(arrays, default_name, reading, n_frames, n_verts)
    if min(n_frames, n_verts) < 1:
        raise InvalidInputError(f"{positions.name} is empty: {positions.shape}", path=path)
    dtype = positions.dtype.newbyteorder("=")
    with errors_naming(path), hdf_errors():
        tracks = {
            name: track.stored_track(
                CheckedReader(path, _reader(path, require_dataset(root, track.path)))
            )
            for name, track in named_tracks(
                candidates.values(), n_frames, n_verts, description, reading.notes
            ).items()
        }
    shape, max_bytes = (n_frames, n_verts), reading.max_loaded_bytes
    read = CheckedReader(path, _reader(path, positions, layout))
    with errors_naming(path):
        return description.open(shape, dtype, read, [path], tracks, max_bytes, reading.progress)


def write_hdf(path: Path, segments: SegmentedStream, options: WriteOptions) -> None:
    """Write an HDF5 file frame by frame; positions and tracks round-trip exactly."""
    stream = segments.only()
    shape = stream.n_frames, stream.n_verts, 3
    with hdf_output(path) as output:
        vertices = _create_dataset(output.root, POSITIONS, shape, stream.dtype)
        for name, array in described_arrays(stream).items():
            write_array(output.root, name, array)
        for index, frame in output.frames(stream):
            vertices[index] = frame
        _write_tracks(output, stream)


def _write_tracks(output: HdfOutput, stream: FrameStream) -> None:
    """Write each track to a dataset of the track group, with its description as attributes."""
    if not stream.tracks:
        return
    group = output.root.create_group(TRACKS_FOLDER)
    dataset_names = array_names(stream.tracks)
    for name, track in stream.tracks.items():
        # HDF5 places the last chunks of a dataset when it closes it: the last track when this
        # function returns, before the positions.
        dataset = _create_dataset(group, dataset_names[name], track.shape, track.dtype)
        describe_track(dataset, name, track)
        for start, values in output.blocks(track):
            dataset[start : start + len(values)] = values


def _create_dataset(
    group: Node, name: str, shape: tuple[int, int, int], dtype: np.dtype[Any]
) -> Dataset:
    """Return a new dataset in chunks of whole frames."""
    frame_bytes = shape[1] * shape[2] * dtype.itemsize
    chunk_frames = min(shape[0], max(1, CHUNK_BYTES // frame_bytes))
    return group.create_dataset(name, shape, dtype, chunks=(chunk_frames, *shape[1:]))


def _reader(
    path: Path, dataset: Dataset, layout: Layout = Layout.FRAMES_FIRST
) -> Callable[[int, int], npt.NDArray[Any]]:
    """Return a function that reads frames start..stop - 1 of a dataset, in native byte order."""

    def read(start: int, stop: int) -> npt.NDArray[Any]:
        try:
            if layout is Layout.FRAMES_FIRST:
                block: Any = dataset[start:stop]
            else:
                block = dataset[:, :, start:stop].transpose(2, 0, 1)
        except (OSError, RuntimeError, ValueError) as error:
            raise changed_error(f"{path} (frames {start} to {stop - 1})") from error
        return np.ascontiguousarray(block, dataset.dtype.newbyteorder("="))

    return read


def _candidates_next_to(root: Node, positions: Dataset) -> Iterator[Candidate]:
    """Yield datasets that may be tracks: next to the positions, or in the track group there."""
    parent = positions.name.rpartition("/")[0]
    for folder in (parent, f"{parent}/{TRACKS_FOLDER}"):
        group = find_group(root, folder or "/")
        if group is None:
            continue
        for name in group:
            path = f"{folder}/{name}".lstrip("/")
            is_reserved = folder == parent and RESERVED_NAMES.fullmatch(name)
            if is_reserved or f"/{path}" == positions.name:
                continue
            if not isinstance(group.get(name, getlink=True), HDF.load().HardLink):
                continue
            try:
                dataset = find_dataset(group, name)
            except FormatError:  # external data: listed in the notes
                yield Candidate(path, name, (), np.dtype(object))
                continue
            if dataset is not None:
                yield Candidate(
                    path,
                    read_text_attribute(dataset, "name") or name,
                    dataset.shape,
                    dataset.dtype,
                    read_text_attribute(dataset, "domain"),
                    read_text_attribute(dataset, "kind"),
                    read_unit(dataset),
                )


def _find_positions(root: Node, reading: Reading) -> Dataset:
    """Return the dataset of the options, or named vertices, or the only one with positions."""
    if reading.dataset is None and (dataset := find_dataset(root, POSITIONS)) is not None:
        return dataset
    names: list[str] = []

    def add_positions(name: str, node: Node) -> None:
        is_track = PurePosixPath(name).parent.name == TRACKS_FOLDER
        if isinstance(node, HDF.load().Dataset) and node.dtype.kind == "f" and not is_track:
            names.extend([name] if has_positions(node.shape) else [])

    _visit(root, add_positions)
    matches = names
    if reading.dataset is not None:
        if (dataset := find_dataset(root, reading.dataset)) is not None:
            return dataset
        matches = [name for name in names if f"/{name}".endswith(f"/{reading.dataset.strip('/')}")]
    if len(matches) == 1:
        return require_dataset(root, matches[0])
    if not names:
        raise FormatError(
            "has no dataset of positions: float32 or float64, of shape (T, V, 3) or (V, 3, T)"
        )
    prefix = "" if reading.dataset is None else f"has no dataset {reading.dataset!r}; it "
    raise InvalidInputError(
        f"{prefix}holds positions in {len(names)} datasets: {listed(names, MAX_LISTED)}; "
        "choose one with ",
        Keyword("dataset"),
    )


def _note_left_out(root: Node, read: Set[str], tracks: Set[str], notes: Notes) -> None:
    """Note datasets that belong to neither the sequence nor its tracks, and unread attributes."""
    unread = [("attributes", f"{key} of the file") for key in root.attrs]

    def visit(name: str, node: Node) -> None:
        if isinstance(node, HDF.load().Dataset) and name not in read | tracks:
            unread.append(("datasets", name))
        read_keys = TRACK_ATTRIBUTES if name in tracks else ()
        unread.extend(("attributes", f"{key} of {name}") for key in node.attrs.keys() - read_keys)

    _visit(root, visit)
    notes.left_out_items(sorted(unread))


def _visit(root: Node, visit: Callable[[str, Node], None]) -> None:
    """Call a function with the path of each group and dataset; links are not followed."""
    numbers = count(1)

    def visit_next(name: str, node: Node) -> bool | None:
        visit(name, node)
        return True if next(numbers) >= MAX_VISITED else None

    root.visititems(visit_next)


def _named_datasets(root: Node, positions: Dataset) -> dict[str, Dataset]:
    """Return the named arrays next to the positions; faces may also be in a group above."""
    folders = [str(folder) for folder in PurePosixPath(positions.name).parents]  # nearest first
    datasets: dict[str, Dataset] = {}
    for name in filter(RESERVED_NAMES.fullmatch, find_group(root, folders[0]) or ()):
        if (dataset := find_dataset(root, f"{folders[0]}/{name}")) is not None:
            datasets[name] = dataset
    for folder in folders if "cells" not in datasets else ():
        if (dataset := find_dataset(root, f"{folder}/faces")) is not None:
            datasets.setdefault("faces", dataset)
    if not {"faces", "cells"} & datasets.keys():
        raise FormatError(
            f"has no dataset 'faces' of shape (M, 3) next to {positions.name}, and no 'cells'; "
            "store one there"
        )
    return datasets


FORMATS = tuple(
    SequenceFormat(
        extension,
        "HDF5 datasets",
        open_hdf_sequence,
        write_hdf,
        extra=HDF,
        read_options=frozenset({"dataset", "object", "merge", "skip_bad"}),
        track_domains=EVERY_DOMAIN,
    )
    for extension in (".h5", ".hdf5", ".hdf")
)
