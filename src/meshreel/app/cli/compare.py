"""`meshreel compare`: errors of a decoded animation relative to its original."""

from typing import TYPE_CHECKING, Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import Argument, JsonOption
from meshreel.app.cli.read_options import MESHES, reading
from meshreel.codec.option import COUNT, Option

if TYPE_CHECKING:
    from meshreel.formats.options import ReadOptions

MAX_CODING_PERCENT = 10.0
"""Larger differences, in percent of the diagonal, are not coding errors."""


@command
def compare_command(
    original: Annotated[
        str,
        Argument(
            "ORIGINAL",
            "A file that holds an animation (see `meshreel formats`), a frame file, a folder or a "
            "quoted glob.",
        ),
    ],
    decoded: Annotated[str, Argument("DECODED", "A file or frames, as above.")],
    reading: Annotated["ReadOptions", reading(*MESHES, "memory")],
    surface: Annotated[
        bool, Option("Measure distances between the surfaces also if the faces are the same.")
    ] = False,
    samples: Annotated[
        int | None,
        Option(
            "Points on each surface of a frame from which distances are measured.",
            default_text="50000",
            range=COUNT,
            metavar="N",
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the error of a decoded animation relative to its original.

    If the vertex counts or the faces differ, the distances between the surfaces are measured.
    Vertices of a stream without its order (--order drop), and of a compressed .glb, are matched
    with those of the original.

    Examples:

    - `meshreel compare walk.npz walk.reel`
    - `meshreel compare shot.abc body.reel --object /root/body`
    - `meshreel compare frames/ decoded.npz --json`
    - `meshreel compare scan.abc remeshed.abc --surface --samples 200000`
    - `meshreel compare walk.npz - < walk.reel`
    """
    from dataclasses import replace

    from meshreel.app.cli.console import print_json, print_notes, print_table, shown_progress
    from meshreel.app.figures import distance_rows, quality_rows
    from meshreel.codec.dropped_order import MATCHED, match_order
    from meshreel.formats.load import load_any
    from meshreel.formats.needed_extras import extras_to_read
    from meshreel.formats.options import ReadOptions
    from meshreel.formats.sources import files_of_source
    from meshreel.formats.supported_options import check_supported, supported_only
    from meshreel.metrics.compare import Quality, measure_quality
    from meshreel.runtime.extras import require
    from meshreel.runtime.stores.address import is_remote

    local = [source for source in (original, decoded) if not is_remote(source)]
    files = [file for source in local for file in files_of_source(source)]
    require(extras_to_read(files))
    check_supported([original, decoded], replace(reading, animation=None))
    check_supported([original], ReadOptions(animation=reading.animation))
    notes = reading.notes
    with shown_progress() as progress:
        reading = replace(reading, progress=progress)
        first = load_any(original, supported_only(reading, original))
        second = load_any(decoded, supported_only(replace(reading, animation=None), decoded))
        first, second, is_matched = match_order(first, second)
        if is_matched:
            notes.changed(MATCHED)
        quality = measure_quality(
            first, second, surface=surface or None, n_samples=samples, progress=progress
        )
        if isinstance(quality, Quality) and quality.max_error_percent > MAX_CODING_PERCENT:
            notes.result(
                f"vertices differ by up to {quality.max_error_percent:.3g} % of the diagonal, more "
                "than coding explains; check that axes (y-up, z-up), unit and position are equal"
            )
    print_notes(notes)
    if as_json:
        figures = {"original": original, "decoded": decoded, **quality.as_dict()}
        print_json({**figures, "notes": notes})
        return
    rows = quality_rows(quality) if isinstance(quality, Quality) else distance_rows(quality)
    print_table(f"{decoded} against {original}", rows)
