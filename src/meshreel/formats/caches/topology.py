"""The faces of a point cache, which are in a mesh file of their own."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import numpy as np

from meshreel.counting import counted
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.file_errors import errors_naming, os_errors_naming
from meshreel.formats.options import ReadOptions
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.geometry.fans import triangulate_fans
from meshreel.sequence import Faces
from meshreel.surface import PLAIN, Surface


class MeshFormat(Protocol):
    """What is needed of the `FrameFormat` of a mesh file."""

    @property
    def ending(self) -> str:
        """Lower case, with the dot."""

    @property
    def parse(self) -> Callable[[bytes], PolygonMesh]:
        """Gives the mesh of the bytes of a file."""

    @property
    def parse_surface(self) -> Callable[[bytes, list[str]], Surface] | None:
        """Gives attributes and groups of a file."""

    @property
    def has_corners_only(self) -> bool:
        """Whether triangles have vertices of their own."""


COMPANION = ".obj"
"""Ending of the mesh that is written beside a cache, and looked for there."""

ReadTopology = Callable[[Path, int, ReadOptions], tuple[Faces, Surface]]
"""Gives the triangles and the surface for a point cache of so many vertices."""


def topology_reader(formats: Mapping[str, MeshFormat]) -> ReadTopology:
    """A function that reads the faces of point caches from files of these formats, by ending.

    They are in the mesh that the options name, or else in that of the same name beside the cache.
    """

    def read_topology(cache: Path, n_verts: int, options: ReadOptions) -> tuple[Faces, Surface]:
        path = options.topology or cache.with_suffix(COMPANION)
        if options.topology is None and not path.is_file():
            raise InvalidInputError(
                f"{cache} holds positions of {counted(n_verts, 'vertex')} and no faces; name "
                "the mesh file "
                f"that has them with --topology mesh.obj (topology=), or put it beside as "
                f"{path.name}"
            )
        mesh_format = formats.get(path.suffix.lower())
        if mesh_format is None or mesh_format.has_corners_only:
            known = [one.ending for one in formats.values() if not one.has_corners_only]
            raise FormatError(
                f"{path}: faces of a point cache are read from {', '.join(known)} files"
            )
        with os_errors_naming(path):
            data = path.read_bytes()
        with errors_naming(path):
            mesh = mesh_format.parse(data)
            parse_surface = mesh_format.parse_surface
            surface = parse_surface(data, options.notes) if parse_surface else PLAIN
        if len(mesh.vertices) != n_verts:
            raise InvalidInputError(
                f"{cache} has {counted(n_verts, 'vertex')} and {path} {len(mesh.vertices)}; "
                "give the mesh that the cache was made of"
            )
        faces = triangulate_fans(mesh.counts, mesh.corners)
        return faces, replace(surface, face_sizes=mesh.counts.astype(np.int32))

    return read_topology
