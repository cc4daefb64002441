"""`meshreel export`: write a .reel and its player as a web page."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import print_figures, shown_progress
from meshreel.app.cli.options import MESHES, TrackLookOption, reading
from meshreel.app.cli.parameters import JsonOption
from meshreel.app.cli.player import OriginalOption, SourceArgument, TextureOption
from meshreel.codec.option import Option
from meshreel.formats.options import Reading
from meshreel.runtime.counting import size_text

EXTENSIONS = (".html", ".htm")
OTHER_OUTPUTS = "`meshreel decode` writes other formats, `meshreel render` pictures and films"


@command
def export_command(
    source: SourceArgument,
    output: Annotated[Path, Option("The page to write.", flag="--output -o", metavar="PAGE.html")],
    reading: Annotated[Reading, reading(*MESHES, "memory")],
    look: TrackLookOption,
    original: OriginalOption = None,
    force: Annotated[bool, Option("Replace the page if it exists.", flag="--force -f")] = False,
    split: Annotated[
        bool,
        Option("Write script, stream, original and texture as separate files next to the page."),
    ] = False,
    texture: TextureOption = None,
    as_json: JsonOption = False,
) -> None:
    """Write a .reel file and its player as one HTML file, to mail or to put on any web server.

    The page contains the unchanged stream. With --original it also contains the original,
    re-encoded with an error of at most 1/20 of the range of the heat map. With --split the page
    needs a web server, because browsers do not load separate files from disk.

    Examples:

    - `meshreel export walk.reel -o walk.html`
    - `meshreel export walk.reel -o errors.html --original walk.npz`
    - `meshreel export crash.reel -o crash.html --track stress --range 2%:98%`
    - `meshreel export walk.reel -o site/index.html --split`
    - `meshreel export person.reel -o person.html --texture person.mp4`
    """
    from meshreel.app.cli.player import open_player
    from meshreel.app.viewer.export import export_page
    from meshreel.app.viewer.page import built_page
    from meshreel.formats.file_errors import errors_naming
    from meshreel.formats.sources import find_files
    from meshreel.runtime.outputs.checks import check_extension, check_output_path

    check_extension(output, EXTENSIONS, OTHER_OUTPUTS)
    files = [source, *(find_files(original).with_companions() if original else [])]
    check_output_path(output, overwrite=force, inputs=files)
    page = built_page()
    with (
        shown_progress() as progress,
        open_player(source, original, replace(reading, progress=progress), look, texture) as shown,
        errors_naming(source),
    ):
        parts = export_page(
            shown,
            output,
            page=page,
            split=split,
            overwrite=force,
            progress=progress,
            notes=reading.notes,
        )
    figures = {"output": str(output), "size_bytes": sum(parts.values()), "parts": parts}
    rows = {"size": size_text(sum(parts.values()))}
    rows |= {f"of which {part}": size_text(size) for part, size in parts.items()}
    rows[f"input {source.suffix}"] = size_text(source.stat().st_size)
    print_figures(str(output), rows, figures, reading.notes, as_json=as_json)
