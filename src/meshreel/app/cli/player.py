"""Arguments and player data that `view` and `export` share."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from meshreel.app.cli.completing import input_files, reel_files
from meshreel.app.cli.parameters import argument, option
from meshreel.app.cli.track_options import COLORS

if TYPE_CHECKING:
    from meshreel.app.viewer.api import Api
    from meshreel.app.viewer.comparison import Comparison
    from meshreel.codec.reel_file import ReelFile
    from meshreel.formats.options import ReadOptions
    from meshreel.rendering.track_colors import TrackLook

source_argument = argument(
    "source", type=Path, metavar="FILE.reel", completion=reel_files, help="The stream to play."
)
original_option = option(
    "--original",
    metavar="INPUT",
    completion=input_files,
    help="The original of the stream, shown alongside with heat maps of the error: "
    "any input of `encode`.",
)

shown_track_option = option(
    "--track",
    metavar="NAME",
    help="Open with the mesh coloured by a track, such as stress; tracks of colours as they are.",
    panel=COLORS,
)


@contextmanager
def opened_player(
    source: Path,
    original: str | None,
    reading: "ReadOptions",
    look: "TrackLook | None" = None,
) -> Iterator["Api"]:
    """Interface of the player to a file, while the file is open."""
    from meshreel.app.cli.figures import measured_rows, player_rows
    from meshreel.app.viewer.api import Api
    from meshreel.app.viewer.playable import reencoding_text
    from meshreel.formats.file_errors import errors_naming
    from meshreel.formats.reel.reading import open

    _check_original_is_there(original, reading)
    _check_is_encoded(source)
    with open(source, memory=reading.memory) as reel:
        with errors_naming(source):
            _ = reel.faces  # raises for damaged ones before the original is read
        comparison = _comparison(reel, original, reading) if original else None
        with errors_naming(source):
            rows = player_rows, comparison, measured_rows
            api = Api(reel, source.stem, *rows, reading.progress, look)
        if api.is_reencoded:
            text = reencoding_text(api.method)
            reading.notes.append(f"{source} uses method {api.method}; the player shows it {text}")
        yield api


def _check_is_encoded(source: Path) -> None:
    """Refuse an input of `encode` where a stream has to be."""
    from shlex import quote

    from meshreel.app.cli.read_options import is_stream_file, output_stem
    from meshreel.errors import InvalidInputError
    from meshreel.formats.registry import FORMATS

    is_input = source.is_dir() or (source.is_file() and source.suffix.lower() in FORMATS)
    if is_input and not is_stream_file(str(source)):
        output = f"{output_stem(str(source))}.reel"
        raise InvalidInputError(
            f"{source} is not a .reel file; encode it first: meshreel encode {quote(str(source))} "
            f"-o {quote(output)}"
        )


def _check_original_is_there(original: str | None, reading: "ReadOptions") -> None:
    """Refuse options for reading the original if there is none."""
    from meshreel.errors import InvalidInputError

    names = ("object", "merge", "skip_bad", "allow_outside", "animation")
    asked = [name for name in names if getattr(reading, name)]
    if asked and not original:
        raise InvalidInputError(
            f"--{asked[0].replace('_', '-')} has an effect on the original; name that with "
            "--original"
        )


def _comparison(reel: "ReelFile", original: str, reading: "ReadOptions") -> "Comparison":
    from meshreel.app.viewer.comparison import Comparison
    from meshreel.app.viewer.original import Original
    from meshreel.formats.file_errors import errors_naming
    from meshreel.formats.load import open_for_purpose

    source = open_for_purpose(original, reading, "a comparison in the player")
    with errors_naming(Path(original)):
        return Comparison(reel, Original(source, reel))
