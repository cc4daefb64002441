"""`meshreel compare`: errors of a decoded animation relative to its original."""

from dataclasses import replace
from typing import Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import print_figures, shown_progress
from meshreel.app.cli.options import MESHES, FramesOption, frame_slice, reading
from meshreel.app.cli.parameters import Argument, JsonOption
from meshreel.app.figures import distance_rows, quality_rows
from meshreel.codec.option import COUNT, Option
from meshreel.formats.options import Reading


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
    reading: Annotated[Reading, reading(*MESHES, "memory")],
    frames: FramesOption = None,
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
    with those of the original. With --frames, percentages are of the box of these frames.

    Examples:

    - `meshreel compare walk.npz walk.reel`
    - `meshreel compare shot.abc body.reel --object /root/body`
    - `meshreel compare frames/ decoded.npz --frames 100:200 --json`
    - `meshreel compare scan.abc remeshed.abc --surface --samples 200000`
    - `meshreel compare walk.npz - < walk.reel`
    """
    from meshreel.metrics.compare import Quality
    from meshreel.operations.compare import compare

    with shown_progress() as progress:
        quality = compare(
            original,
            decoded,
            replace(reading, progress=progress),
            reading.notes,
            frames=frame_slice(frames),
            surface=surface or None,
            n_samples=samples,
        )
    rows = quality_rows(quality) if isinstance(quality, Quality) else distance_rows(quality)
    figures = {"original": original, "decoded": decoded, **quality.as_dict()}
    title = f"{decoded} against {original}"
    print_figures(title, rows, figures, reading.notes, as_json=as_json)
