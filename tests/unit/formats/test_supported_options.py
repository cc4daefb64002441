"""Options that only some inputs of a batch support are dropped for the others."""

from pathlib import Path

import pytest

from meshreel.formats.options import ReadOptions
from meshreel.formats.supported_options import supported_only

GIVEN = ReadOptions(24.0, "body", True, skip_bad=True, allow_outside=True, animation="run")
KEPT = {
    "a.npz": ReadOptions(24.0, merge=True),
    "a.h5": ReadOptions(24.0, "body", True, skip_bad=True),
    "a.glb": GIVEN,
}


@pytest.mark.parametrize("source", KEPT)
@pytest.mark.parametrize("kind", [str, Path])
def test_options_without_effect_are_left_out(source, kind):
    assert supported_only(GIVEN, kind(source)) == KEPT[source]
