"""`meshreel render`: pictures and films of an animation."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import print_figures, shown_progress
from meshreel.app.cli.options import MESHES, LookOption, frame_list, reading
from meshreel.app.cli.parameters import Argument, File, ForceOption, JsonOption
from meshreel.codec.option import Option
from meshreel.formats.options import Reading
from meshreel.runtime.counting import counted, size_text


@command
def render_command(
    source: Annotated[
        str,
        Argument(
            "FILE",
            "A .reel or another animation file (see `meshreel formats`), or a folder or a quoted "
            "glob of frames.",
        ),
    ],
    output: Annotated[Path, Option("A picture (.png) or a film (.mp4, .gif).", flag="--output -o")],
    reading: Annotated[Reading, reading("fps", *MESHES, "displace", "memory")],
    look: LookOption,
    original: Annotated[
        File | None, Option("The original of FILE, shown alongside.", metavar="INPUT")
    ] = None,
    frames: Annotated[
        str | None,
        Option(
            "Only frames A to B - 1, or the listed ones. A picture shows 8 frames of a range, 3 "
            "with an original, evenly spaced.",
            metavar="A:B|N,N,...",
        ),
    ] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Draw an animation into a picture or a film.

    A .png shows frames side by side with their numbers and times, or a single frame. With
    --original, each frame has a row: original, decoded and, with --heatmap, the error. --track
    colors the mesh by one of its tracks. The faces may change.

    Pictures and .gif need the extra [render], .mp4 needs [video].

    Examples:

    - `meshreel render walk.reel -o walk.png`
    - `meshreel render walk.reel -o pose.png --frames 17 --view front --size 1920x1080`
    - `meshreel render walk.reel -o lost.png --original walk.npz --heatmap distance`
    - `meshreel render walk.reel -o walk.mp4 --original walk.npz --heatmap angle`
    - `meshreel render crash.reel -o stress.png --track stress --range 0:500`
    - `meshreel render block.reel -o inside.png --track temperature --cut y=50%`
    """
    from meshreel.operations.render import render

    with shown_progress() as progress:
        figures = render(
            source,
            output,
            look,
            replace(reading, progress=progress),
            original=original,
            frames=frame_list(frames),
            overwrite=force,
        )
    width, height = figures["size_px"]
    rows = {"picture": f"{width} x {height} pixels"}
    if "fps" in figures:
        seconds = figures["n_pictures"] / figures["fps"]
        rows["film"] = (
            f"{counted(figures['n_pictures'], 'picture')} at {figures['fps']:g} fps, "
            f"{seconds:.1f} s"
        )
    else:
        rows["frames"] = ", ".join(map(str, figures["frames"]))
    rows["size"] = size_text(figures["size_bytes"])
    print_figures(figures["output"], rows, figures, reading.notes, as_json=as_json)
