"""Detection of positions that need float64."""

import numpy as np

from meshreel.formats.text.decimal_text import Narrowing


def test_narrowing_accepts_an_empty_frame():
    narrowing = Narrowing()
    narrowing.add(np.zeros((0, 3)))
    assert narrowing.is_harmless


def test_narrowing_is_harmful_far_from_the_origin():
    narrowing = Narrowing()
    narrowing.add(np.array([[1e8 + 0.25, 0, 0], [1e8 + 1, 0, 0]]))
    assert not narrowing.is_harmless
