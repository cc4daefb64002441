import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.model.surface import Domain
from meshreel.model.tracks import Track, TrackKind
from samples.rigs import bending_tube

pytest.importorskip("pxr")


@pytest.mark.parametrize("extension", ["usdc", "usda", "usdz"])
@pytest.mark.parametrize("bulge", [0.0, 0.3])
def test_read_back_positions_are_those_of_the_rig(tmp_path, extension, bulge):
    tube = bending_tube(bulge=bulge)
    bones = 2 if bulge else None
    path = tmp_path / f"tube.{extension}"
    meshreel.save(tube, path, rig=bones or True)
    rig, back = meshreel.rig(tube, bones), meshreel.load(path)
    shown = rig.positions() + rig.origin
    assert np.abs(back.vertices - shown).max() <= 1e-5 * np.ptp(shown)
    np.testing.assert_array_equal(back.faces, tube.faces)
    assert back.fps == 25


def test_tracks_are_left_out(tmp_path):
    tube, notes = bending_tube(bulge=0.3), []
    heat = Track(np.zeros((tube.n_frames, tube.n_verts, 1)), Domain.VERTEX, TrackKind.SCALAR)
    meshreel.save(tube.replace(tracks={"heat": heat}), tmp_path / "a.usdc", rig=2, notes=notes)
    assert any(note.startswith("tracks left out: heat: a rig cannot store") for note in notes)
    assert meshreel.load(tmp_path / "a.usdc").tracks == {}


def test_bound_without_rig_is_refused(tmp_path):
    with pytest.raises(InvalidInputError, match="max_error is a bound of rigs in USD"):
        meshreel.save(bending_tube(), tmp_path / "a.usdc", max_error=1)


def test_frames_at_uneven_times_come_back(tmp_path):
    times = [0, 0.25, 1, 1.25, 1.9999999, 2, 2.25]  # closer than a tolerance of codes
    meshreel.save(bending_tube(7).replace(times=times), tmp_path / "a.usdc", rig=2)
    assert meshreel.load(tmp_path / "a.usdc").times.tolist() == times
