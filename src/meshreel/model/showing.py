"""Display methods shared by `MeshSequence` and `ReelFile`."""

from typing import Any


def notebook_html(sequence: Any) -> str:
    """HTML for a notebook: properties, with the player or a picture.

    Parameters
    ----------
    sequence : MeshSequence or ReelFile
    """
    from meshreel.app.notebook.html import html_of

    return html_of(sequence)


def show(sequence: Any, *, block: bool | None = None) -> None:
    """Play the sequence: in a notebook in the output of the cell, else in the browser.

    A sequence is encoded with default options; the browser also shows the original. A file must
    stay open while it plays.

    Parameters
    ----------
    sequence : MeshSequence or ReelFile
    block : bool, optional
        Whether to wait for Ctrl-C while the browser plays it. Default: True in a script, whose end
        ends the player, False at a prompt.

    Raises
    ------
    InvalidInputError
        If the page of the player is not built, or the model is too large or too small to draw.
    """
    from meshreel.app.notebook.show import show

    show(sequence, block=block)
