"""Stores on this machine, and a time limit of each test."""

import pytest

from samples.waiting import TEST_S, time_limit
from samples.web_server import web_server


@pytest.fixture(autouse=True)
def limit(request):
    with time_limit(TEST_S, request.node.name):
        yield


@pytest.fixture
def web(tmp_path):
    pytest.importorskip("aiohttp", reason="the extra [remote] is not installed")
    (tmp_path / "web").mkdir()
    with web_server(tmp_path / "web") as server:
        yield server
