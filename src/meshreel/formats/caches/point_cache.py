"""Code shared by point caches: a header, float32 positions, and faces from a separate mesh file."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import errors_naming, os_errors_naming, refuse_pipe
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.frames.stored_frames import changed_error
from meshreel.formats.notes import note_kinds
from meshreel.formats.options import ReadOptions
from meshreel.formats.registry import COMPANION, FRAME_FORMATS
from meshreel.model.geometry.polygons import triangulate_fans
from meshreel.model.sequence import Faces, Vertices
from meshreel.model.surface import PLAIN, Surface
from meshreel.runtime.counting import counted

FRAME_RATE = 24.0  # written if a sequence has none but the file needs one
VERTEX_BYTES = 12


def check_cache_size(header_bytes: int, n_frames: int, n_verts: int, size_bytes: int) -> None:
    """Reject a point cache whose size contradicts its header.

    Raises
    ------
    FormatError
        If the sizes differ; the message gives both.
    """
    if n_frames < 1 or n_verts < 1:
        raise FormatError(f"declares {counted(n_frames, 'frame')} of {counted(n_verts, 'vertex')}")
    expected = header_bytes + n_frames * n_verts * VERTEX_BYTES
    if size_bytes != expected:
        problem = "is truncated" if size_bytes < expected else "is damaged"
        raise FormatError(
            f"{problem}: {counted(n_frames, 'frame')} of {counted(n_verts, 'vertex')} take "
            f"{expected} bytes; "
            f"the file has {size_bytes}"
        )


def cache_reader(
    path: Path, header_bytes: int, n_verts: int, number: str
) -> Callable[[int, int], Vertices]:
    """Return a function that reads frames start..stop - 1 of a point cache as native float32.

    Parameters
    ----------
    header_bytes : int
        Offset of the first frame.
    number : {"<f4", ">f4"}
        Number type in the file.
    """

    def read(start: int, stop: int) -> Vertices:
        width = n_verts * 3
        offset = header_bytes + start * n_verts * VERTEX_BYTES
        with os_errors_naming(path):
            numbers = np.fromfile(path, number, (stop - start) * width, offset=offset)
        if len(numbers) < (stop - start) * width:
            raise changed_error(f"{path} (frame {start + len(numbers) // width})")
        return numbers.reshape(-1, n_verts, 3).astype(np.float32, copy=False)

    return read


def single_precision(stream: FrameStream) -> Iterator[Vertices]:
    """Yield each frame in float32; a note reports the rounding error, if any.

    Raises
    ------
    InvalidInputError
        If a frame exceeds float32; the message names it.
    """
    max_error = 0.0
    for index, frame in enumerate(stream.frames()):
        with np.errstate(over="ignore", under="ignore"):
            rounded: Vertices = frame.astype(np.float32, copy=False)
        if rounded is not frame:
            if not np.isfinite(rounded).all():
                raise InvalidInputError(
                    f"frame {index} has coordinates up to {np.abs(frame).max():g}; point caches "
                    "store float32, up to 3.4e38; scale the model down"
                )
            max_error = max(max_error, float(np.abs(rounded - frame).max()))
        yield rounded
    if max_error > 0:
        stream.notes.append(f"positions were rounded to float32, by up to {max_error:.3g}")


def read_topology(cache: Path, n_verts: int, options: ReadOptions) -> tuple[Faces, Surface]:
    """Return the triangles and the surface for a point cache with `n_verts` vertices.

    They come from the mesh file of the options, or from the mesh file next to the cache with the
    same name.

    Raises
    ------
    InvalidInputError
        If there is no such mesh, or its number of vertices differs.
    FormatError
        If the mesh has a format without shared vertices, or is damaged.
    """
    path = options.topology or cache.with_suffix(COMPANION)
    if options.topology is None and not path.is_file():
        raise InvalidInputError(
            f"{cache} has positions of {counted(n_verts, 'vertex')} without faces; give the mesh "
            f"file with the faces by --topology mesh.obj (topology=), or store it as {path.name} "
            "in the same folder"
        )
    mesh_format = FRAME_FORMATS.get(path.suffix.lower())
    if mesh_format is None or mesh_format.has_unshared_vertices:
        known = [one.extension for one in FRAME_FORMATS.values() if not one.has_unshared_vertices]
        raise FormatError(
            f"{path}: the faces of a point cache must be in a {', '.join(known)} file"
        )
    refuse_pipe(path)
    with os_errors_naming(path):
        data = path.read_bytes()
    with errors_naming(path):
        mesh = mesh_format.parse(data)
        parse_surface = mesh_format.parse_surface
        surface = parse_surface(data, options.notes) if parse_surface else PLAIN
        if mesh_format.parse_fields is not None:
            attributes = {(one.domain, one.name) for one in surface.attributes}
            others = (key[1] for key in mesh_format.parse_fields(data) if key not in attributes)
            note_kinds(options.notes, "fields", others)
    if len(mesh.vertices) != n_verts:
        raise InvalidInputError(
            f"{cache} has {counted(n_verts, 'vertex')} and {path} {len(mesh.vertices)}; "
            "use the mesh that the cache was created from"
        )
    faces = triangulate_fans(mesh.counts, mesh.corners)
    return faces, replace(surface, face_sizes=mesh.counts.astype(np.int32))
