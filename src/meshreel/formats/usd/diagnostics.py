"""What USD says about a file, as errors of meshreel and not on the terminal."""

from collections.abc import Iterator
from contextlib import contextmanager

from meshreel.errors import FormatError
from meshreel.formats.extras import USD


@contextmanager
def usd_errors(what: str) -> Iterator[None]:
    """Within it, what USD raises is a `FormatError`, and what USD would print is dropped.

    Parameters
    ----------
    what : str
        What has failed then, as in "USD cannot read the file".
    """
    error_class = USD.load("Tf").ErrorException
    # While it lives, it takes in what would go to the terminal.
    delegate = USD.load("UsdUtils").CoalescingDiagnosticDelegate()
    try:
        yield
    except error_class as error:
        reasons = [str(getattr(one, "commentary", one)).strip() for one in error.args]
        raise FormatError(f"{what}: {reasons[0] if reasons else 'it does not say why'}") from None
    finally:
        del delegate
