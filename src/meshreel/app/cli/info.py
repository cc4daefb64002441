"""`meshreel info`: show the contents of a file."""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import (
    print_columns,
    print_json,
    print_notes,
    print_table,
    shown_progress,
)
from meshreel.app.cli.options import MESHES, SegmentOption, is_stream_file, reading, source_of
from meshreel.app.cli.parameters import Argument, JsonOption
from meshreel.app.figures import (
    SECTION_HEADINGS,
    SEGMENT_HEADINGS,
    info_rows,
    mesh_text,
    section_table,
    segment_table,
    surface_rows,
    timing_rows,
)
from meshreel.formats.options import Reading
from meshreel.runtime.counting import counted, size_text
from meshreel.runtime.stores.address import STANDARD_INPUT

if TYPE_CHECKING:
    from meshreel.app.figures import Cell
    from meshreel.formats.inspection import MeshInfo, SourceInfo


HEADINGS = ("mesh", "frames", "vertices", "faces", "fps", "box")
MAX_MESHES = 100
"""Maximum number of meshes in the table."""


@command
def info_command(
    inputs: Annotated[
        tuple[str, ...],
        Argument(
            "FILE...",
            "A .reel or another animation file (see `meshreel formats`), a folder or a quoted glob "
            "of frames, or the frame files. Or an address (s3://, gs://, https://); of a .reel "
            "only its index and section headers are downloaded.",
        ),
    ],
    reading: Annotated[Reading, reading("fps", *MESHES, "topology", "dataset", "memory")],
    segment: SegmentOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show the contents of a file: meshes, frames, bounding boxes, and contents that are ignored.

    For a .reel: header, segments, and bytes by section.

    Examples:

    - `meshreel info walk.reel`
    - `meshreel info shot.abc`
    - `meshreel info frames/ --json`
    - `meshreel info - < walk.reel`
    """
    if len(inputs) == 1 and is_stream_file(inputs[0]):
        if replace(reading, memory=None) != Reading():
            raise click.UsageError("input options do not apply to a .reel; omit them")
        _show_stream(inputs[0], segment, reading.memory, as_json=as_json)
        return
    if segment is not None:
        raise click.UsageError("--segment applies to a .reel only; omit it")
    _show_source(source_of(inputs), reading, as_json=as_json)


def _show_stream(
    path: str, segment: int | None, memory: float | str | None, *, as_json: bool
) -> None:
    from meshreel.codec.inspect import info as describe
    from meshreel.formats.reel import read_info

    if path == STANDARD_INPUT:
        stream = describe(sys.stdin.buffer.read(), segment)
    else:
        stream = read_info(path, segment, memory)
    if as_json:
        print_json(stream.as_dict())
        return
    print_table(path, info_rows(stream))
    if len(stream.segments) > 1:
        print_columns("segments", SEGMENT_HEADINGS, segment_table(stream))
        click.echo("decode all, or select one with --segment")
    print_columns("sections", SECTION_HEADINGS, section_table(stream))


def _show_source(
    source: "str | list[Path] | list[str]", reading: Reading, *, as_json: bool
) -> None:
    from meshreel.formats.inspection import inspect_source
    from meshreel.model.notes import NoteKind

    title = source if isinstance(source, str) else f"{source[0]} to {Path(source[-1]).name}"
    with shown_progress() as progress:
        info = inspect_source(source, replace(reading, progress=progress))
    print_notes([note for note in info.notes if as_json or note.kind is not NoteKind.LEFT_OUT])
    if as_json:
        print_json({"input": title, **info.as_dict()})
        return
    print_table(title, source_rows(info))
    if len(info.meshes) > 1:
        print_columns("meshes", HEADINGS, mesh_table(info))
        click.echo("select one with --object, or read all as one with --merge")


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
        rows["animations"] = [
            f"{animation.name}: cannot be read: {animation.problem}"
            if animation.problem
            else f"{animation.name}: {animation.duration_s:.4g} s"
            + ("" if animation.moves_mesh else ", moves no mesh")
            for animation in source.animations
        ]
    if source.left_out:
        rows["left out"] = list(source.left_out)
    return rows


def mesh_table(source: "SourceInfo") -> list[Sequence[str]]:
    """Rows of the table of meshes, below `HEADINGS`."""
    rows: list[Sequence[str]] = []
    for mesh in source.meshes[:MAX_MESHES]:
        box = "-"
        if mesh.low is not None and mesh.high is not None:
            sides = (high - low for low, high in zip(mesh.low, mesh.high, strict=True))
            box = " x ".join(f"{side:.3g}" for side in sides)
        counts = (str(count) for count in (mesh.n_frames, mesh.n_verts, mesh.n_polygons))
        rows.append((mesh.name, *counts, f"{mesh.fps:g}" if mesh.fps else "-", box))
    if (n_more := len(source.meshes) - MAX_MESHES) > 0:
        rows.append((f"and {n_more} more (--json lists all)", "", "", "", "", ""))
    return rows


def _mesh_rows(mesh: "MeshInfo") -> "dict[str, Cell]":
    rows: dict[str, Cell] = {
        "name": mesh.name or "-",
        "sequence": mesh_text(mesh, mesh.n_segments, mesh.n_meshes),
        "raw": size_text(mesh.raw_size_bytes),
        **timing_rows(mesh),
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
