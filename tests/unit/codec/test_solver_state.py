"""Notes about tracks of solver state."""

from dataclasses import replace

import meshreel
from meshreel.codec.solver_state import solver_state_note
from samples.meshes import waving_grid

GRID = waving_grid(6)
NAMES = ("pprevious", "oldP", "previous")


def tracks_of(*names):
    tracks = {name: meshreel.Track(GRID.vertices, kind="vector") for name in names}
    sequence = meshreel.MeshSequence(GRID.vertices, GRID.faces, 25, tracks=tracks)
    return meshreel.info(meshreel.encode(sequence)).tracks


def test_tracks_of_solver_state_are_noted_with_all_sizes():
    tracks = tracks_of(*NAMES)
    heavy, light = replace(tracks[2], size_bytes=182_091), replace(tracks[0], size_bytes=1_200)
    note = solver_state_note([light, replace(tracks[1], size_bytes=26_694), heavy], ())
    assert ": pprevious, oldP; tracks by size: " in note
    assert "previous (182 kB), oldP (26.7 kB), pprevious (1.2 kB);" in note
    assert note.endswith("drop these tracks")


def test_requested_tracks_are_not_noted():
    assert "oldP" not in solver_state_note(tracks_of(*NAMES), {"oldP"})
    assert solver_state_note(tracks_of("previous"), ()) is None
