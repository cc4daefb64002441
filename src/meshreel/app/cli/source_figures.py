"""Contents of a file of any format, as text for tables."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from meshreel.app.cli.figures import carried_rows, fps_text, mesh_text
from meshreel.runtime.counting import counted, size_text

if TYPE_CHECKING:
    from meshreel.app.cli.console import Cell
    from meshreel.formats.animations import AnimationInfo
    from meshreel.formats.inspection import MeshInfo, SourceInfo

HEADINGS = ("mesh", "frames", "vertices", "faces", "fps", "box")
MOST_MESHES = 100
"""Largest number of rows of the table of meshes."""


def source_rows(found: "SourceInfo") -> "dict[str, Cell]":
    """Rows on format and size, and on a single mesh, or the number of several."""
    files = f" in {counted(found.n_files, 'file')}" if found.n_files > 1 else ""
    rows: dict[str, Cell] = {
        "format": found.format,
        "size": f"{size_text(found.size_bytes)}{files}",
    }
    if len(found.meshes) == 1:
        rows |= _mesh_rows(found.meshes[0])
    else:
        rows["meshes"] = str(len(found.meshes))
        if problems := [mesh for mesh in found.meshes if mesh.problem]:
            rows["problems"] = [f"{mesh.name}: {mesh.problem}" for mesh in problems]
    if found.animations:
        rows["animations"] = [_animation_text(one) for one in found.animations]
    if found.left_out:
        rows["left out"] = list(found.left_out)
    return rows


def _animation_text(one: "AnimationInfo") -> str:
    if one.problem:
        return f"{one.name}: cannot be read: {one.problem}"
    still = "" if one.moves_mesh else ", moves no mesh"
    return f"{one.name}: {one.duration_s:.4g} s{still}"


def mesh_columns(found: "SourceInfo") -> list[Sequence[str]]:
    """Rows of the table of meshes, with columns as in `HEADINGS`."""
    rows: list[Sequence[str]] = [
        (
            mesh.name,
            str(mesh.n_frames),
            str(mesh.n_verts),
            str(mesh.n_polygons),
            f"{mesh.fps:g}" if mesh.fps else "-",
            _sides_text(mesh),
        )
        for mesh in found.meshes[:MOST_MESHES]
    ]
    if (more := len(found.meshes) - MOST_MESHES) > 0:
        rows.append((f"and {more} more (--json has all)", "", "", "", "", ""))
    return rows


def _mesh_rows(mesh: "MeshInfo") -> "dict[str, Cell]":
    rows: dict[str, Cell] = {
        "name": mesh.name or "-",
        "sequence": mesh_text(mesh),
        "raw": size_text(mesh.raw_size_bytes),
        "frame rate": fps_text(mesh.fps),
        "duration": f"{mesh.duration_s:.4g} s" if mesh.duration_s else "unknown",
        "positions": mesh.vertex_type,
    }
    rows |= carried_rows(mesh)
    if mesh.tracks:
        rows["tracks"] = list(mesh.tracks)
    if mesh.low is not None and mesh.high is not None:
        spans = zip("xyz", mesh.low, mesh.high, strict=True)
        rows["box"] = [f"{axis} {low:.5g} to {high:.5g}" for axis, low, high in spans]
    if mesh.problem:
        rows["problem"] = mesh.problem
    return rows


def _sides_text(mesh: "MeshInfo") -> str:
    if mesh.low is None or mesh.high is None:
        return "-"
    sides = (high - low for low, high in zip(mesh.low, mesh.high, strict=True))
    return " x ".join(f"{side:.3g}" for side in sides)
