"""`meshreel view`: play a .reel in the browser."""

from dataclasses import replace
from typing import Annotated

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import print_notes, shown_progress
from meshreel.app.cli.messages import print_line
from meshreel.app.cli.options import MESHES, TrackLookOption, reading
from meshreel.app.cli.player import OriginalOption, SourceArgument, TextureOption
from meshreel.codec.option import Option, Range
from meshreel.formats.options import Reading


@command
def view_command(
    source: SourceArgument,
    reading: Annotated[Reading, reading(*MESHES, "memory")],
    look: TrackLookOption,
    original: OriginalOption = None,
    texture: TextureOption = None,
    no_open: Annotated[bool, Option("Do not open the browser; only print the address.")] = False,
    port: Annotated[
        int,
        Option("Port to listen on; 0 selects a free port.", range=Range(0, 65535, is_whole=True)),
    ] = 0,
) -> None:
    """Play a .reel file in the browser until ctrl-C.

    This program serves the page, to this machine only. The page loads nothing from other servers.

    Examples:

    - `meshreel view walk.reel`
    - `meshreel view walk.reel --original walk.npz`
    - `meshreel view crash.reel --track stress --range 0:500`
    - `meshreel view person.reel --texture person.mp4`
    - `meshreel view walk.reel --no-open --port 8000`
    """
    import threading
    import webbrowser
    from contextlib import ExitStack, closing, suppress

    from meshreel.app.cli.player import open_player
    from meshreel.app.viewer.page import built_page
    from meshreel.app.viewer.server import ViewerServer

    page = built_page()
    with ExitStack() as stack:
        with shown_progress() as progress:
            reading = replace(reading, progress=progress)
            shown = stack.enter_context(open_player(source, original, reading, look, texture))
        server = stack.enter_context(ViewerServer(shown, port=port, page=page))
        print_notes(reading.notes)
        if shown.measuring is not None:
            stack.enter_context(closing(shown.measuring)).start()
        print_line(f"{source} plays at {server.url} (ctrl-C stops it)")
        if not no_open:
            # In a thread, because some browsers block the caller until the page is loaded.
            threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
        with suppress(KeyboardInterrupt):
            server.serve_forever()
    click.echo("stopped")
