"""Every test here ends, whatever becomes of the processes it waits for."""

import pytest

from samples.waiting import TEST_S, time_limit


@pytest.fixture(autouse=True)
def limit(request):
    with time_limit(TEST_S, request.node.name):
        yield
