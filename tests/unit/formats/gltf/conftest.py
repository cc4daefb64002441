import pytest

from meshreel.formats.load import load


@pytest.fixture
def read(tmp_path):
    """A function that loads a file, and returns the sequence and the notes."""

    def loaded(file, **options):
        notes = []
        return load(file.save(tmp_path / "a.glb"), notes=notes, **options), notes

    return loaded
