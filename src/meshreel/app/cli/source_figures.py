"""Contents of a file of any format, as text for tables."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from meshreel.app.cli.figures import fps_text, mesh_text, surface_rows
from meshreel.runtime.counting import counted, size_text

if TYPE_CHECKING:
    from meshreel.app.cli.console import Cell
    from meshreel.formats.animations import AnimationInfo
    from meshreel.formats.inspection import MeshInfo, SourceInfo

HEADINGS = ("mesh", "frames", "vertices", "faces", "fps", "box")
MAX_MESHES = 100
"""Maximum number of meshes in the table."""


def source_rows(source: "SourceInfo") -> "dict[str, Cell]":
    """Format and size, then the figures of a single mesh or the number of meshes."""
    files = f" in {counted(source.n_files, 'file')}" if source.n_files > 1 else ""
    rows: dict[str, Cell] = {
        "format": source.format,
        "size": f"{size_text(source.size_bytes)}{files}",
    }
    if len(source.meshes) == 1:
        rows |= _mesh_rows(source.meshes[0])
    else:
        rows["meshes"] = str(len(source.meshes))
        if problems := [mesh for mesh in source.meshes if mesh.problem]:
            rows["problems"] = [f"{mesh.name}: {mesh.problem}" for mesh in problems]
    if source.animations:
        rows["animations"] = [_animation_text(animation) for animation in source.animations]
    if source.left_out:
        rows["left out"] = list(source.left_out)
    return rows


def _animation_text(animation: "AnimationInfo") -> str:
    if animation.problem:
        return f"{animation.name}: cannot be read: {animation.problem}"
    remark = "" if animation.moves_mesh else ", moves no mesh"
    return f"{animation.name}: {animation.duration_s:.4g} s{remark}"


def mesh_columns(source: "SourceInfo") -> list[Sequence[str]]:
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
        for mesh in source.meshes[:MAX_MESHES]
    ]
    if (more := len(source.meshes) - MAX_MESHES) > 0:
        rows.append((f"and {more} more (--json lists all)", "", "", "", "", ""))
    return rows


def _mesh_rows(mesh: "MeshInfo") -> "dict[str, Cell]":
    rows: dict[str, Cell] = {
        "name": mesh.name or "-",
        "sequence": mesh_text(mesh, mesh.n_segments, mesh.n_meshes),
        "raw": size_text(mesh.raw_size_bytes),
        "frame rate": fps_text(mesh.fps),
        "duration": f"{mesh.duration_s:.4g} s" if mesh.duration_s else "unknown",
        "positions": mesh.vertex_type,
    }
    rows |= surface_rows(mesh)
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
