"""`meshreel view`: play a .reel in the browser."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import option
from meshreel.app.cli.player import (
    original_option,
    shown_track_option,
    source_argument,
    texture_option,
)
from meshreel.app.cli.read_options import MESHES, reading_options
from meshreel.app.cli.track_options import colormap_option, component_option, range_option
from meshreel.codec.option import Range

if TYPE_CHECKING:
    from meshreel.app.viewer.server import ViewerServer
    from meshreel.formats.options import ReadOptions


@command
@source_argument
@original_option
@shown_track_option
@component_option
@range_option
@colormap_option
@texture_option
@reading_options(*MESHES, "memory")
@option("--no-open", is_flag=True, help="Do not open the browser; only print the address.")
@option(
    "--port",
    type=int,
    range=Range(0, 65535, is_whole=True),
    default=0,
    help="Port to listen on; 0 selects a free port.",
)
@option(
    "--host",
    default="127.0.0.1",
    help="Address or name of this machine to listen on; others can watch if they can reach it.",
)
def view_command(
    source: Path,
    original: str | None,
    track: str | None,
    component: str | None,
    range: str | None,
    colormap: str | None,
    texture: Path | None,
    reading: "ReadOptions",
    no_open: bool,
    port: int,
    host: str,
) -> None:
    """Play a .reel file in the browser until ctrl-C.

    This program serves the page, by default to this machine only (see --host). The page loads
    nothing from other servers.

    Examples:

    - `meshreel view walk.reel`

    - `meshreel view walk.reel --original walk.npz`

    - `meshreel view crash.reel --track stress --range 0:500`

    - `meshreel view person.reel --texture person.mp4`

    - `meshreel view walk.reel --no-open --port 8000`
    """
    from contextlib import ExitStack, closing
    from dataclasses import replace

    from meshreel.app.cli.console import print_notes, progress_bar
    from meshreel.app.cli.messages import print_line
    from meshreel.app.cli.player import opened_player
    from meshreel.app.cli.render_options import track_look
    from meshreel.app.viewer.page import built_page
    from meshreel.app.viewer.server import ViewerServer

    look = track_look(track, component, range, colormap)
    page = built_page()
    with ExitStack() as stack:
        with progress_bar() as progress:
            reading = replace(reading, progress=progress)
            api = stack.enter_context(opened_player(source, original, reading, look, texture))
        server = stack.enter_context(ViewerServer(api, host=host, port=port, page=page))
        print_notes(reading.notes)
        if api.measuring is not None:
            stack.enter_context(closing(api.measuring)).start()
        print_line(f"{source} plays at {server.url} (ctrl-C stops it)")
        if not server.is_local:
            click.echo("everyone who can reach this machine can watch")
        _serve(server, opens_browser=not no_open)
    click.echo("stopped")


def _serve(server: "ViewerServer", *, opens_browser: bool) -> None:
    """Serve the page until ctrl-C."""
    import threading
    import webbrowser
    from contextlib import suppress

    if opens_browser:
        # In a thread, because some browsers block the caller until the page is loaded.
        threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    with suppress(KeyboardInterrupt):
        server.serve_forever()
