"""Frame files, read and parsed once, and the tracks in PLY and OBJ files."""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.formats.frames.frame_files import FrameFiles, read_runs
from meshreel.formats.frames.stored_frames import FrameSurvey, StoredFrames
from meshreel.formats.load import load, load_any
from meshreel.formats.meshes.obj import read_obj
from meshreel.formats.options import Reading
from meshreel.formats.registry import FRAME_FORMATS
from meshreel.formats.vtk import pvd
from meshreel.model.extent import extent_of
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, Kind
from meshreel.model.tracks import Track, domain_sizes
from meshreel.operations.save import save
from samples.captures import capture
from samples.meshes import assert_same_surface, quad_sheet, two_sheets, waving_grid
from samples.opening import open_source
from samples.tracks import assert_same_tracks

EXTENSIONS = [form.extension for form in FRAME_FORMATS.values() if form.encoder is not None]


def frames_of(folder, extension, *, is_changing=False):
    """Write frames with a track, if the format stores tracks; one or two kinds of faces."""
    sheets = [quad_sheet(6), *([waving_grid(4), quad_sheet(1)] if is_changing else [])]
    for number, sheet in enumerate(sheets):
        tracks = {}
        if FRAME_FORMATS[extension].track_domains:
            values = np.random.default_rng(number).random((sheet.n_frames, sheet.n_verts, 3))
            tracks = {"normals": Track(values.astype("f4"), kind="vector")}
        if extension in (".ply", ".vtp", ".vtu") and tracks:
            tracks = {"heat": Track(tracks["normals"].values[..., :1])}
        save(sheet.replace(tracks=tracks), folder / f"{number}_%02d{extension}", notes=[])
    return folder


@pytest.fixture
def reads(monkeypatch):
    """How often each file was read."""
    counts, read_bytes = Counter(), Path.read_bytes

    def read_counted(path):
        counts[path.name] += 1
        return read_bytes(path)

    monkeypatch.setattr(Path, "read_bytes", read_counted)
    return counts


def with_counted_parses(extension):
    """The format with a list that grows with every parsed file."""
    form, parsed = FRAME_FORMATS[extension], []

    def read(data):
        parsed.append(data)
        return form.read(data)

    return replace(form, read=read), parsed


@pytest.mark.parametrize("is_changing", [False, True])
@pytest.mark.parametrize("extension", EXTENSIONS)
def test_load_reads_each_file_once(tmp_path, reads, extension, is_changing):
    folder = frames_of(tmp_path, extension, is_changing=is_changing)
    sequence = meshreel.load(folder)
    assert sequence.n_segments == (3 if is_changing else 1)
    assert reads == dict.fromkeys((path.name for path in folder.iterdir()), 1)


@pytest.mark.parametrize("is_changing", [False, True])
@pytest.mark.parametrize("max_bytes", [None, 0])
@pytest.mark.parametrize("extension", EXTENSIONS)
def test_frames_are_parsed_once(tmp_path, extension, max_bytes, is_changing):
    folder = frames_of(tmp_path, extension, is_changing=is_changing)
    form, parsed = with_counted_parses(extension)
    paths = sorted(folder.iterdir())
    options = Reading(max_loaded_bytes=max_bytes)
    runs = list(read_runs(FrameFiles(paths, form), "walk", options))
    assert [run.n_frames for run in runs] == ([6, 4, 1] if is_changing else [6])
    assert len(parsed) == len(paths)
    assert isinstance(runs[0], MeshSequence if max_bytes is None else StoredFrames)


@pytest.fixture
def parsed_files(monkeypatch):
    """The contents of the parsed files of a collection."""
    parsed, read = [], pvd.READERS[".vtu"]
    monkeypatch.setitem(pvd.READERS, ".vtu", lambda data: parsed.append(data) or read(data))
    return parsed


@pytest.mark.parametrize("is_changing", [False, True])
@pytest.mark.parametrize("options", [{}, {"skip_bad": True}], ids=str)
def test_files_of_collections_are_parsed_once(tmp_path, parsed_files, options, is_changing):
    expected = load(frames_of(tmp_path, ".vtp", is_changing=is_changing))
    save(expected, tmp_path / "walk.pvd", notes=[])
    loaded = load(tmp_path / "walk.pvd", **options)
    assert len(parsed_files) == loaded.n_frames == (11 if is_changing else 6)
    for run, other in zip(loaded.segments, expected.segments, strict=True):
        positions = [one.read(0, run.n_frames) for one in (run, other)]
        np.testing.assert_array_equal(*positions, strict=True)
        assert_same_tracks(run.tracks, other.tracks)


def test_files_of_collections_are_parsed_again_for_what_is_not_kept(tmp_path, parsed_files):
    save(load(frames_of(tmp_path, ".vtp")), tmp_path / "walk.pvd", notes=[])
    opened = open_source(tmp_path / "walk.pvd")
    assert len(parsed_files) == 6 + 1  # the attributes of the first frame
    opened.tracks["heat"].read(2, 5)
    assert len(parsed_files) == 6 + 1 + 3


@pytest.mark.parametrize(
    ("share", "expected"),
    [(3, [MeshSequence, StoredFrames, MeshSequence]), (0, [StoredFrames] * 3)],
)
@pytest.mark.parametrize("extension", [".ply", ".vtp", ".stl"])
def test_runs_stay_in_their_files_once_they_take_the_limit_together(
    tmp_path, extension, share, expected
):
    folder = frames_of(tmp_path, extension, is_changing=True)
    paths, form = sorted(folder.iterdir()), FRAME_FORMATS[extension]
    loaded = list(read_runs(FrameFiles(paths, form), "walk", Reading()))
    size = share * loaded[0].read(0, 6).nbytes
    options = Reading(max_loaded_bytes=size)
    mixed = list(read_runs(FrameFiles(paths, form), "walk", options))
    assert [type(run) for run in mixed] == expected
    for run, other in zip(mixed, loaded, strict=True):
        positions = [one.read(0, run.n_frames) for one in (run, other)]
        np.testing.assert_array_equal(*positions, strict=True)
        np.testing.assert_array_equal(run.faces, other.faces)
        assert_same_surface(run.surface, other.surface)
        assert_same_tracks(run.tracks, other.tracks)
        np.testing.assert_array_equal(run.extent.low, other.extent.low)


def test_single_frames_count_with_their_faces(tmp_path):
    save(capture(6), tmp_path / "frame_%02d.ply", notes=[])
    files = FrameFiles(sorted(tmp_path.iterdir()), FRAME_FORMATS[".ply"])
    runs = read_runs(files, "walk", Reading())
    loaded = [run for run in runs if isinstance(run, MeshSequence)]
    size = sum(run.raw_size_bytes for run in loaded[:2])
    runs = read_runs(files, "walk", Reading(max_loaded_bytes=size))
    kinds = [isinstance(run, StoredFrames) for run in runs]
    assert kinds == [False, False, *(len(loaded) - 2) * [True]]


def survey_of(*blocks, is_decimal=True):
    survey = FrameSurvey(is_decimal=is_decimal)
    for block in blocks:
        survey.add(block)
    return survey


def moving(dtype=np.float64):
    return np.random.default_rng(0).standard_normal((3, 50, 3)).astype(dtype)


@pytest.mark.parametrize(
    ("blocks", "is_decimal", "expected"),
    [
        ([moving()], True, "f4"),
        ([np.add(moving(), [[[0]], [[0]], [[1e4]]])], True, "f8"),
        ([moving() * [[[1]], [[0]], [[1]]] + 0.1], True, "f4"),  # one frame is a point
        ([np.array([[[-1e39, 0, 0], [1e39, 0, 0]]])], True, "f8"),
        ([np.array([[[-1.7e308, 0, 0], [1.7e308, 0, 0]]])], True, "f8"),
        ([moving("f4"), moving("f8")], False, "f8"),
        ([moving("f8"), moving("f4")], False, "f8"),
        ([moving("f4")], False, "f4"),
    ],
)
def test_type_is_the_declared_one_or_precise_enough_for_decimal_text(blocks, is_decimal, expected):
    assert survey_of(*blocks, is_decimal=is_decimal).dtype == expected


@pytest.mark.parametrize("is_decimal", [False, True])
def test_survey_extent_covers_all_blocks(is_decimal):
    vertices = moving()
    survey = survey_of(vertices[:1], vertices[1:], is_decimal=is_decimal)
    expected = extent_of(vertices.astype(survey.dtype))
    assert survey.extent.low.tobytes() == expected.low.tobytes()
    assert survey.extent.high.tobytes() == expected.high.tobytes()
    assert survey.extent.mean_diagonal == expected.mean_diagonal


RNG = np.random.default_rng(12)
N_FRAMES = 4

PLY = """ply
format ascii 1.0
element vertex 3
property float x
property float y
property float z
{vertex}element face 1
property list uchar int vertex_indices
{face}end_header
"""


def bare(sheet):
    return sheet.replace(surface=replace(sheet.surface, attributes=(), groups=()))


def normals_of(shape, dtype=np.float32):
    normals = RNG.normal(size=(*shape, 3))
    return (normals / np.linalg.norm(normals, axis=-1, keepdims=True)).astype(dtype)


def sizes_of(sheet):
    return domain_sizes(sheet.n_verts, sheet.n_faces, sheet.surface)


def tracked_frames(folder, extension, texts):
    for number, text in enumerate(texts):
        (folder / f"f_{number}{extension}").write_text(text)
    return folder


@pytest.mark.parametrize("dtype", ["u1", "i1", "i2", "u2", "i4", "u4", "f4", "f8"])
def test_ply_tracks_round_trip_exactly(tmp_path, read, dtype, notes):
    sheet = quad_sheet(N_FRAMES)
    n_faces = sizes_of(sheet)[Domain.FACE]
    given = [(250 * RNG.random((N_FRAMES, n))).astype(dtype) for n in (sheet.n_verts, n_faces)]
    if dtype[0] == "f":
        given[0][0, :3] = np.nan, np.inf, -0.0
    tracks = {"stress": Track(given[0]), "flag": Track(given[1], "face")}
    save(sheet.replace(tracks=tracks), tmp_path / "f_%02d.ply")
    result = read(tmp_path, notes=notes)
    assert isinstance(result, StoredFrames) == (read is open_source)
    assert_same_tracks(result.tracks, tracks)
    assert {attribute.name for attribute in result.surface.attributes} == {"color", "uv"}
    assert notes == []


@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_ply_color_normal_and_uv_tracks_round_trip(tmp_path, read, dtype):
    sheet = bare(quad_sheet(N_FRAMES))
    sizes = sizes_of(sheet)
    shape = N_FRAMES, sheet.n_verts
    tracks = {
        "color": Track(RNG.integers(0, 256, (*shape, 4)).astype("u1"), kind="color"),
        "normals": Track(normals_of(shape, dtype), kind="normal"),
        "uv": Track(RNG.random((*shape, 2)).astype(dtype), kind="uv"),
    }
    save(sheet.replace(tracks=tracks), tmp_path / "a" / "f_%02d.ply")
    assert_same_tracks(read(tmp_path / "a").tracks, tracks)
    tracks = {
        "color": Track(
            2 * RNG.random((N_FRAMES, sizes[Domain.FACE], 3)).astype(dtype), "face", "color"
        ),
        "uv": Track(RNG.random((N_FRAMES, sizes[Domain.CORNER], 2)).astype(dtype), "corner", "uv"),
    }
    save(sheet.replace(tracks=tracks), tmp_path / "b" / "f_%02d.ply")
    assert_same_tracks(read(tmp_path / "b").tracks, tracks)  # beyond 0..1, thus floats


def test_trimesh_reads_colors_and_normals_of_ply_frames(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    sheet = bare(two_sheets())
    shape = sheet.n_frames, sheet.n_verts
    colors, normals = RNG.integers(0, 256, (*shape, 4)).astype("u1"), normals_of(shape)
    stress = RNG.random(shape).astype("f4")
    tracks = {
        "color": Track(colors, kind="color"),
        "normals": Track(normals, kind="normal"),
        "stress": Track(stress),
    }
    paths = save(sheet.replace(tracks=tracks), tmp_path / "f_%02d.ply")
    for frame, path in enumerate(paths):
        loaded = trimesh.load(path, process=False)
        assert np.array_equal(loaded.visual.vertex_colors, colors[frame])
        raw = loaded.metadata["_ply_raw"]["vertex"]["data"]
        assert np.array_equal(raw["stress"], stress[frame])
        assert np.array_equal(np.stack([raw[n] for n in ("nx", "ny", "nz")], 1), normals[frame])


def test_notes_explain_tracks_that_ply_cannot_store(tmp_path, notes):
    sheet = quad_sheet(2)
    shape = (2, sheet.n_verts)
    corners = sizes_of(sheet)[Domain.CORNER]
    tracks = {
        "flow": Track(RNG.normal(size=(*shape, 3)), kind="velocity"),
        "tensor": Track(RNG.normal(size=(*shape, 9))),
        "wear": Track(RNG.normal(size=(2, corners)), "corner"),
        "paint": Track(RNG.random((*shape, 3)), kind="color"),
        "hash": Track(RNG.integers(2**40, 2**41, shape)),
        "id": Track(RNG.integers(0, 99, shape)),
        "heat flux": Track(RNG.random(shape), unit="W/m²"),
        "red": Track(RNG.random(shape)),
    }
    save(sheet.replace(tracks=tracks), tmp_path / "f_%02d.ply", notes=notes)
    said = [note for note in notes if not note.startswith("left out")]
    assert said == [
        "track 'id' is written as int32, not int64",
        "track 'heat flux' is called 'heat_flux' in .ply files",
        "track 'red' is called 'red_' in .ply files",
        "tracks left out: flow, tensor, wear: .ply cannot store vectors, or several "
        "components that are not colors, normals or UV coordinates",
        "tracks left out: paint: .ply cannot store more than one color, normal or UV track of "
        "each domain",
        "tracks left out: hash: .ply cannot store integers beyond 32 bits",
        "units left out: heat flux (W/m²): .ply cannot store them",
    ]
    result = load(tmp_path).tracks
    assert set(result) == {"id", "heat_flux", "red_"}
    assert np.array_equal(result["id"].values, tracks["id"].values)


def test_property_of_some_frames_is_nan_in_the_others(tmp_path, read, notes):
    rows = "0 0 0{a}\n1 0 0{b}\n0 1 0{c}\n3 0 1 2\n"
    plain = PLY.format(vertex="", face="") + rows.format(a="", b="", c="")
    heat = PLY.format(vertex="property float heat\n", face="") + rows.format(a=" 1", b=" 2", c=" 3")
    result = read(tracked_frames(tmp_path, ".ply", [plain, heat, plain]), notes=notes)
    values = result.tracks["heat"].read(0, 3)[..., 0]
    assert np.array_equal(values, [[np.nan] * 3, [1, 2, 3], [np.nan] * 3], equal_nan=True)
    assert notes == ["'heat' is in 1 of 3 frames, and NaN in the others"]


def test_constant_properties_are_attributes(tmp_path, notes):
    rows = "0 0 {0} 1 0 0 1\n1 0 0 2 0 0 1\n0 1 0 3 0 0 1\n3 0 1 2 7\n"
    more = "".join(f"property float {name}\n" for name in ("heat", "nx", "ny", "nz"))
    text = PLY.format(vertex=more, face="property int id\n") + rows
    texts = [text.replace("{0}", str(i)) for i in range(3)]
    loaded = load(tracked_frames(tmp_path, ".ply", texts), notes=notes)
    assert loaded.tracks == {}
    assert [attribute.name for attribute in loaded.surface.attributes] == ["heat", "id"]
    assert notes == ["left out: normals, which programs compute"]


@pytest.mark.parametrize("domain", [Domain.VERTEX, Domain.CORNER])
@pytest.mark.parametrize("make", [lambda n: quad_sheet(n), lambda n: two_sheets(n)])
def test_obj_color_and_normal_tracks_round_trip(tmp_path, read, domain, make, notes):
    sheet = bare(make(N_FRAMES))
    n_items = sizes_of(sheet)[domain]
    tracks = {
        "color": Track(RNG.random((N_FRAMES, sheet.n_verts, 3)).astype("f4"), kind="color"),
        "normals": Track(normals_of((N_FRAMES, n_items)), domain, "normal"),
    }
    save(sheet.replace(tracks=tracks), tmp_path / "f_%02d.obj", notes=notes)
    result = read(tmp_path, notes=notes)
    assert_same_tracks(result.tracks, tracks)
    assert np.array_equal(result.read(0, N_FRAMES), sheet.vertices)
    # Random corner normals make every edge hard.
    [times] = [note for note in notes if "hard edges" not in note]
    assert times.endswith(
        "cannot store it: the frame rate of 24 per second, the start at 41.7083 s"
    )


def test_hard_edges_that_are_not_searched_are_noted(tmp_path):
    corners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 1\n"
    for groups, has_edges in ((("s 1\n", "s 2\n"), True), (("", ""), False)):
        path = tmp_path / f"{has_edges}.obj"
        path.write_text(f"{corners}{groups[0]}f 1 2 3\n{groups[1]}f 1 3 4\n")
        found, notes = load_any(path, Reading()), Notes()
        assert (found.surface.hard_edges is not None) == has_edges
        result = load_any(path, Reading(finds_hard_edges=False, notes=notes))
        assert result.surface.hard_edges is None
        assert any("hard edges" in note for note in notes) == has_edges


def test_obj_corner_uv_tracks_round_trip(tmp_path, read):
    sheet = bare(quad_sheet(N_FRAMES))
    uv = RNG.random((N_FRAMES, sizes_of(sheet)[Domain.CORNER], 2)).astype("f4")
    normals = normals_of((N_FRAMES, sheet.n_verts))
    tracks = {"uv": Track(uv, "corner", "uv"), "normals": Track(normals, kind="normal")}
    save(sheet.replace(tracks=tracks), tmp_path / "f_%02d.obj")
    assert_same_tracks(read(tmp_path).tracks, tracks)


def test_trimesh_reads_colors_and_normals_of_obj_frames(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    sheet = bare(quad_sheet(2))
    shape = 2, sheet.n_verts
    normals, colors = normals_of(shape), RNG.integers(0, 256, (*shape, 3)) / 255
    tracks = {"normals": Track(normals, kind="normal"), "color": Track(colors, kind="color")}
    for frame, path in enumerate(save(sheet.replace(tracks=tracks), tmp_path / "f_%02d.obj")):
        loaded = trimesh.load(path, process=False, maintain_order=True)
        np.testing.assert_allclose(loaded.vertices, sheet.vertices[frame], atol=1e-7)
        np.testing.assert_allclose(loaded.vertex_normals, normals[frame], atol=1e-6)
        shown = loaded.visual.vertex_colors[:, :3] / 255
        np.testing.assert_allclose(shown, colors[frame], atol=1 / 255)


def test_notes_explain_tracks_that_obj_cannot_store(tmp_path, notes):
    sheet = quad_sheet(2)
    shape = (2, sheet.n_verts)
    tracks = {
        "stress": Track(RNG.random(shape)),
        "Cd": Track(RNG.random((*shape, 4)), kind="color"),
        "N": Track(normals_of(shape, np.float64), kind="normal", unit="1"),
        "flat": Track(normals_of((2, sizes_of(sheet)[Domain.FACE])), "face", "normal"),
    }
    only_uv = tuple(
        attribute for attribute in sheet.surface.attributes if attribute.kind is Kind.UV
    )
    shown = sheet.replace(surface=replace(sheet.surface, attributes=only_uv), tracks=tracks)
    save(shown, tmp_path / "f_%02d.obj", notes=notes)
    assert [note for note in notes if not note.startswith("left out")] == [
        "track 'Cd' is called 'color' in .obj files",
        "track 'Cd' is written as float32, not float64",
        "alpha of track 'Cd' left out: .obj does not store it",
        "track 'N' is called 'normals' in .obj files",
        "track 'N' is written as float32, not float64",
        "tracks left out: stress, flat: .obj cannot store tracks other than vertex colors, "
        "normals and UV coordinates",
        "units left out: N (1): .obj cannot store them",
    ]
    loaded = load(tmp_path)
    assert set(loaded.tracks) == {"color", "normals"}
    assert [attribute.kind for attribute in loaded.surface.attributes] == [Kind.UV]


def test_surface_colors_take_precedence_over_a_color_track(tmp_path, notes):
    sheet = bare(quad_sheet(2))
    colors = Attribute("paint", Kind.COLOR, Domain.VERTEX, np.full((sheet.n_verts, 3), 0.5, "f4"))
    tracks = {"glow": Track(RNG.random((2, sheet.n_verts, 3)).astype("f4"), kind="color")}
    surface = replace(sheet.surface, attributes=(colors,))
    sheet = sheet.replace(surface=surface, tracks=tracks)
    save(sheet, tmp_path / "f_%02d.obj", notes=notes)
    assert "tracks left out: glow: .obj cannot store more than one color" in notes[1]
    assert load(tmp_path).tracks == {}


CORNERS = "v 0 0 0\nv 1 0 0\nv 0 1 0\n{}"


@pytest.mark.parametrize(
    ("text", "domain", "expected"),
    [
        (
            "vn 0 0 1\nvn 0 1 0\nvn 1 0 0\nf 1//1 2//2 3//3\n",
            "vertex",
            [[0, 0, 1], [0, 1, 0], [1, 0, 0]],
        ),
        ("vn 0 0 1\nf 1//1 2//1 3//1\n", "corner", [[0, 0, 1]] * 3),
        ("vt 0 0\nvn 0 0 1\nf 1/1/-1 2/1/1 3/1/-1\n", "corner", [[0, 0, 1]] * 3),
        ("vn 0 0 1\nf 1//1 2 3//5\n", "corner", [[0, 0, 1], [np.nan] * 3, [np.nan] * 3]),
        ("vn 0 0\nvn 0 0 1\nf 1//1 2//2 3//2\n", "corner", [[np.nan] * 3, [0, 0, 1], [0, 0, 1]]),
    ],
)
def test_obj_normals_follow_the_indices_of_corners(text, domain, expected):
    [(key, (values, field))] = [
        item
        for item in read_obj(CORNERS.format(text).encode()).fields.items()
        if item[0][1] != "uv"
    ]
    assert key == (domain, "normals")
    assert field.role == "Normals"
    assert np.array_equal(values, np.float32(expected), equal_nan=True)


def test_invalid_obj_normals_are_ignored():
    text = CORNERS.format("vn 0 0 -nan(ind)\nf 1//1 2//1 3//1\n")
    assert read_obj(text.encode()).fields == {}


PLAIN = "v 0 0 {0}\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nf 1/1 2/2 3/1\n"


def test_uv_that_change_in_one_frame_are_a_track(tmp_path):
    texts = [PLAIN.format(i) for i in range(6)]
    texts[4] = texts[4].replace("vt 1 0", "vt 1 0.5")
    loaded = load(tracked_frames(tmp_path, ".obj", texts))
    assert loaded.surface.attributes == ()
    expected = np.tile(np.float32([[0, 0], [1, 0], [0, 0]]), (6, 1, 1))
    expected[4, 1, 1] = 0.5
    assert np.array_equal(loaded.tracks["uv"].values, expected)
