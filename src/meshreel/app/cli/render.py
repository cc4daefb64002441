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
    from meshreel.formats.options import ReadOptions
    from meshreel.rendering.scenes import Scene
    from meshreel.rendering.views import View
    from meshreel.runtime.extras import Extra
    from meshreel.runtime.progress import Progress

LOOK = "Look"
EXTENSIONS = (".png", ".mp4", ".gif")
SHEET_FRAMES, COMPARED_FRAMES = 8, 3
"""Default numbers of frames on a contact sheet, and in a comparison with the original."""


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
    reading: Annotated["ReadOptions", reading("fps", *MESHES, "displace", "memory")],
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
            f"Only frames A to B - 1, or the listed ones. A picture shows {SHEET_FRAMES} frames of "
            f"a range ({COMPARED_FRAMES} with an original), evenly spaced.",
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
    from meshreel.app.cli.render_options import (
        frame_numbers,
        is_range,
        parse_color,
        picture_size,
        track_look,
    )
    from meshreel.formats.load import open_for_encoding
    from meshreel.formats.needed_extras import extras_to_read
    from meshreel.formats.sources import files_of_source
    from meshreel.formats.supported_options import check_supported, supported_only
    from meshreel.rendering.cuts import parse_cut
    from meshreel.rendering.scenes import Scene
    from meshreel.rendering.views import guess_up, parse_view
    from meshreel.runtime.extras import require
    from meshreel.runtime.outputs.checks import check_extension, check_output_path

    check_extension(output, EXTENSIONS)
    if heatmap is not None and original is None:
        raise click.UsageError(
            "--heatmap shows the error of FILE relative to its original; give that with --original"
        )
    plane = None if cut is None else parse_cut(cut)
    look = track_look(track, component, range, colormap, heatmap)
    files = [file for path in (source, original) if path for file in files_of_source(path)]
    require([*_drawing_extras(output), *extras_to_read(files)])
    check_output_path(output, overwrite=force, inputs=files)
    size_px, color = picture_size(size), parse_color(background)
    parse_view(view, up or "y")
    check_supported([source, original] if original else [source], reading)
    notes = reading.notes
    with shown_progress() as progress:
        reading = replace(reading, progress=progress)
        sequence = open_for_encoding(source, None, supported_only(reading, source))
        reference = None
        if original:
            reference = open_for_encoding(original, None, supported_only(reading, original))
        numbers = frame_numbers(frames, sequence.n_frames, notes)
        scene = Scene(sequence, reference, heatmap, background=color, track=look, cut=plane)
        if output.suffix.lower() != ".png" and sequence.timing.times is not None:
            text = (
                f"frame times are uneven; the film has {sequence.fps:g} pictures per second, each "
                "of the frame that is due"
            )
            notes.changed("frame times", text)
        parsed_view = parse_view(view, up or guess_up(scene.framed_sequence.extent))
        figures = _draw(
            scene, numbers, parsed_view, output,
            size=size_px, follow=follow,
            is_range=is_range(frames), force=force, progress=progress,
        )  # fmt: skip
    print_notes(notes)
    figures = {"output": str(output), **figures, "size_bytes": output.stat().st_size}
    if as_json:
        print_json({**figures, "notes": notes})
        return
    _print_figures(figures)


def _draw(
    scene: "Scene",
    numbers: list[int],
    view: "View",
    output: Path,
    *,
    size: tuple[int, int] | None,
    follow: bool | None,
    is_range: bool,
    force: bool,
    progress: "Progress",
) -> dict[str, Any]:
    """Write a picture or a film, and return its properties."""
    from meshreel.rendering.film_files import save_film
    from meshreel.rendering.films import FILM_PX, GIF_PX, film
    from meshreel.rendering.picture import save_png
    from meshreel.rendering.shots import representative_frames, spread_frames
    from meshreel.rendering.stills import still

    extension = output.suffix.lower()
    if extension != ".png":
        pictures = film(
            scene, numbers, view,
            size=size,
            max_size=GIF_PX if extension == ".gif" else FILM_PX,
            is_followed=follow, progress=progress,
        )  # fmt: skip
        save_film(pictures, output, overwrite=force, progress=progress)
        size_px, n_pictures = list(pictures.size), pictures.n_pictures
        return {"size_px": size_px, "n_pictures": n_pictures, "fps": pictures.fps}
    if is_range and scene.original is not None:
        numbers = representative_frames(numbers, COMPARED_FRAMES)
    elif is_range:
        numbers = spread_frames(numbers, SHEET_FRAMES)
    picture = still(scene, numbers, view, size=size, is_followed=follow, progress=progress)
    save_png(picture, output, overwrite=force)
    return {"size_px": list(picture.size), "frames": numbers}


def _drawing_extras(output: Path) -> list["Extra"]:
    """The extras that draw and write the output."""
    from meshreel.runtime.extras import RENDER, VIDEO, VIDEO_PILLOW

    return [VIDEO, VIDEO_PILLOW] if output.suffix.lower() == ".mp4" else [RENDER]


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
