import pytest

from integration.blender_session import Blender


@pytest.fixture(scope="session")
def blenders():
    """Blenders that were started; the last one may be used again."""
    started = []
    yield started
    for one in started:
        one.close()


@pytest.fixture
def blender(blenders, tmp_path):
    """Runs a scenario by its name, and gives the arrays that it returns."""

    def run(name, **arguments):
        if not (blenders and blenders[-1].is_alive):
            blenders.append(Blender())
        return blenders[-1].run(name, arguments, tmp_path / "result.npz")

    return run
