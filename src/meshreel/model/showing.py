"""How a sequence and a file show themselves, once they are asked to: methods of both."""

from typing import Any


def notebook_html(shown: Any) -> str:
    """HTML for a notebook: figures over the player, or over a picture.

    Parameters
    ----------
    shown : MeshSequence or ReelFile
    """
    from meshreel.app.notebook.html import html_of

    return html_of(shown)


def show(shown: Any, *, block: bool | None = None) -> None:
    """Play it: in the output of the cell in a notebook, else in the browser.

    A sequence is shown as `encode` makes it by default; the browser has it beside that. A file
    must stay open for as long as it is shown.

    Parameters
    ----------
    shown : MeshSequence or ReelFile
    block : bool, optional
        Whether to wait for ctrl-C while the browser shows it. Default: in a script, whose end
        would end the player, but not at a prompt.

    Raises
    ------
    InvalidInputError
        If the page of the player is not built, or the model is too large or small to be drawn.
    """
    from meshreel.app.notebook.show import show

    show(shown, block=block)
