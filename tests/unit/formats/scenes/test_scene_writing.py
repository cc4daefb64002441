"""What Alembic and USD files keep of any sequence."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.load import load
from meshreel.kernel.polygons import triangulate
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Surface
from meshreel.model.tracks import Track, domain_sizes
from meshreel.operations.save import save
from samples.meshes import two_sheets
from samples.opening import open_source
from samples.tracks import assert_same_tracks

SIZES = np.array([4, 3, 5], np.int32)
CORNERS = np.array([0, 1, 2, 3, 4, 5, 6, 7, 0, 2, 4, 6], np.int32)
FACES = np.array([[0, 1, 2], [3, 4, 5]])


@pytest.fixture(params=[("alembic3d", "Alembic", "a.abc"), ("pxr", "USD", "a.usdc")], ids=str)
def program_and_path(request, tmp_path):
    library, program, name = request.param
    pytest.importorskip(library)
    return program, tmp_path / name


@pytest.fixture
def path(program_and_path):
    return program_and_path[1]


def animated(n_frames=3, dtype=np.float32, offset=0.0, fps=24.0, **rest):
    vertices = np.random.default_rng(3).standard_normal((n_frames, 8, 3)) + offset
    faces, _ = triangulate(SIZES, CORNERS, vertices[0])
    return MeshSequence(vertices.astype(dtype), faces, fps, surface=Surface(SIZES), **rest)


def saved_and_loaded(path, sequence, notes=None, **choice):
    save(sequence, path, notes=notes)
    return load(path, **choice)


def test_open_source_reads_any_frames_when_positions_stay_in_the_file(path):
    sequence = animated(7)
    save(sequence, path)
    opened = open_source(path, max_loaded_bytes=0)
    assert not isinstance(opened, MeshSequence)
    for start, stop in ((6, 7), (0, 2), (3, 7), (0, 7)):
        np.testing.assert_array_equal(opened.read(start, stop), sequence.vertices[start:stop])


@pytest.mark.parametrize("fps", [1.0, 12.5, 23.976, 24.0, 29.97, 30000 / 1001, 60.0])
@pytest.mark.parametrize("first", [0, 1, 1001, -24])
def test_load_returns_rate_and_start_when_frames_are_at_any_time(path, fps, first):
    loaded = saved_and_loaded(path, animated(fps=fps, start_s=first / fps))
    assert (loaded.fps, loaded.start_s) == (fps, pytest.approx(first / fps, rel=1e-15))


@pytest.mark.parametrize(("fps", "start_s"), [(0.0, 0.0), (24.0, 0.5), (24.0, 2.5), (30.0, 0.0)])
def test_load_returns_rate_and_start_when_there_is_one_frame(path, fps, start_s, notes):
    sequence = animated(1, fps=fps, start_s=start_s)
    loaded = saved_and_loaded(path, sequence, notes)
    assert (loaded.n_frames, loaded.fps, loaded.start_s, notes) == (1, fps, start_s, [])
    np.testing.assert_array_equal(loaded.vertices, sequence.vertices)


def test_save_assumes_24_frames_per_second_when_there_is_no_rate(path, notes):
    assert saved_and_loaded(path, animated(fps=0.0), notes).fps == 24
    assert notes == ["the frame rate is unknown; written as 24 fps"]


@pytest.mark.parametrize(("scale", "n_notes"), [(1 / 3, 1), (0.5, 0)])
def test_save_notes_rounding_when_positions_are_float64(program_and_path, scale, n_notes, notes):
    program, path = program_and_path
    sequence = animated()
    vertices = sequence.vertices.astype(np.float64) * scale
    loaded = saved_and_loaded(path, MeshSequence(vertices, FACES, 24.0), notes)
    np.testing.assert_array_equal(loaded.vertices, vertices.astype(np.float32))
    error = np.abs(loaded.vertices - vertices).max()
    note = f"{program} stores positions as float32: coordinates change by up to {error:.2g}"
    assert notes == [note] * n_notes


def test_save_keeps_a_millionth_when_float64_positions_are_far_from_the_origin(program_and_path):
    program, path = program_and_path
    sequence, notes = animated(dtype=np.float64, offset=[3e8, -4e8, 0.5]), []
    loaded = saved_and_loaded(path, sequence, notes)
    assert loaded.vertices.dtype == np.float64
    assert np.abs(loaded.vertices - sequence.vertices).max() < 3e-7
    assert notes[0].startswith(f"{program} stores positions as float32, relative to the center of")


def test_save_is_exact_when_float32_positions_are_far_from_the_origin(path, notes):
    sequence = animated(offset=1e6)
    loaded = saved_and_loaded(path, sequence, notes)
    np.testing.assert_array_equal(loaded.vertices, sequence.vertices)
    assert notes == []


def test_save_rejects_positions_when_they_exceed_float32(path):
    vertices = np.zeros((1, 8, 3))
    vertices[0, 0], vertices[0, 1] = 1e300, -1e300
    with pytest.raises(InvalidInputError, match=r"up to 3\.4e\+38; got 1e\+300; scale"):
        save(MeshSequence(vertices, FACES), path)
    assert list(path.parent.iterdir()) == []


def test_load_returns_tracks_of_every_domain_when_there_are_several_parts(path):
    sheet = two_sheets()
    sizes = domain_sizes(sheet.n_verts, sheet.n_faces, sheet.surface)
    rng = np.random.default_rng(9)
    tracks = {
        f"of {domain}": Track(rng.random((sheet.n_frames, size)), domain)
        for domain, size in sizes.items()
        if size
    }
    loaded = saved_and_loaded(path, sheet.replace(tracks=tracks), merge=True)
    assert len(loaded.surface.parts) == 2
    assert_same_tracks(loaded.tracks, tracks)
