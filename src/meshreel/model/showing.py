"""Display methods shared by sequences and files; the package root installs the viewer."""

from collections.abc import Callable
from typing import Any, Protocol


class Viewer(Protocol):
    """A viewer of sequences and files, such as `meshreel.app.notebook`."""

    def html_of(self, sequence: Any, /) -> str:
        """HTML for a notebook."""

    def show(self, sequence: Any, /, *, block: bool | None) -> None:
        """Play the sequence."""


_load_viewer: Callable[[], Viewer]


def install_viewer(load: Callable[[], Viewer]) -> None:
    """Install the viewer; `load` imports it when a sequence is first displayed."""
    global _load_viewer
    _load_viewer = load


def notebook_html(sequence: Any) -> str:
    """HTML for a notebook: properties, and a player if the sequence is small."""
    return _load_viewer().html_of(sequence)


def show(sequence: Any, *, block: bool | None = None) -> None:
    """Play the sequence: in a notebook in the output of the cell, else in the browser.

    A sequence is encoded with default options; the browser also shows the original. A file must
    stay open while it plays.

    Parameters
    ----------
    sequence : MeshSequence or ReelFile
    block : bool, optional
        Whether to wait for Ctrl-C while the browser plays it. Default: True in a script, because
        the player stops when it ends; False at a prompt.

    Raises
    ------
    InvalidInputError
        If the page of the player is not built, or the model is too large or too small to draw.
    """
    _load_viewer().show(sequence, block=block)
