"""The faces of a point cache, which are stored in a separate mesh file."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import errors_naming, os_errors_naming, refuse_pipe
from meshreel.formats.notes import note_kinds
from meshreel.formats.options import ReadOptions
from meshreel.formats.registry import COMPANION, FRAME_FORMATS
from meshreel.model.geometry.fans import triangulate_fans
from meshreel.model.sequence import Faces
from meshreel.model.surface import PLAIN, Surface
from meshreel.runtime.counting import counted


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
