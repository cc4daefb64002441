"""Options that only some inputs of a batch support are dropped for the others."""

from pathlib import Path

import pytest

from meshreel.formats.options import ReadOptions
from meshreel.formats.supported_options import supported_only

GIVEN = ReadOptions(
    fps=24.0, object="body", merge=True, skip_bad=True, allow_outside=True, animation="run"
)
KEPT = {
    "a.npz": ReadOptions(fps=24.0, merge=True),
    "a.h5": ReadOptions(fps=24.0, object="body", merge=True, skip_bad=True),
    "a.glb": GIVEN,
}


@pytest.mark.parametrize("source", KEPT)
@pytest.mark.parametrize("kind", [str, Path])
def test_options_without_effect_are_left_out(source, kind):
    assert supported_only(GIVEN, kind(source)) == KEPT[source]
