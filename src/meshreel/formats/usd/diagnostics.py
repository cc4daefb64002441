"""Diagnostics of USD about a file, as errors of meshreel and not on the terminal."""

from collections.abc import Iterator
from contextlib import contextmanager

from meshreel.errors import FormatError
from meshreel.formats.extras import USD

NOT_TEXT = "it holds text that is not UTF-8"


@contextmanager
def usd_errors(what: str) -> Iterator[None]:
    """Within it, what USD raises is a `FormatError`, and what USD would print is dropped.

    Parameters
    ----------
    what : str
        What has failed then, as in "USD cannot read the file".
    """
    tf = USD.load("Tf")
    # While it lives, it takes in what would go to the terminal.
    delegate = USD.load("UsdUtils").CoalescingDiagnosticDelegate()
    try:
        yield
    except UnicodeDecodeError:
        raise FormatError(f"{what}: {NOT_TEXT}") from None
    except (tf.ErrorException, tf.CppException) as error:
        raise FormatError(f"{what}: {_reason(error)}") from None
    finally:
        del delegate


def _reason(error: Exception) -> str:
    try:
        reasons = [str(getattr(one, "commentary", one)) for one in error.args]
    except UnicodeDecodeError:  # it quotes the file
        return NOT_TEXT
    # Of an exception of C++, what follows the first line is a trace.
    return reasons[0].partition("\n")[0] if reasons else "it does not say why"
