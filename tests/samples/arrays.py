"""NumPy archives and HDF5 files of named arrays."""

import numpy as np
import pytest


def store(path, **arrays):
    """Write an archive with numpy, or a file with another extension with h5py."""
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    else:
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as file:
            for name, array in arrays.items():
                file[name] = array
    return path
