"""Time limit of each test, in case a process hangs."""

import pytest

from samples.waiting import TEST_S, time_limit


@pytest.fixture(autouse=True)
def limit(request):
    with time_limit(TEST_S, request.node.name):
        yield
