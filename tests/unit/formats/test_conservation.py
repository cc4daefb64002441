"""Everything in a file is kept or named when it is read, and everything in a sequence when written.

Independent readers in `bench/contents` list what files hold.
"""

from itertools import pairwise

import numpy as np
import pytest

from conformance.sources import boxes, of_type, waving
from conservation import BY_VTK, balance_of_reading, balance_of_writing, merges, walks
from contents.items import Item, Sort, balance
from meshreel import MeshSequence, Track
from meshreel.formats.inspection import inspect_source
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.load import load
from meshreel.formats.options import Reading
from meshreel.formats.registry import FORMATS, is_written
from meshreel.model.notes import Note, NoteKind
from meshreel.model.surface import Surface
from samples.materials import dressed, dressed_sheets
from samples.meshes import cake, hard_sheet
from samples.tracks import tracked_sheet

WALKS = walks()
WRITTEN = sorted(name for name in WALKS if is_written(FORMATS[name]))


def volume():
    """Return hexahedra with values of nodes and cells, at uneven times."""
    points, hexahedra = boxes(3, 2, 2)
    vertices = waving(points, 4)
    heat = Track(vertices[..., 0] + 300, unit="K")
    stress = Track(vertices[:, hexahedra].mean(axis=2), "cell", "vector")
    cells, times = of_type(12, hexahedra), [0, 0.1, 0.2, 0.25]
    return MeshSequence(vertices, cells=cells, times=times, tracks={"heat": heat, "stress": stress})


def disk():
    """Return polygons of 3, 255 and 256 corners."""
    angles = np.linspace(0, 2 * np.pi, 256, endpoint=False)
    ring = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    vertices = np.concatenate([ring, ring + np.eye(3)[2]])[None] * [[[1]], [[2]]]
    rings = [range(256), range(511, 256, -1), (0, 256, 1)]
    faces = [(ring[0], *side) for ring in rings for side in pairwise(ring[1:])]
    sizes = np.array([len(ring) for ring in rings], np.int32)
    return MeshSequence(vertices, np.array(faces), fps=25, surface=Surface(sizes))


SEQUENCES = {
    "surface": lambda: dressed(hard_sheet()),
    "parts": dressed_sheets,
    "tracks": tracked_sheet,
    "edges": cake,
    "cells": volume,
    "polygons": disk,
}


@pytest.mark.parametrize(
    ("other", "note", "is_silent"),
    [
        (Item(Sort.DATA, "/root/Heat", [2, 1, 0, 1 + 1e-7]), "", False),
        (Item(Sort.DATA, "heat", [0, 2]), "", True),
        (Item(Sort.DATA, "heat", [0, 1, 3, 2]), "", True),
        (Item(Sort.DATA, "heat", [0, 0, 2]), "", True),
        (Item(Sort.DATA, "cold", [0, 1, 2]), "", True),
        (Item(Sort.GROUP, "heat"), "", True),
        (
            Item(Sort.GROUP, "heat"),
            Note(NoteKind.LEFT_OUT, "arrays", [*"abcdefghij", "heat"]),
            False,
        ),
        (Item(Sort.GROUP, "heat"), "left out: preheat", True),
        (Item(Sort.GROUP, "heat"), "left out: temperatures", False),
    ],
)
def test_value_is_silent_unless_it_is_kept_or_named(other, note, is_silent):
    item = Item(Sort.DATA, "Mesh:heat", [0, 1, 2], ("temperatures",))
    assert balance([item], [other], [note]).silent == (("data Mesh:heat",) if is_silent else ())


def test_exchanged_components_are_silent():
    rows = np.array([[0, 3], [1, 2], [2, 1], [3, 0.5], [0.5, 0]])
    item, others = (Item(Sort.DATA, "heat", values) for values in (rows, rows[::-1]))
    assert item.matches(others)
    assert not item.matches(Item(Sort.DATA, "heat", rows[:, ::-1]))


@pytest.mark.slow
def test_full_runs_check_every_file_that_a_test_loads(tmp_path, monkeypatch):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\n")
    monkeypatch.setattr(Item, "is_named_in", lambda *_: False)
    with pytest.raises(AssertionError, match="other l"):
        load(tmp_path / "a.obj")


@pytest.mark.parametrize("make", SEQUENCES.values(), ids=SEQUENCES)
@pytest.mark.parametrize("extension", WRITTEN)
def test_contents_of_a_sequence_are_written_or_named(extension, make, tmp_path):
    if extension in BY_VTK:
        pytest.importorskip("vtkmodules")
    sequence = make()
    if not isinstance(FORMATS[extension], SequenceFormat):
        sequence = sequence[:1]
    path = tmp_path / f"a{extension}"
    assert balance_of_writing(sequence, path, WALKS[extension]).silent == ()
    assert balance_of_reading(path, WALKS[extension]).silent == ()
    notes, options = [], {"merge": merges(path)}
    load(path, notes=notes, **options)
    inspected = inspect_source(path, Reading(**options)).notes
    assert [note for note in notes if note.kind is not NoteKind.SEGMENTS] == list(inspected)
