"""Figures of matplotlib."""

import sys

import pytest

from meshreel.errors import InvalidInputError
from meshreel.rendering import plots


def test_error_names_the_extra_of_missing_matplotlib(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(InvalidInputError, match=r"pip install 'meshreel\[plot\]'"):
        plots.require_matplotlib()
