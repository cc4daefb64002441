"""Notes about tracks of solver state."""

import meshreel
from meshreel.codec.solver_state import solver_state_note
from samples.meshes import waving_grid

GRID = waving_grid(6)
NAMES = ("pprevious", "oldP", "previous")


def tracks_of(*names):
    tracks = {name: meshreel.Track(GRID.vertices, kind="vector") for name in names}
    sequence = meshreel.MeshSequence(GRID.vertices, GRID.faces, 25, tracks=tracks)
    return meshreel.info(meshreel.encode(sequence)).tracks


def test_tracks_of_solver_state_are_noted_with_their_bytes():
    tracks = tracks_of(*NAMES)
    sizes = {track.name: track.size_bytes for track in tracks}
    note = solver_state_note(tracks, ())
    assert f"pprevious ({sizes['pprevious']} bytes), oldP ({sizes['oldP']} bytes);" in note
    assert note.endswith("drop these tracks")


def test_requested_tracks_are_not_noted():
    assert "oldP" not in solver_state_note(tracks_of(*NAMES), {"oldP"})
    assert solver_state_note(tracks_of("previous"), ()) is None
