import numpy as np
import pytest

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.errors import ConnectivityChangeError, FormatError, InvalidInputError
from meshreel.formats.load import load, open_for_purpose
from meshreel.formats.options import ReadOptions
from meshreel.formats.save import save
from samples.meshes import waving_grid
from samples.opening import count_runs

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def write_frames(folder, *texts):
    for index, text in enumerate(texts):
        (folder / f"frame_{index}.obj").write_text(text)


@pytest.mark.parametrize("extension", ["obj", "ply", "off"])
@pytest.mark.parametrize(
    ("dtype", "offset"),
    [
        (np.float32, 0.0),
        (np.float32, 90.0),
        (np.float32, 300.0),
        (np.float32, 1e5),
        (np.float64, 1e5),
    ],
)
def test_frame_formats_round_trip(tmp_path, make_sequence, extension, dtype, offset):
    sequence = make_sequence(11, dtype, offset)
    save(sequence, tmp_path / f"f_%d.{extension}")
    loaded = load(tmp_path)
    assert loaded.vertices.dtype == dtype
    np.testing.assert_array_equal(loaded.vertices, sequence.vertices)
    np.testing.assert_array_equal(loaded.faces, sequence.faces)


@pytest.mark.parametrize(
    ("extension", "expected"),
    [("obj", np.float32), ("off", np.float32), ("stl", np.float32), ("ply", np.float64)],
)
def test_float64_near_the_origin_is_float32_in_decimal_text(
    tmp_path, make_sequence, extension, expected
):
    save(make_sequence(2, np.float64), tmp_path / f"f_%d.{extension}")
    assert load(tmp_path).vertices.dtype == expected


def test_stl_frames_round_trip_geometry_with_a_note_on_the_weld(tmp_path, make_sequence, read):
    sequence, notes = make_sequence(3), []
    save(sequence, tmp_path / "f_%d.stl")
    result = read(tmp_path, notes=notes)
    vertices = result.read(0, 3)
    assert vertices.shape == sequence.vertices.shape
    np.testing.assert_array_equal(vertices[:, result.faces], sequence.vertices[:, sequence.faces])
    assert notes == ["welded 24 STL corners to 6 vertices"]


def test_load_keeps_quads_without_a_note(tmp_path, notes):
    write_frames(tmp_path, *[SQUARE + "f 1 2 3 4\n"] * 2)
    loaded = load(tmp_path, notes=notes)
    assert loaded.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert (loaded.surface.face_sizes.tolist(), notes) == ([4], [])


@pytest.mark.parametrize(
    ("name", "fps", "expected"),
    [("f_%d.obj", None, 0), ("f_%d.obj", 24, 24), ("a.npz", None, 30), ("a.npz", 24, 24)],
)
def test_fps_argument_precedes_the_rate_of_the_file(tmp_path, make_sequence, name, fps, expected):
    save(make_sequence(2, fps=30), tmp_path / name)
    assert load(tmp_path / name.replace("%d", "*"), fps=fps).fps == expected


@pytest.mark.parametrize("extension", ["obj", "stl"])
def test_progress_is_reported_for_every_frame(tmp_path, make_sequence, read, extension):
    save(make_sequence(4), tmp_path / f"f_%d.{extension}")
    seen = []
    read(tmp_path, progress=lambda stage, fraction: seen.append((stage, fraction)))
    assert seen == [("reading", 0.25), ("reading", 0.5), ("reading", 0.75), ("reading", 1.0)]


def test_later_float64_frame_widens_the_sequence(tmp_path, make_sequence):
    wide = make_sequence(1, np.float64)
    save(make_sequence(1, np.float32), tmp_path / "f_0.ply")
    save(wide, tmp_path / "f_1.ply")
    assert load(tmp_path).vertices[1].tobytes() == wide.vertices[0].tobytes()


@pytest.mark.parametrize(
    "second",
    [
        SQUARE + "v 2 2 2\nf 1 2 3\n",
        SQUARE + "f 1 2 3\nf 1 3 4\n",
        SQUARE + "f 1 2 3 4\n",
        SQUARE + "f 1 2 4\n",
    ],
)
def test_other_vertices_or_faces_begin_another_segment(tmp_path, second):
    write_frames(tmp_path, SQUARE + "f 1 2 3\n", second)
    assert count_runs(tmp_path) == 2
    message = r"frame_0\.obj: the faces change: 2 frames in 2 segments; a test needs the same"
    with pytest.raises(ConnectivityChangeError, match=message):
        open_for_purpose(tmp_path, ReadOptions(matches_frames=False), "a test")


def test_other_number_of_stl_triangles_begins_another_segment(tmp_path, make_sequence):
    save(make_sequence(1), tmp_path / "f_0.stl")
    (tmp_path / "f_1.stl").write_bytes(bytes(84 - 4) + b"\1\0\0\0" + bytes(50))
    assert [len(one.faces) for one in load(tmp_path).segments] == [8, 1]


@pytest.mark.parametrize("bad", ["nan", "inf", "-inf"])
def test_error_names_file_and_vertex_of_a_non_finite_position(tmp_path, read, bad):
    good = SQUARE + "f 1 2 3\n"
    write_frames(tmp_path, good, good.replace("v 1 1 0", f"v 1 {bad} 0"), good)
    message = rf"frame_1\.obj: every position must be finite; vertex 2 of frame 1 has y = {bad}"
    with pytest.raises(InvalidInputError, match=message):
        read(tmp_path)


def test_parse_error_names_the_file(tmp_path):
    write_frames(tmp_path, SQUARE + "f 1 2 3\n", SQUARE + "f 1 2 x\n")
    with pytest.raises(FormatError, match=r"frame_1\.obj: line 5: expected an integer; got 'x'"):
        load(tmp_path)


@pytest.mark.parametrize("extension", ["obj", "ply", "off", "stl"])
def test_error_for_an_empty_file_names_it(tmp_path, extension):
    (tmp_path / f"a.{extension}").touch()
    with pytest.raises(FormatError, match=rf"a\.{extension}: is empty"):
        load(tmp_path)


def test_reel_streams_are_decoded_at_the_given_rate(tmp_path, read):
    sequence = waving_grid()
    save(sequence, tmp_path / "a.reel")
    result = read(tmp_path / "a.reel", fps=50)
    np.testing.assert_array_equal(result.read(0, 12), decode(encode(sequence)).vertices)
    assert (result.fps, result.name) == (50, "grid")
