"""`meshreel compare`: errors of a decoded animation relative to its original."""

from pathlib import Path
from typing import TYPE_CHECKING

from meshreel.app.cli.commands import command
from meshreel.app.cli.completing import input_files
from meshreel.app.cli.parameters import argument, option
from meshreel.app.cli.read_options import MESHES, reading_options
from meshreel.codec.option import Range

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
    "--surface",
    is_flag=True,
    help="Measure distances between the surfaces also if the faces are the same.",
)
@option(
    "--samples",
    "n_samples",
    type=int,
    range=Range(1, is_whole=True),
    metavar="N",
    help="Points on each surface of a frame from which distances are measured [default: 50000].",
)
@option(
    "--plot",
    type=Path,
    metavar="FILE.png",
    help="Draw the error of each frame: NMSVE, or mean distance of surfaces (needs [plot]).",
)
@option("--force", "-f", is_flag=True, help="Replace the plot if it exists.")
@option("as_json", "--json", is_flag=True, help="Print the figures as JSON.")
def compare_command(
    original: str,
    decoded: str,
    reading: "ReadOptions",
    surface: bool,
    n_samples: int | None,
    plot: Path | None,
    force: bool,
    as_json: bool,
) -> None:
    """Measure the error of a decoded animation relative to its original.

    If the vertex counts or the faces differ, the distances between the surfaces are measured.
    Vertices of a stream without its order (--order drop) are matched with those of the original.

    Examples:

    - `meshreel compare walk.npz walk.reel`

    - `meshreel compare shot.abc body.reel --object /root/body`

    - `meshreel compare frames/ decoded.npz --plot nmsve.png --json`

    - `meshreel compare scan.abc remeshed.abc --surface --samples 200000`
    """
    from dataclasses import replace

    from meshreel.app.cli.console import print_json, print_notes, print_table, progress_bar
    from meshreel.app.cli.figures import distance_rows, quality_rows
    from meshreel.codec.dropped_order import MATCHED, match_order
    from meshreel.formats.load import load_any
    from meshreel.formats.needed_extras import extras_to_read
    from meshreel.formats.options import ReadOptions
    from meshreel.formats.sources import files_of_source
    from meshreel.formats.supported_options import check_supported, supported_only
    from meshreel.metrics.alignment import find_alignment
    from meshreel.metrics.compare import Quality, measure_quality
    from meshreel.model.sequence import single_segment
    from meshreel.rendering.plots import plot_error_per_frame
    from meshreel.runtime.extras import PLOT, require
    from meshreel.runtime.outputs.checks import check_extension, check_output_path
    from meshreel.runtime.stores.address import is_remote

    local = [source for source in (original, decoded) if not is_remote(source)]
    files = [file for source in local for file in files_of_source(source)]
    if plot is not None:
        check_extension(plot, (".png",))
        check_output_path(plot, overwrite=force, inputs=files)
    require([*extras_to_read(files), *([PLOT] if plot is not None else [])])
    check_supported([original, decoded], replace(reading, animation=None))
    check_supported([original], ReadOptions(animation=reading.animation))
    notes = reading.notes
    with progress_bar() as progress:
        reading = replace(reading, progress=progress)
        first = load_any(original, supported_only(reading, original))
        second = load_any(decoded, supported_only(replace(reading, animation=None), decoded))
        first, second, is_matched = match_order(first, second)
        if is_matched:
            notes.append(MATCHED)
        quality = measure_quality(
            first, second, surface=surface or None, n_samples=n_samples, progress=progress
        )
        if isinstance(quality, Quality):
            purpose = "alignment"
            errors, label = quality.nmsve, "NMSVE (positions in diagonals)"
            if alignment := find_alignment(
                *(single_segment(one, purpose) for one in (first, second))
            ):
                notes.append(str(alignment))
        else:
            errors, label = quality.mean_percent_of_frames, "mean distance (% of the diagonal)"
        if plot is not None:
            title = f"{Path(decoded).name} against {Path(original).name}"
            plot_error_per_frame(plot, title, errors, label=label, fps=first.fps, overwrite=force)
    print_notes(notes)
    if as_json:
        figures = {"original": original, "decoded": decoded, **quality.as_dict()}
        print_json({**figures, "notes": notes})
        return
    rows = quality_rows(quality) if isinstance(quality, Quality) else distance_rows(quality)
    print_table(f"{decoded} against {original}", rows)
