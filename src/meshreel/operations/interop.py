"""Meshes of trimesh and PyVista as sequences, and frames of sequences as their meshes.

    import pyvista

    sequence = meshreel.from_pyvista([pyvista.read(path) for path in paths], fps=25)
    meshreel.to_pyvista(sequence, frame=3).plot()

Both libraries are optional. PyVista's meshes pass through VTK files, so that polygons and arrays of
points and cells are stored as in those formats.
"""

from collections.abc import Iterable
from importlib import import_module
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

import numpy as np

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.model.sequence import MeshSequence, concatenate
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.model.tracks import Track, TrackKind
from meshreel.operations.save import save


def from_pyvista(meshes: Iterable[Any], fps: float = 0.0) -> MeshSequence:
    """Return the sequence of one PyVista mesh per frame, with their arrays.

    Parameters
    ----------
    meshes : iterable of pyvista.PolyData or pyvista.UnstructuredGrid
        Arrays that change from frame to frame become tracks.
    fps : float, default 0
        Frames per second; 0 if unknown.

    Raises
    ------
    FormatError, InvalidInputError
        If there is no mesh, or one without faces.
    """
    with TemporaryDirectory(prefix="meshreel-") as folder:
        for number, mesh in enumerate(meshes):
            extension = "vtp" if type(mesh).__name__ == "PolyData" else "vtu"
            mesh.save(Path(folder) / f"frame_{number:06}.{extension}")
        sequence = load(folder, fps=fps or None)
        return sequence.replace(name="")


def to_pyvista(sequence: MeshSequence, frame: int = 0) -> Any:
    """Return a frame as `pyvista.PolyData`, with polygons, attributes and values of tracks.

    Raises
    ------
    InvalidInputError
        If PyVista is not installed.
    IndexError
        If there is no such frame.
    """
    pyvista = _import("pyvista")
    with TemporaryDirectory(prefix="meshreel-") as folder:
        [path] = save(_frame_sequence(sequence, frame), Path(folder) / "frame.vtp")
        return pyvista.read(path)


def from_trimesh(meshes: Iterable[Any], fps: float = 0.0) -> MeshSequence:
    """Return the sequence of one `trimesh.Trimesh` per frame, with colors of vertices.

    Parameters
    ----------
    meshes : iterable of trimesh.Trimesh
        Consecutive meshes with equal faces become a segment. Colors that change become a track.
        Texture coordinates, materials and other attributes are not kept.
    fps : float, default 0
        Frames per second; 0 if unknown.

    Raises
    ------
    InvalidInputError
        If there is no mesh, or one without faces.
    """

    def run_key(mesh: Any) -> tuple[Any, ...]:
        return len(mesh.vertices), mesh.faces.tobytes(), mesh.visual.kind == "vertex"

    segments = []
    for (_, _, has_colors), run in groupby(meshes, run_key):
        meshes_of_run = list(run)
        vertices = np.stack([np.asarray(mesh.vertices) for mesh in meshes_of_run])
        surface, tracks = Surface(), {}
        if has_colors:
            colors = np.stack([np.asarray(mesh.visual.vertex_colors) for mesh in meshes_of_run])
            if (colors == colors[0]).all():
                color = Attribute("color", Kind.COLOR, Domain.VERTEX, colors[0])
                surface = Surface(attributes=(color,))
            else:
                tracks = {"color": Track(colors, Domain.VERTEX, TrackKind.COLOR)}
        faces = np.asarray(meshes_of_run[0].faces)
        segments.append(MeshSequence(vertices, faces, fps, surface=surface, tracks=tracks))
    return concatenate(segments)


def to_trimesh(sequence: MeshSequence, frame: int = 0) -> Any:
    """Return a frame as `trimesh.Trimesh`, with colors of vertices; nothing is merged.

    Raises
    ------
    InvalidInputError
        If trimesh is not installed.
    IndexError
        If there is no such frame.
    """
    trimesh = _import("trimesh")
    [segment] = _frame_sequence(sequence, frame).segments
    colors = segment.surface.of_kind(Kind.COLOR)
    vertex_colors = [color.per_item() for color in colors if color.domain is Domain.VERTEX]
    return trimesh.Trimesh(
        np.asarray(segment.read(0, 1)[0]),
        np.asarray(segment.faces),
        process=False,
        vertex_colors=vertex_colors[0] if vertex_colors else None,
    )


def _frame_sequence(sequence: MeshSequence, frame: int) -> MeshSequence:
    """Return a frame as a sequence; negative numbers count from the end, as those of lists."""
    number = range(sequence.n_frames)[frame]
    return sequence[number : number + 1]


def _import(name: str) -> ModuleType:
    try:
        return import_module(name)
    except ImportError as error:
        raise InvalidInputError(f"this needs {name} ({error}): pip install {name}") from error
