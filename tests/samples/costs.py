"""How much a run of the tests does: everything, or what `pytest` alone has a minute for."""

import pytest

_does_everything = False


def do_everything():
    """From here on every case is drawn; `conftest.py` says so before any test is read."""
    global _does_everything
    _does_everything = True


def draws(n):
    """So many cases of a test that draws them at random; a tenth of them in `pytest` alone."""
    return n if _does_everything else max(1, n // 10)


def slow_but(quick, values):
    """The values as parameters, all of them marked slow but those that are quick.

    Tuples are values of several parameters.
    """
    return [one if one in quick else _slow(one) for one in values]


def _slow(value):
    values = value if isinstance(value, tuple) else (value,)
    return pytest.param(*values, marks=pytest.mark.slow)
