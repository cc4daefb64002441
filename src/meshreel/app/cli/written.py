"""Figures of the files that a command wrote, as tables or JSON."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from meshreel.app.cli.console import (
    print_columns,
    print_json,
    print_notes,
    print_table,
    shown_progress,
)
from meshreel.app.cli.options import source_of
from meshreel.app.figures import PART_HEADINGS, encoded_rows, media_rows, part_table, uv_rows
from meshreel.formats.registry import FRAME_FORMATS
from meshreel.runtime.counting import counted, counts_text, size_text

if TYPE_CHECKING:
    from meshreel.formats.options import Reading
    from meshreel.operations.convert import Result, Target, Written

PARTS = "parts, positions in percent of the diagonal and in model units (u)"

MAX_COMPACT_SHARE = 0.7
"""Files below this share of the raw values describe motion by a skin, or compress it."""


def convert_and_print(
    inputs: Sequence[str], target: "Target", reading: "Reading", *, as_json: bool, **choices: Any
) -> None:
    """Convert the input of a command with progress, and print the result.

    Parameters
    ----------
    **choices
        As in `meshreel.operations.convert.convert`.
    """
    from meshreel.operations.convert import convert

    with shown_progress() as progress:
        reading = replace(reading, progress=progress)
        result = convert(source_of(inputs), target, reading, **choices)
    print_result(result, reading.notes, is_split=choices.get("splits", False), as_json=as_json)


def print_result(
    result: "Result", notes: Sequence[str], *, is_split: bool = False, as_json: bool
) -> None:
    """Print notes, and the figures of all outputs; as JSON those of one unless split."""
    print_notes(notes)
    if as_json:
        capture = {} if result.report is None else result.report.figures()
        if result.registered is not None and (job := result.registered.job) is not None:
            capture["texture"] = {"output": str(job.output), "size_px": list(job.size)}
        outputs = [written.as_dict() for written in result.files]
        figures: dict[str, Any] = {"outputs": outputs} if is_split else outputs[0]
        print_json({**figures, **capture, "is_whole": result.is_whole, "notes": notes})
        return
    for written in result.files:
        _print_files(written) if written.encoded is None else _print_stream(written)
    if rows := _capture_rows(result):
        print_table("relative to the raw capture", rows)


def _print_stream(written: "Written") -> None:
    """Print a table of figures, and the bound, largest error and bytes of each part."""
    encoded = written.encoded
    assert encoded is not None
    stream, size = encoded.stream, written.input_bytes
    rows = encoded_rows(stream, encoded.achieved, encoded.n_meshes, size) | uv_rows(encoded.uv)
    if size and size < MAX_COMPACT_SHARE * stream.raw_size_bytes:
        rows["input"] = "compact already: smaller than the raw values of all frames"
    print_table(str(written.paths[0]), rows)
    print_columns(PARTS, PART_HEADINGS, part_table(encoded.achieved, stream, encoded.origins))


def _print_files(written: "Written") -> None:
    """Print the number and the size of files, and the errors of a rig."""
    figures = written.as_dict()
    first, last = written.paths[0], written.paths[-1]
    title = str(first) if first == last else f"{first} to {last.name}"
    if last.parent != first.parent:
        noun = "frames" if last.suffix in FRAME_FORMATS else "images"
        title = f"{first}, {noun} in {last.parent.name}"
    rows = {
        "sequence": counts_text(
            frame=figures["n_frames"], vertex=figures["n_verts"], face=figures["n_faces"]
        ),
        "files": str(len(written.paths)),
        "size": size_text(figures["size_bytes"]),
    }
    if rig := figures.get("rig"):
        bones, targets = rig["n_bones"], rig["n_targets"]
        rows |= {
            "rig": f"{counted(bones, 'bone')}, {counted(targets, 'corrective target')}",
            "KG error": f"{rig['kg_percent']:.3g} %",
            "largest error": f"{rig['largest_percent']:.3g} % of the diagonal",
            "normal error": f"{rig['normal_deg']:.2g} degrees (mean, of faces)",
        }
        sizes = figures.get("sizes_bytes", {}).items()
        rows |= {f"  {name}": size_text(size) for name, size in sizes}
    print_table(title, rows)


def _capture_rows(result: "Result") -> dict[str, str]:
    """Return the distances from a raw capture, and its textures, as rows of a table."""
    written = result.files[0]
    encoded_bytes = written.encoded.stream.size_bytes if written.encoded else written.size_bytes
    rows = {} if result.report is None else result.report.rows(encoded_bytes)
    if result.registered is not None and (job := result.registered.job) is not None:
        width, height = job.size
        rows["textures"] = f"{job.output}, {width} x {height} texels"
        if job.output == written.paths[0]:
            from meshreel.formats.reel import read_info

            rows |= media_rows(read_info(job.output))
    return rows
