"""Blocks that reuse fields of their key block, and new key blocks."""

import numpy as np
import pytest

import meshreel
from meshreel.codec.reel.encoding import analysis
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.engine.processes import ProcessExecutor
from samples.meshes import grid_faces
from samples.streams import layouts, recorded

N, SIDE = 60, 17
PLACES = np.stack(np.meshgrid(*[np.linspace(0, 1, SIDE)] * 2), axis=-1).reshape(-1, 2)
X, Y = PLACES.T


def waves(times, *numbers):
    """A sheet of shape (T, V, 3) with standing waves of these wave numbers."""
    heights = sum(
        0.1 * np.sin(number * np.pi * X) * np.cos((number - 1) * Y) * np.sin(number * times / 7)
        for number in numbers
    )
    flat = np.broadcast_to(PLACES, (len(times), *PLACES.shape))
    return np.dstack([flat, heights]).astype(np.float32)


TIMES = np.arange(N, dtype=float)[:, None]
LOOPED = meshreel.MeshSequence(waves(TIMES, 1, 2, 3), grid_faces(SIDE, SIDE))
HELD_FIRST = meshreel.MeshSequence(
    np.concatenate([waves(np.ones((12, 1)), 1), waves(TIMES, *range(1, 17))]), LOOPED.faces
)
OPTIONS = {"quality": 85, "block_frames": 12}


@pytest.mark.slow
def test_reused_fields_save_bytes_for_repeated_motion(monkeypatch):
    data = meshreel.encode(LOOPED, **OPTIONS)
    first, *others = layouts(data)
    assert first.n_reused == 0
    assert all(other.n_reused > 0 for other in others)
    error = meshreel.compare(LOOPED, meshreel.decode(data)).kg_error_percent
    monkeypatch.setattr(analysis, "_analyze_reusing", lambda *_: None)
    alone = meshreel.encode(LOOPED, **OPTIONS)
    assert not any(layout.n_reused for layout in layouts(alone))
    assert len(data) < 0.85 * len(alone)
    assert error < 1.3 * meshreel.compare(LOOPED, meshreel.decode(alone)).kg_error_percent


def test_error_bound_holds_with_reused_fields():
    data = meshreel.encode(LOOPED, max_error=0.05, block_frames=12)
    assert any(layout.n_reused for layout in layouts(data))
    assert 0.01 < meshreel.compare(LOOPED, meshreel.decode(data)).max_error_percent <= 0.05


@pytest.mark.slow
def test_error_target_is_met_with_reused_fields():
    data = meshreel.encode(LOOPED, kg=1.0, block_frames=12)
    assert any(layout.n_reused for layout in layouts(data))
    assert 0.98 < meshreel.compare(LOOPED, meshreel.decode(data)).kg_error_percent <= 1.0


def test_block_with_reused_fields_decodes_alone(tmp_path):
    path = tmp_path / "looped.reel"
    path.write_bytes(meshreel.encode(LOOPED, **OPTIONS))
    together = meshreel.decode(path).vertices
    with meshreel.open(path) as reel:
        np.testing.assert_array_equal(reel[-1].vertices, together[-1])
        np.testing.assert_array_equal(reel[13].vertices, together[13])


def test_block_becomes_a_key_block_when_the_previous_one_does_not_help():
    result = layouts(meshreel.encode(HELD_FIRST, **OPTIONS))
    assert [one.reference for one in result] == [0, 0, 1, 2, 3, 4]
    assert all(one.n_reused for one in result[2:])


@pytest.mark.slow
def test_workers_give_the_same_bytes_with_several_key_blocks():
    alone = meshreel.encode(HELD_FIRST, **OPTIONS)
    with ProcessExecutor(2) as executor:
        engine = Engine(executor, 2)
        assert meshreel.encode(HELD_FIRST, engine=engine, **OPTIONS) == alone


@pytest.mark.slow
def test_pushed_frames_reuse_fields_and_keep_tracks_across_key_blocks():
    velocity = 25 * np.gradient(HELD_FIRST.vertices, axis=0)
    tracks = {"velocity": meshreel.Track(velocity, kind="velocity")}
    sequence = HELD_FIRST.replace(fps=25.0, tracks=tracks)
    data = recorded(sequence, tracks={"velocity": "1%"}, **OPTIONS)
    assert [layout.reference for layout in layouts(data)][:3] == [0, 0, 1]
    assert meshreel.compare(HELD_FIRST, meshreel.decode(data)).kg_error_percent < 2
