"""`meshreel view`: playback of a .reel in the browser."""

from typing import TYPE_CHECKING, Annotated

import typer

from meshreel.cli.player import OriginalOption, ShownTrackOption, SourceArgument
from meshreel.cli.read_options import AllowOutsideOption, MergeOption, ObjectOption, SkipBadOption
from meshreel.cli.track_options import ColormapOption, ComponentOption, RangeOption

if TYPE_CHECKING:
    from meshreel.viewer.server import ViewerServer


def view_command(
    source: SourceArgument,
    original: OriginalOption = None,
    track: ShownTrackOption = None,
    component: ComponentOption = None,
    range: RangeOption = None,
    colormap: ColormapOption = None,
    object: ObjectOption = None,
    merge: MergeOption = False,
    skip_bad: SkipBadOption = False,
    allow_outside: AllowOutsideOption = False,
    no_open: Annotated[
        bool, typer.Option("--no-open", help="Do not open the browser; only print the address.")
    ] = False,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to listen on; 0 takes a free one.")
    ] = 0,
    host: Annotated[
        str,
        typer.Option(
            help="Address or name of this machine to listen on, so that others can watch."
        ),
    ] = "127.0.0.1",
) -> None:
    """Play a .reel file in the browser, until ctrl-C.

    This program serves the page, by default to this machine only (see --host); nothing is loaded
    from elsewhere.

    Examples:

    - `meshreel view walk.reel`

    - `meshreel view walk.reel --original walk.npz`

    - `meshreel view crash.reel --track stress --range 0:500`

    - `meshreel view walk.reel --no-open --port 8000`
    """
    from contextlib import ExitStack, closing

    from meshreel.cli.console import print_notes, progress_bar
    from meshreel.cli.lines import print_line
    from meshreel.cli.player import coloring_of, opened_player
    from meshreel.formats.options import ReadOptions
    from meshreel.viewer.page import built_page
    from meshreel.viewer.server import ViewerServer

    coloring = coloring_of(track, component, range, colormap)
    page = built_page()
    with ExitStack() as stack:
        with progress_bar() as progress:
            reading = ReadOptions(
                object=object,
                merge=merge,
                skip_bad=skip_bad,
                allow_outside=allow_outside,
                progress=progress,
            )
            api = stack.enter_context(opened_player(source, original, reading, coloring))
        server = stack.enter_context(ViewerServer(api, host=host, port=port, page=page))
        print_notes(reading.notes)
        if api.measuring is not None:
            stack.enter_context(closing(api.measuring)).start()
        print_line(f"{source} plays at {server.url} (ctrl-C stops it)")
        if not server.is_local:
            typer.echo("everyone who can reach this machine can see it")
        _serve(server, opens_browser=not no_open)
    typer.echo("stopped")


def _serve(server: "ViewerServer", *, opens_browser: bool) -> None:
    """Serve the page until ctrl-C."""
    import threading
    import webbrowser
    from contextlib import suppress

    if opens_browser:
        # In a thread: some browsers block their caller until the page is loaded.
        threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    with suppress(KeyboardInterrupt):
        server.serve_forever()
