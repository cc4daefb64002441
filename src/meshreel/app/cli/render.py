"""`meshreel render`: pictures and films of an animation."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import Argument, File, ForceOption, JsonOption
from meshreel.app.cli.read_options import MESHES, reading
from meshreel.app.cli.track_options import COLORS, ColormapOption, ComponentOption, RangeOption
from meshreel.codec.option import Option
from meshreel.runtime.counting import counted

if TYPE_CHECKING:
    from meshreel.formats.options import Reading

LOOK = "Look"


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
    reading: Annotated["Reading", reading("fps", *MESHES, "displace", "memory")],
    original: Annotated[
        File | None, Option("The original of FILE, shown alongside.", metavar="INPUT")
    ] = None,
    heatmap: Annotated[
        Literal["distance", "angle", "sted", "track"] | None,
        Option(
            "Color the decoded mesh by its error: vertex distance, angle between normals, local "
            "STED, or error of --track in its unit. If the meshes differ, distance is that to the "
            "surface of the original."
        ),
    ] = None,
    track: Annotated[
        str | None,
        Option(
            "Color the mesh by a track, such as stress, with a color bar; color tracks are shown "
            "directly.",
            metavar="NAME",
            group=COLORS,
        ),
    ] = None,
    component: ComponentOption = None,
    range: RangeOption = None,
    colormap: ColormapOption = None,
    cut: Annotated[
        str | None,
        Option(
            "Hide the cells of a volume mesh beyond a plane, so that the inside is visible: x=40% "
            "of the box, x=0.2 in model units, x for the middle; -x keeps the other side. The "
            "first frame decides which cells.",
            metavar="AXIS[=POSITION]",
            group=LOOK,
        ),
    ] = None,
    frames: Annotated[
        str | None,
        Option(
            "Only frames A to B - 1, or the listed ones. A picture shows 8 frames of a range, 3 "
            "with an original, evenly spaced.",
            metavar="A:B|N,N,...",
        ),
    ] = None,
    view: Annotated[
        str,
        Option(
            "View direction: front, side, top, or degrees to the right and up.",
            metavar="AZ,EL",
            group=LOOK,
        ),
    ] = "30,12",
    up: Annotated[
        Literal["x", "y", "z"] | None,
        Option("The up axis. Default: z for meshes that stand on z = 0, else y.", group=LOOK),
    ] = None,
    follow: Annotated[
        bool | None,
        Option(
            "Whether the camera follows the mesh. Default: if the mesh would look small, or "
            "off-center in a picture.",
            flag="--follow/--no-follow",
            group=LOOK,
        ),
    ] = None,
    size: Annotated[
        str | None,
        Option(
            "Size of the whole picture in pixels. Default: depends on the content.",
            metavar="WxH",
            group=LOOK,
        ),
    ] = None,
    background: Annotated[
        str, Option("A name, or #rrggbb.", metavar="COLOR", group=LOOK)
    ] = "white",
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
    from dataclasses import replace

    from meshreel.app.cli.console import print_json, print_notes, shown_progress
    from meshreel.app.cli.render_options import frame_list, picture_size, track_look
    from meshreel.operations.render import Look, render
    from meshreel.rendering.cuts import parse_cut

    if heatmap is not None and original is None:
        raise click.UsageError(
            "--heatmap shows the error of FILE relative to its original; give that with --original"
        )
    look = Look(
        heatmap=heatmap,
        track=track_look(track, component, range, colormap, heatmap),
        cut=None if cut is None else parse_cut(cut),
        view=view,
        up=up,
        follow=follow,
        size=picture_size(size),
        background=background,
    )
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
    print_notes(reading.notes)
    if as_json:
        print_json({**figures, "notes": reading.notes})
        return
    _print_figures(figures)


def _print_figures(figures: dict[str, Any]) -> None:
    from meshreel.app.cli.console import print_table
    from meshreel.runtime.counting import size_text

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
    print_table(figures["output"], {**rows, "size": size_text(figures["size_bytes"])})
