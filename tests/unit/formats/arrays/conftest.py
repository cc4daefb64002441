import pytest


@pytest.fixture(params=["npz", "h5"])
def extension(request):
    """The extension of a format of named arrays."""
    if request.param == "h5":
        pytest.importorskip("h5py")
    return request.param
