from functools import partial

import pytest

from samples import usd


@pytest.fixture
def stage_file(tmp_path):
    """A function that writes a stage without its first lines, and returns its file."""
    return partial(usd.stage, tmp_path)
