"""`meshreel compare`: errors of a decoded animation relative to its original."""

from pathlib import Path
from typing import TYPE_CHECKING

from meshreel.app.cli.commands import command
from meshreel.app.cli.completing import input_files
from meshreel.app.cli.parameters import argument, option
from meshreel.app.cli.read_options import MESHES, reading_options

if TYPE_CHECKING:
    from meshreel.formats.options import ReadOptions


@command
@argument(
    "original",
    completion=input_files,
    help="A file that holds an animation (see `meshreel formats`), a frame file, a folder "
    "or a quoted glob.",
)
@argument("decoded", completion=input_files, help="A file or frames, as above.")
@reading_options(*MESHES, "memory")
@option(
    "--plot", type=Path, metavar="FILE.png", help="Draw the NMSVE of each frame (needs [plot])."
)
@option("--force", "-f", is_flag=True, help="Replace the plot if it exists.")
@option("as_json", "--json", is_flag=True, help="Print the figures as JSON.")
def compare_command(
    original: str,
    decoded: str,
    reading: "ReadOptions",
    plot: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Measure the error of a decoded animation relative to its original.

    Examples:

    - `meshreel compare walk.npz walk.reel`

    - `meshreel compare shot.abc body.reel --object /root/body`

    - `meshreel compare frames/ decoded.npz --plot nmsve.png --json`
    """
    from dataclasses import replace

    from meshreel.app.cli.console import print_json, print_notes, print_table, progress_bar
    from meshreel.app.cli.figures import quality_rows
    from meshreel.formats.load import load_with
    from meshreel.formats.options import ReadOptions
    from meshreel.formats.sources import files_of_source
    from meshreel.formats.supported_options import check_supported, supported_only
    from meshreel.metrics.alignment import find_alignment
    from meshreel.metrics.compare import compare
    from meshreel.rendering.plots import plot_error_per_frame, require_matplotlib
    from meshreel.runtime.outputs.checks import check_extension, check_output_path

    if plot is not None:
        check_extension(plot, (".png",))
        files = [file for source in (original, decoded) for file in files_of_source(source)]
        check_output_path(plot, overwrite=force, inputs=files)
        require_matplotlib()
    check_supported([original, decoded], replace(reading, animation=None))
    check_supported([original], ReadOptions(animation=reading.animation))
    notes = reading.notes
    with progress_bar() as progress:
        reading = replace(reading, progress=progress)
        first = load_with(original, supported_only(reading, original))
        second = load_with(decoded, supported_only(replace(reading, animation=None), decoded))
        quality = compare(first, second, progress=progress)
        if alignment := find_alignment(first, second):
            notes.append(str(alignment))
        if plot is not None:
            title = f"{Path(decoded).name} against {Path(original).name}"
            plot_error_per_frame(plot, title, quality.nmsve, fps=first.fps, overwrite=force)
    print_notes(notes)
    if as_json:
        figures = {"original": original, "decoded": decoded, **quality.as_dict()}
        print_json({**figures, "notes": notes})
        return
    print_table(f"{decoded} against {original}", quality_rows(quality))
