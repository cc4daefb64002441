from functools import cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import meshreel.formats.load
from conservation import BY_VTK, walks
from contents.items import balance, items_of
from meshreel.formats.load import load
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from samples.costs import does_everything
from samples.meshes import octahedron_faces
from samples.opening import open_source


@pytest.fixture
def make_sequence():
    """An octahedron whose vertices move at random, with values that need all their digits."""

    def make(n_frames=3, dtype=np.float32, offset=0.0, fps=0.0, name=""):
        rng = np.random.default_rng(7)
        vertices = (rng.standard_normal((n_frames, 6, 3)) * 0.37 + offset).astype(dtype)
        return MeshSequence(vertices, octahedron_faces(), fps, name)

    return make


@pytest.fixture(params=[load, open_source])
def read(request):
    """A function that reads a file: at once, or each frame when it is needed."""
    return request.param


@pytest.fixture
def notes():
    """An empty list, which receives the notes of functions that take it."""
    return Notes()


@pytest.fixture(autouse=True)
def _keeps_or_names_everything(request, monkeypatch):
    """In runs of all tests, assert that each file that a test loads is kept or named."""
    if not does_everything() or request.node.get_closest_marker("damaged"):
        return
    load_any = meshreel.formats.load.load_any

    def load_and_check(source, options):
        sequence = load_any(source, options)
        walk = None if isinstance(source, (list, tuple)) else all_walks().get(Path(source).suffix)
        chosen = (
            options.fps, options.object, options.topology, options.dataset, options.animation,
            options.displace, options.skip_bad or None,
        )  # fmt: skip
        takes_all = options.attributes == "all" and not any(one is not None for one in chosen)
        if walk is not None and takes_all and Path(source).is_file():
            found = balance(list(walk(Path(source))), list(items_of(sequence)), options.notes)
            assert [*found.silent] == []
        return sequence

    monkeypatch.setattr(meshreel.formats.load, "load_any", load_and_check)


@cache
def all_walks():
    """Return the walks whose libraries are installed."""
    has_vtk = find_spec("vtkmodules") is not None
    return {name: walk for name, walk in walks().items() if has_vtk or name not in BY_VTK}
