"""Diagnostics of USD, raised as errors of meshreel instead of printed to the terminal."""

from collections.abc import Iterator
from contextlib import contextmanager

from meshreel.errors import FormatError
from meshreel.runtime.extras import USD

NOT_UTF8 = "it contains text that is not UTF-8"


@contextmanager
def usd_errors(what: str) -> Iterator[None]:
    """Raise errors of USD within the context as `FormatError`, and suppress its output.

    Parameters
    ----------
    what : str
        Start of the message, such as "USD cannot read the file".
    """
    tf = USD.load("Tf")
    # While it exists, it receives the messages instead of the terminal.
    delegate = USD.load("UsdUtils").CoalescingDiagnosticDelegate()
    try:
        yield
    except UnicodeDecodeError:
        raise FormatError(f"{what}: {NOT_UTF8}") from None
    except (tf.ErrorException, tf.CppException) as error:
        raise FormatError(f"{what}: {_reason(error)}") from None
    finally:
        del delegate


def _reason(error: Exception) -> str:
    try:
        reasons = [str(getattr(one, "commentary", one)) for one in error.args]
    except UnicodeDecodeError:  # the message quotes the file
        return NOT_UTF8
    # The message of a C++ exception continues with a stack trace.
    return reasons[0].partition("\n")[0] if reasons else "USD gives no reason"
