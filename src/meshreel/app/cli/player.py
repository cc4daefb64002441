"""Arguments and player data shared by `view` and `export`."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from meshreel.app.cli.options import MESHES, refuse_other_formats
from meshreel.app.cli.parameters import Argument, File
from meshreel.app.figures import measured_rows, player_rows
from meshreel.codec.option import Option
from meshreel.errors import ConnectivityChangeError, InvalidInputError, Keyword
from meshreel.formats.options import Reading

if TYPE_CHECKING:
    from meshreel.app.viewer.player_data import PlayerData
    from meshreel.rendering.looks import TrackLook

SourceArgument = Annotated[
    Path, Argument("FILE", "The .reel to play, or the .mp4 with a .reel, its texture and sound.")
]
OriginalOption = Annotated[
    File | None,
    Option(
        "The original (any input of `encode`), shown alongside with heat maps of the error.",
        metavar="INPUT",
    ),
]
TextureOption = Annotated[
    Path | None,
    Option("Image to show on the mesh, or video that plays in sync with it.", metavar="FILE"),
]


@contextmanager
def open_player(
    source: Path,
    original: str | None,
    reading: Reading,
    look: "TrackLook | None" = None,
    texture: Path | None = None,
) -> Iterator["PlayerData"]:
    """Open a file and its original for the player."""
    from meshreel.app.viewer.measuring import Comparison
    from meshreel.app.viewer.original import Original
    from meshreel.app.viewer.playable import reencoding_text
    from meshreel.app.viewer.player_data import PlayerData
    from meshreel.formats.file_errors import errors_naming
    from meshreel.formats.load import open_for_encoding
    from meshreel.formats.reel import open as open_reel
    from meshreel.model.sequence import single_segment

    unused = [name for name in MESHES if getattr(reading, name)]
    if unused and not original:
        raise InvalidInputError(
            f"--{unused[0].replace('_', '-')} applies to the original; give it with ",
            Keyword("original"),
        )
    refuse_other_formats(str(source))
    with open_reel(source, memory=reading.memory) as file:
        first = file.segments[0]
        with errors_naming(source):
            _ = first.faces  # raises for damaged faces before the original is read
            if original and file.n_segments > 1:
                raise ConnectivityChangeError(
                    "the faces change; a comparison in the player needs the same faces in every "
                    "frame; omit ",
                    Keyword("original"),
                )
        comparison = None
        if original:
            sequence = open_for_encoding(original, None, reading)
            with errors_naming(Path(original)):
                segment = single_segment(sequence, "a comparison in the player")
                comparison = Comparison(first, Original(segment, first))
        if texture is None and source.suffix.lower() == ".mp4":
            texture = source
        with errors_naming(source):
            shown = PlayerData(
                file, source.stem, player_rows, comparison, measured_rows, reading.progress, look,
                texture,
            )  # fmt: skip
        if shown.is_reencoded:
            text = reencoding_text(shown.method)
            reading.notes.changed(
                f"{source} uses method {shown.method}; the player shows it {text}"
            )
        yield shown
