"""`meshreel render`: pictures and films of an animation, without a screen."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from meshreel.cli.completing import input_files, names_of, pictures
from meshreel.cli.read_options import (
    AllowOutsideOption,
    FpsOption,
    MergeOption,
    ObjectOption,
    SkipBadOption,
)
from meshreel.counting import counted

if TYPE_CHECKING:
    from meshreel.sequence import FrameSource

LOOK = "Look"
ENDINGS = (".png", ".mp4", ".gif")
SHEET_FRAMES, COMPARED_FRAMES = 8, 3
"""Frames on a contact sheet, and rows of a comparison, where they are not listed."""
MAX_TURN_S = 3600.0


def render_command(
    source: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            autocompletion=input_files,
            help="A .reel, another file that holds an animation (see `meshreel formats`), a "
            "folder or a quoted glob of frames.",
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            autocompletion=pictures,
            help="A picture (.png) or a film (.mp4, .gif); .mp4 needs [video].",
        ),
    ],
    original: Annotated[
        str | None,
        typer.Option(
            metavar="INPUT",
            autocompletion=input_files,
            help="The original of FILE, to be shown beside it.",
        ),
    ] = None,
    heatmap: Annotated[
        str | None,
        typer.Option(
            metavar="distance|angle|sted",
            autocompletion=names_of(["distance", "angle", "sted"]),
            help="Colour the decoded mesh by its error: vertex distance, angle between normals, or "
            "local STED.",
        ),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(
            metavar="A:B|N,N,...",
            help="Only frames A to B - 1, or those listed. Of a range, a picture shows "
            f"{SHEET_FRAMES} ({COMPARED_FRAMES} beside an original), evenly spaced.",
        ),
    ] = None,
    turntable: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Films: circle the mesh, once in this time."),
    ] = None,
    view: Annotated[
        str,
        typer.Option(
            metavar="AZ,EL",
            help="Direction of view: front, side, top, or degrees to the right and up.",
            rich_help_panel=LOOK,
        ),
    ] = "30,12",
    up: Annotated[
        str | None,
        typer.Option(
            metavar="y|z",
            help="The axis that points up. Default: z for meshes that stand on z = 0, else y.",
            rich_help_panel=LOOK,
        ),
    ] = None,
    follow: Annotated[
        bool | None,
        typer.Option(
            "--follow/--no-follow",
            help="Whether the camera follows the mesh. Default: if the mesh would be small.",
            rich_help_panel=LOOK,
        ),
    ] = None,
    size: Annotated[
        str | None,
        typer.Option(
            metavar="WxH",
            help="Pixels of the whole picture. Default: as suits its content.",
            rich_help_panel=LOOK,
        ),
    ] = None,
    background: Annotated[
        str,
        typer.Option(metavar="COLOR", help="A name, or #rrggbb.", rich_help_panel=LOOK),
    ] = "white",
    fps: FpsOption = None,
    object: ObjectOption = None,
    merge: MergeOption = False,
    skip_bad: SkipBadOption = False,
    allow_outside: AllowOutsideOption = False,
    force: Annotated[
        bool, typer.Option("--force", "-f", help="Replace the output if it exists.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was done as JSON.")] = False,
) -> None:
    """Draw an animation into a picture or a film.

    A .png shows frames side by side with their numbers and times; one frame alone fills it. With
    --original, each frame has a row: original, decoded and, with --heatmap, the error.

    Examples:

    - `meshreel render walk.reel -o walk.png`

    - `meshreel render walk.reel -o pose.png --frames 17 --view front --size 1920x1080`

    - `meshreel render walk.reel -o lost.png --original walk.npz --heatmap distance`

    - `meshreel render walk.reel -o walk.mp4 --original walk.npz --heatmap angle`

    - `meshreel render walk.reel -o turn.gif --frames 17 --turntable 4`
    """
    from meshreel.cli.console import print_json, print_notes, progress_bar
    from meshreel.cli.render_options import (
        color_named,
        frame_numbers,
        is_range,
        picture_size,
    )
    from meshreel.formats.load import MAX_LOADED_BYTES, open_source
    from meshreel.formats.registry import holds_meshes
    from meshreel.formats.sources import files_of_source
    from meshreel.formats.supported_options import check_supported, supports
    from meshreel.rendering.film_files import save_film
    from meshreel.rendering.films import FILM_PX, GIF_PX, film
    from meshreel.rendering.picture import save_png
    from meshreel.rendering.scenes import Scene
    from meshreel.rendering.shots import spread_frames, telling_frames
    from meshreel.rendering.stills import still
    from meshreel.rendering.views import guess_up, parse_view
    from meshreel.runtime.outputs.checks import check_output_path

    ending = _checked_ending(output)
    is_film = ending != ".png"
    _check_together(original, heatmap, turntable, follow, is_film=is_film)
    files = [file for given in (source, original) if given for file in files_of_source(given)]
    check_output_path(output, overwrite=force, inputs=files)
    wanted_size, color = picture_size(size), color_named(background)
    parse_view(view, up or "y")
    check_supported(
        [source, original] if original else [source],
        skip_bad=skip_bad, allow_outside=allow_outside,
    )  # fmt: skip
    notes: list[str] = []
    with progress_bar() as progress:

        def opened(given: str) -> "FrameSource":
            return open_source(
                given,
                fps=fps, object=object if holds_meshes(given) else None, merge=merge,
                skip_bad=skip_bad and supports(given, "skip_bad"),
                allow_outside=allow_outside and supports(given, "allow_outside"),
                max_loaded_bytes=MAX_LOADED_BYTES, progress=progress, notes=notes,
            )  # fmt: skip

        shown = opened(source)
        scene = Scene(shown, opened(original) if original else None, heatmap, background=color)
        numbers = frame_numbers(frames, shown.n_frames, notes)
        seen = parse_view(view, up or guess_up(scene.framed.extent))
        if is_film:
            made = film(
                scene, numbers, seen,
                turn_s=turntable, size=wanted_size,
                most=GIF_PX if ending == ".gif" else FILM_PX,
                is_followed=follow, progress=progress,
            )  # fmt: skip
            save_film(made, output, overwrite=force, progress=progress)
            figures = {"size_px": list(made.size), "n_pictures": made.n_pictures, "fps": made.fps}
        else:
            if is_range(frames) and original:
                numbers = telling_frames(numbers, COMPARED_FRAMES)
            elif is_range(frames):
                numbers = spread_frames(numbers, SHEET_FRAMES)
            picture = still(
                scene, numbers, seen, size=wanted_size, is_followed=follow, progress=progress
            )
            save_png(picture, output, overwrite=force)
            figures = {"size_px": list(picture.size), "frames": numbers}
    print_notes(notes)
    figures = {"output": str(output), **figures, "size_bytes": output.stat().st_size}
    if as_json:
        print_json({**figures, "notes": notes})
        return
    _print_drawn(figures)


def _checked_ending(output: Path) -> str:
    """The ending of the output in lower case; raises if a library that it needs is missing."""
    from meshreel.rendering.film_files import require_ffmpeg
    from meshreel.runtime.outputs.checks import check_ending

    ending = check_ending(output, ENDINGS)
    if ending == ".mp4":
        require_ffmpeg()
    return ending


def _check_together(
    original: str | None,
    heatmap: str | None,
    turntable: float | None,
    follow: bool | None,
    *,
    is_film: bool,
) -> None:
    from meshreel.metrics.heat import HEATS

    if heatmap is not None and heatmap not in HEATS:
        raise typer.BadParameter(f"--heatmap takes {', '.join(HEATS)}; got {heatmap!r}")
    if heatmap is not None and original is None:
        raise typer.BadParameter(
            "--heatmap shows the error of FILE relative to its original; name that with --original"
        )
    if turntable is not None and not is_film:
        raise typer.BadParameter(
            "--turntable turns a film; write .mp4 or .gif, or turn a picture with --view"
        )
    if turntable is not None and follow is not None:
        raise typer.BadParameter(
            "--turntable circles the place where the mesh is; leave --follow and --no-follow out"
        )
    if turntable is not None and not 0 < turntable <= MAX_TURN_S:
        raise typer.BadParameter(
            f"--turntable takes seconds above 0 and up to {MAX_TURN_S:g}; got {turntable:g}"
        )


def _print_drawn(figures: dict[str, Any]) -> None:
    from meshreel.cli.console import print_table, size_text

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
