"""Extent of a test run: everything, or the quick tests of `pytest` alone."""

import pytest

_does_everything = False


def do_everything():
    """Run all random cases; `conftest.py` calls this before collection."""
    global _does_everything
    _does_everything = True


def does_everything():
    """Return whether this run includes slow tests and all random cases."""
    return _does_everything


def draws(n):
    """Return the number of random cases, or of repeated elements: n, or a tenth in quick runs."""
    return n if _does_everything else max(1, n // 10)


def slow_but(quick, values):
    """Return the values as parameters, marked slow unless they are in `quick`.

    Tuples are values of several parameters.
    """
    return [value if value in quick else _slow(value) for value in values]


def _slow(value):
    values = value if isinstance(value, tuple) else (value,)
    return pytest.param(*values, marks=pytest.mark.slow)
