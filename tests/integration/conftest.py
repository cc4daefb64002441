import pytest

from integration.blender_session import Blender


@pytest.fixture(scope="session")
def blenders():
    """Running Blender processes; the last one may be reused."""
    started = []
    yield started
    for one in started:
        one.close()


@pytest.fixture
def blender(blenders, tmp_path):
    """Return a function that runs a scenario by name and returns its arrays."""

    def run(name, **arguments):
        if not (blenders and blenders[-1].is_alive):
            blenders.append(Blender())
        return blenders[-1].run(name, arguments, tmp_path / "result.npz")

    return run
