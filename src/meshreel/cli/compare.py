"""`meshreel compare`: errors of a decoded animation relative to its original."""

from pathlib import Path

from meshreel.cli.commands import command
from meshreel.cli.completing import input_files
from meshreel.cli.parameters import argument, option
from meshreel.cli.read_options import (
    allow_outside_option,
    animation_option,
    memory_option,
    merge_option,
    object_option,
    skip_bad_option,
)


@command
@argument(
    "original",
    completion=input_files,
    help="A file that holds an animation (see `meshreel formats`), a frame file, a folder "
    "or a quoted glob.",
)
@argument("decoded", completion=input_files, help="The same kinds.")
@object_option
@merge_option
@skip_bad_option
@allow_outside_option
@animation_option
@memory_option
@option(
    "--plot", type=Path, metavar="FILE.png", help="Draw the NMSVE of each frame (needs [plot])."
)
@option("--force", "-f", is_flag=True, help="Replace the plot if it exists.")
@option("as_json", "--json", is_flag=True, help="Print the figures as JSON.")
def compare_command(
    original: str,
    decoded: str,
    object: str | None,
    merge: bool,
    skip_bad: bool,
    allow_outside: bool,
    animation: str | None,
    memory: str | None,
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
    from meshreel.cli.console import print_json, print_notes, print_table, progress_bar
    from meshreel.cli.figures import quality_rows
    from meshreel.formats.load import load
    from meshreel.formats.registry import holds_meshes
    from meshreel.formats.sources import files_of_source
    from meshreel.formats.supported_options import check_supported, supports
    from meshreel.metrics.alignment import find_alignment
    from meshreel.metrics.compare import compare
    from meshreel.rendering.plots import plot_error_per_frame, require_matplotlib
    from meshreel.runtime.outputs.checks import check_ending, check_output_path

    if plot is not None:
        check_ending(plot, (".png",))
        files = [file for given in (original, decoded) for file in files_of_source(given)]
        check_output_path(plot, overwrite=force, inputs=files)
        require_matplotlib()
    check_supported([original, decoded], skip_bad=skip_bad, allow_outside=allow_outside)
    check_supported(
        [original], skip_bad=False, allow_outside=False, animation=animation is not None
    )
    notes: list[str] = []
    with progress_bar() as progress:
        first, second = (
            load(
                source,
                object=object if holds_meshes(source) else None,
                merge=merge,
                skip_bad=skip_bad and supports(source, "skip_bad"),
                allow_outside=allow_outside and supports(source, "allow_outside"),
                animation=animation if source is original else None,
                memory=memory,
                progress=progress,
                notes=notes,
            )
            for source in (original, decoded)
        )
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
