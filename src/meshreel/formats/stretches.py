"""Splitting of a sequence with changing faces into stretches of constant faces."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path

from meshreel.formats.file_errors import errors_naming
from meshreel.formats.frames.mesh_files import MeshFiles
from meshreel.formats.frames.opening import open_mesh_files
from meshreel.formats.frames.selection import select_attributes
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_source import frame_range, open_mesh, select_mesh
from meshreel.formats.sources import Source, SourceFiles, find_files
from meshreel.formats.supported_options import check_read_options
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.sequence import FrameSource
from meshreel.runtime.progress import Count


@dataclass(frozen=True)
class Stretch:
    """Consecutive frames of a sequence with the same vertices and faces.

    Attributes
    ----------
    start, stop : int
        Range of frames in the whole sequence.
    open : function
        Opens them as a sequence.
    """

    start: int
    stop: int
    open: Callable[[], FrameSource]

    def path(self, whole: Path) -> Path:
        """Return the path of this stretch, given that of the whole: ``walk_0-41.reel``."""
        return whole.with_name(f"{whole.stem}_{self.start}-{self.stop - 1}{whole.suffix}")


def find_stretches(source: Source, options: ReadOptions) -> list[Stretch]:
    """Find the stretches of a sequence, in order; one if its faces never change.

    Reads all frames now, and again when a stretch is opened.

    Parameters
    ----------
    source : str, Path, or list or tuple of them
        As in `meshreel.load`. Only frame files and scene files can have changing faces.

    Raises
    ------
    InvalidInputError, FormatError
        As `meshreel.load`.
    """
    found = find_files(source)
    check_read_options(found.format, options)
    return [
        _with_selected_attributes(one, options, found.paths[0])
        for one in _stretches(found, options)
    ]


def _with_selected_attributes(stretch: Stretch, options: ReadOptions, path: Path) -> Stretch:
    """Return a stretch with only the attributes that the options select."""
    return replace(
        stretch, open=lambda: select_attributes(stretch.open(), options.attributes, path)
    )


def _stretches(found: SourceFiles, options: ReadOptions) -> list[Stretch]:
    if not isinstance(found.format, SequenceFormat):
        return list(_of_files(MeshFiles(found.paths, found.format), found, options))
    path, form = found.paths[0], found.format
    if form.read_meshes is None:
        sequence = form.open(path, options)
        return [Stretch(0, sequence.n_frames, lambda: sequence)]
    mesh = select_mesh(form.read_meshes, path, options)
    with errors_naming(path):
        runs = _same_faces(mesh.frame, len(mesh.times_s), options)
    return [
        Stretch(start, stop, partial(open_mesh, frame_range(mesh, start, stop), path, options))
        for start, stop in runs
    ]


def _of_files(files: MeshFiles, found: SourceFiles, options: ReadOptions) -> Iterator[Stretch]:
    for start, stop in _same_faces(files.mesh, len(files), options):
        part = MeshFiles(files.paths[start:stop], files.format)
        start_s = start / options.fps if options.fps else 0.0
        yield Stretch(
            start, stop, partial(open_mesh_files, part, found.name, options, start_s=start_s)
        )


def _same_faces(
    frame: Callable[[int], PolygonMesh], n_frames: int, options: ReadOptions
) -> list[tuple[int, int]]:
    """Start and stop of each run of frames with the same vertices and faces."""
    borders, first = [0], frame(0)
    for index in range(1, n_frames):
        mesh = frame(index)
        if mesh.difference(first):
            borders.append(index)
            first = mesh
        options.progress("comparing", Count(index + 1, n_frames, "frames"))
    return list(pairwise([*borders, n_frames]))
