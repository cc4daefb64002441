"""Shell completion of file names, extensions and option values."""

from collections.abc import Callable, Iterable
from pathlib import Path

REEL = ".reel"


def names_of(names: Iterable[str]) -> Callable[[str], list[str]]:
    """A function that returns the names with a given beginning."""
    choices = list(names)

    def completions(incomplete: str) -> list[str]:
        return [name for name in choices if name.startswith(incomplete)]

    return completions


def input_files(incomplete: str) -> list[str]:
    """Files of animations and meshes, and folders."""
    from meshreel.formats.registry import FORMATS

    return _files(incomplete, set(FORMATS))


def reel_files(incomplete: str) -> list[str]:
    """Streams and folders."""
    return _files(incomplete, {REEL})


def output_files(incomplete: str) -> list[str]:
    """The name with each writable extension: "walk." gives "walk.abc"."""
    from meshreel.formats.registry import written_extensions

    return with_extensions(incomplete, written_extensions())


def layout_names(incomplete: str) -> list[str]:
    """Layouts of vertex animation textures."""
    from meshreel.formats.vat.folder import LAYOUTS

    return names_of(LAYOUTS)(incomplete)


def texture_kinds(incomplete: str) -> list[str]:
    """Kinds of textures."""
    from meshreel.formats.vat.folder import TEXEL_TYPES

    return names_of(TEXEL_TYPES)(incomplete)


def pages(incomplete: str) -> list[str]:
    """The name with the extension of a page."""
    return with_extensions(incomplete, [".html"])


def pictures(incomplete: str) -> list[str]:
    """The name with the extensions of pictures and films."""
    return with_extensions(incomplete, [".png", ".mp4", ".gif"])


def streams(incomplete: str) -> list[str]:
    """The name with the extension of a stream."""
    return with_extensions(incomplete, [REEL])


def with_extensions(incomplete: str, extensions: Iterable[str]) -> list[str]:
    """The name with each matching extension; empty before the dot is typed.

    Without a match, the shell completes names of files.
    """
    stem, dot, beginning = Path(incomplete).name.rpartition(".")
    if not dot or not stem:
        return []
    path = incomplete.removesuffix(f".{beginning}")
    typed = f".{beginning.lower()}"
    return [path + extension for extension in extensions if extension.startswith(typed)]


def _files(incomplete: str, extensions: set[str]) -> list[str]:
    """Matching files with these extensions, and matching folders; empty without such files.

    The shell completes folders better, because it adds no space after them.
    """
    from meshreel.formats.registry import extension_of

    folder, slash, beginning = incomplete.rpartition("/")
    parent = Path((folder or "/") if slash else ".")
    try:
        paths = sorted(path for path in parent.iterdir() if path.name.startswith(beginning))
    except OSError:
        return []
    visible = [path for path in paths if beginning or not path.name.startswith(".")]
    files = [path.name for path in visible if extension_of(path) in extensions and path.is_file()]
    if not files:
        return []
    folders = [f"{path.name}/" for path in visible if path.is_dir()]
    return [f"{folder}{slash}{name}" for name in [*files, *folders]]
