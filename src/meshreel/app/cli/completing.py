"""Shell completion: files that can be read or written, and names."""

from collections.abc import Callable, Iterable
from pathlib import Path

REEL = ".reel"


def names_of(names: Iterable[str]) -> Callable[[str], list[str]]:
    """A function from an incomplete name to those of the names that begin with it."""
    every = list(names)

    def begun(incomplete: str) -> list[str]:
        return [name for name in every if name.startswith(incomplete)]

    return begun


def input_files(incomplete: str) -> list[str]:
    """Files that hold an animation or a mesh, and folders."""
    from meshreel.formats.registry import FORMATS

    return _files(incomplete, set(FORMATS))


def reel_files(incomplete: str) -> list[str]:
    """Streams, and folders."""
    return _files(incomplete, {REEL})


def output_files(incomplete: str) -> list[str]:
    """The incomplete name with every extension that can be written: "walk." gives "walk.abc"."""
    from meshreel.formats.registry import written_extensions

    return with_extensions(incomplete, written_extensions())


def layout_names(incomplete: str) -> list[str]:
    """Layouts of vertex animation textures that begin so."""
    from meshreel.formats.vat.layouts import LAYOUT_NAMES

    return names_of(LAYOUT_NAMES)(incomplete)


def texture_kinds(incomplete: str) -> list[str]:
    """Kinds of textures that begin so."""
    from meshreel.formats.vat.folder import TEXEL_TYPES

    return names_of(TEXEL_TYPES)(incomplete)


def pages(incomplete: str) -> list[str]:
    """The incomplete name with the extension of a page."""
    return with_extensions(incomplete, [".html"])


def pictures(incomplete: str) -> list[str]:
    """The incomplete name with the extensions of pictures and films."""
    return with_extensions(incomplete, [".png", ".mp4", ".gif"])


def streams(incomplete: str) -> list[str]:
    """The incomplete name with the extension of a stream."""
    return with_extensions(incomplete, [REEL])


def with_extensions(incomplete: str, extensions: Iterable[str]) -> list[str]:
    """The incomplete name with each of the extensions; none while its stem is incomplete.

    Then, and where nothing fits, the shell uses its own completion.
    """
    stem, dot, begun = Path(incomplete).name.rpartition(".")
    if not dot or not stem:
        return []
    start = incomplete[: len(incomplete) - len(begun) - 1]
    return [
        start + extension for extension in extensions if extension.startswith(f".{begun.lower()}")
    ]


def _files(incomplete: str, extensions: set[str]) -> list[str]:
    """Files of these extensions that begin with the incomplete name, and folders if there are any.

    Where only folders fit, the shell's own completion is better: it adds no space after them.
    """
    folder, slash, begun = incomplete.rpartition("/")
    place = Path((folder or "/") if slash else ".")
    try:
        found = sorted(path for path in place.iterdir() if path.name.startswith(begun))
    except OSError:
        return []
    visible = [path for path in found if begun or not path.name.startswith(".")]
    files = [path.name for path in visible if path.suffix.lower() in extensions and path.is_file()]
    if not files:
        return []
    folders = [f"{path.name}/" for path in visible if path.is_dir()]
    return [f"{folder}{slash}{name}" for name in [*files, *folders]]
