from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.solvers.ensight_files import read_lines
from samples.datasets import positions_of, read_damaged
from samples.ensight import FORMATS, block, case, geometry, part, variable

CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
FACES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [9, 9, 9]])
STEPS = [np.float32(SQUARE * (1 + index) + [0, 0, index / 4]) for index in range(3)]
TRIANGLES = [[0, 1, 2], [0, 2, 3]]


def store(folder, text, **files):
    for name, data in files.items():
        (folder / name).write_bytes(data)
    (folder / "a.case").write_text(text)
    return folder / "a.case"


def moving(folder, form, variables=(), times=(0.5, 0.75, 1.0), **files):
    """Write a moving square of two triangles, whose last node has no face."""
    for index, points in enumerate(STEPS):
        data = geometry(form, part(form, 1, "sheet", points, block(form, "tria3", TRIANGLES)))
        files[f"g{3 + 2 * index:03}"] = data
    return store(folder, case("1 g***", variables, times), **files)


@pytest.mark.parametrize("form", FORMATS)
def test_positions_and_times_are_those_of_the_files(tmp_path, form):
    loaded = load(moving(tmp_path, form))
    assert loaded.vertices.tobytes() == np.array(STEPS).tobytes()
    assert loaded.faces.tolist() == TRIANGLES
    assert (loaded.fps, loaded.start_s, loaded.name) == (4.0, 0.5, "sheet")


@pytest.mark.parametrize("form", FORMATS)
def test_numbers_and_extents_are_skipped(tmp_path, form):
    square = block(form, "quad4", [[0, 1, 2, 3]], numbers=True)
    body = part(form, 4, "body", SQUARE, square, numbers=True)
    data = geometry(form, body, numbers="given", extents=True)
    loaded = load(store(tmp_path, case("g"), g=data))
    assert loaded.vertices[0].tolist() == SQUARE.tolist()
    assert loaded.surface.face_sizes.tolist() == [4]


SOLIDS = {
    "tetra4": ([0, 1, 3, 4], 4, 1 / 6),
    "pyramid5": ([0, 1, 2, 3, 4], 5, 1 / 3),
    "penta6": ([0, 1, 3, 4, 5, 7], 5, 1 / 2),
    "hexa8": (range(8), 6, 1),
    "tetra10": ([0, 1, 3, 4, 6, 6, 6, 6, 6, 6], 4, 1 / 6),
    "penta15": ([0, 1, 3, 4, 5, 7, *[6] * 9], 5, 1 / 2),
    "hexa20": ([*range(8), *[6] * 12], 6, 1),
}


@pytest.mark.parametrize("form", ["text", "<"])
@pytest.mark.parametrize("kind", SOLIDS)
def test_surfaces_of_solids_face_outward(tmp_path, form, kind):
    nodes, n_faces, volume = SOLIDS[kind]
    body = part(form, 1, "body", CUBE, block(form, kind, [[*nodes]]))
    loaded = load(store(tmp_path, case("g"), g=geometry(form, body)))
    corners = loaded.vertices[0].astype(float)[loaded.faces]
    assert loaded.surface.n_faces(len(loaded.faces)) == n_faces
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(volume)


@pytest.mark.parametrize("form", FORMATS)
def test_polygons_and_polyhedra_have_any_number_of_corners(tmp_path, form):
    points = np.concatenate([CUBE, CUBE + np.array([0, 0, 1])])
    upper = [[8 + node for node in face] for face in FACES]
    shared = [[4, 7, 6, 5], *FACES[:1], *FACES[2:]]
    upper[0] = [4, 5, 6, 7]
    solids = block(form, "nfaced", [*shared, *upper], sizes=([6, 6], [4] * 12))
    pentagon = block(form, "nsided", [[0, 1, 2, 3, 4], [5, 6, 7]], sizes=([5, 3],))
    body = part(form, 1, "body", points, solids, pentagon)
    loaded = load(store(tmp_path, case("g"), g=geometry(form, body)))
    assert sorted(loaded.surface.face_sizes.tolist()) == [3] + [4] * 10 + [5]


def test_polyhedra_with_bad_faces_are_an_error(tmp_path):
    for sizes in ([4] * 5 + [2], [4] * 5 + [300]):
        nodes = [*FACES[:5], [0] * sizes[5]]
        body = part("<", 1, "body", CUBE, block("<", "nfaced", nodes, sizes=([6], sizes)))
        with pytest.raises(FormatError, match="a polyhedron has a face"):
            load(store(tmp_path, case("g"), g=geometry("<", body)))


@pytest.mark.parametrize("form", FORMATS)
def test_variables_are_tracks(tmp_path, form):
    rng = np.random.default_rng(0)
    heat = rng.integers(0, 9, (3, 5)).astype(np.float32)
    speed = rng.integers(0, 9, (3, 5, 3)).astype(np.float32)
    load_ = rng.integers(0, 9, (3, 2, 6)).astype(np.float32)
    files = {"fixed": variable(form, (1, {"tria3": [3.0, 4.0]}))}
    for index in range(3):
        number = f"{3 + 2 * index:02}"
        files[f"h{number}"] = variable(form, (1, {"coordinates": heat[index]}))
        files[f"s{number}"] = variable(form, (1, {"coordinates": speed[index]}))
        files[f"l{number}"] = variable(form, (1, {"tria3": load_[index]}))
    lines = [
        "scalar per node: 1 heat h**",
        "vector per node: 1 speed s**",
        "tensor symm per element: 1 load l**",
        "scalar per element: fixed fixed",
    ]
    loaded = load(moving(tmp_path, form, lines, **files))
    assert loaded.tracks["heat"].values.reshape(3, 5).tolist() == heat.tolist()
    assert loaded.tracks["speed"].values.tolist() == speed.tolist()
    assert loaded.tracks["load"].values.tolist() == load_.tolist()
    assert loaded.tracks["fixed"].values.reshape(3, 2).tolist() == [[3, 4]] * 3


@pytest.mark.parametrize("form", FORMATS)
def test_tables_are_read_once(tmp_path, form, monkeypatch):
    """Geometry files are read for positions and elements, and not again for values."""
    heat = np.arange(15, dtype=np.float32).reshape(3, 5)
    files = {f"h{3 + 2 * i:02}": variable(form, (1, {"coordinates": heat[i]})) for i in range(3)}
    path, reads = moving(tmp_path, form, ["scalar per node: 1 heat h**"], **files), []
    read_numbers: Any = np.fromfile

    def read_counted(path, *args, offset=0):
        reads.append((path.name, offset))
        return read_numbers(path, *args, offset=offset)

    monkeypatch.setattr(np, "fromfile", read_counted)
    monkeypatch.setattr(
        "meshreel.formats.solvers.ensight.read_lines",
        lambda path: reads.append(path.name) or read_lines(path),
    )
    assert load(path).tracks["heat"].values.reshape(3, 5).tolist() == heat.tolist()
    assert len(reads) == len(set(reads)) >= 6


def test_undefined_values_and_missing_types_are_nan(tmp_path, notes):
    quad = block("<", "quad4", [[0, 1, 2, 3]])
    body = part("<", 1, "body", SQUARE, block("<", "tria3", TRIANGLES), quad)
    values = variable("<", (1, {"tria3 undef": (-1, [5.0, -1.0])}))
    lines = ["scalar per element: heat h", "complex scalar per node: wave r i 2.0"]
    path = store(tmp_path, case("g", lines), g=geometry("<", body), h=values)
    loaded = load(path, notes=notes)
    np.testing.assert_array_equal(loaded.tracks["heat"].values.ravel(), [5, np.nan, np.nan])
    assert "left out: variables: wave (complex scalar per node)" in notes


@pytest.mark.damaged  # VTK misreads them
def test_partial_values_are_left_out_with_a_note(tmp_path, notes):
    values = variable("<", (1, {"coordinates partial": [5.0]}))
    loaded = load(moving(tmp_path, "<", ["scalar per node: heat h"], h=values), notes=notes)
    assert not loaded.tracks
    assert "left out: variable 'heat': h has partial values, which are not supported" in notes


@pytest.mark.parametrize("form", FORMATS)
def test_elements_can_be_in_the_file_of_one_step(tmp_path, form):
    files = {}
    for index, points in enumerate(STEPS):
        blocks = [block(form, "tria3", TRIANGLES)] if index == 1 else []
        files[f"g{3 + 2 * index}"] = geometry(form, part(form, 1, "sheet", points, *blocks))
    text = case("1 g* change_coords_only 1", times=[0, 1, 2])
    loaded = load(store(tmp_path, text, **files))
    assert loaded.vertices.tobytes() == np.array(STEPS).tobytes()


def test_numbers_of_nodes_must_fit_the_elements(tmp_path):
    sheet = part("<", 1, "sheet", SQUARE, block("<", "tria3", TRIANGLES))
    files = {"g3": geometry("<", sheet), "g5": geometry("<", part("<", 1, "sheet", SQUARE[:2]))}
    path = store(tmp_path, case("1 g* change_coords_only", times=[0, 1]), **files)
    with pytest.raises(FormatError, match="has 2 nodes in part 1 of g5; its elements are for 5"):
        load(path)


def test_parts_must_exist_in_all_frames(tmp_path):
    path = moving(tmp_path, "<")
    (tmp_path / "g005").write_bytes(geometry("<"))
    with pytest.raises(FormatError, match="has no part 1 in g005; all parts must exist"):
        load(path)


def test_changing_elements_begin_a_segment(tmp_path):
    path = moving(tmp_path, "<")
    one = part("<", 1, "sheet", STEPS[2], block("<", "tria3", TRIANGLES[:1]))
    (tmp_path / "g007").write_bytes(geometry("<", one))
    loaded = load(path)
    assert [(one.n_frames, len(one.faces)) for one in loaded.segments] == [(2, 2), (1, 1)]
    data = meshreel.encode(loaded, max_error="0.001u")
    for number, segment in enumerate(loaded.segments):
        back = meshreel.decode(data, segment=number)
        assert abs(positions_of(segment) - back.vertices).max() <= 0.001


def test_variables_of_a_geometry_at_rest_have_its_frames(tmp_path):
    body = geometry("<", part("<", 1, "sheet", SQUARE, block("<", "tria3", TRIANGLES)))
    heat = {f"h{3 + 2 * i}": variable("<", (1, {"coordinates": np.full(5, i)})) for i in range(3)}
    text = case("g", ["scalar per node: 1 heat h*"], [0, 1, 2])
    loaded = load(store(tmp_path, text, g=body, **heat))
    assert loaded.n_frames == 3
    assert loaded.tracks["heat"].values[:, 0].ravel().tolist() == [0, 1, 2]


def test_a_geometry_with_one_time_has_one_frame(tmp_path, notes):
    body = geometry("<", part("<", 1, "sheet", SQUARE, block("<", "tria3", TRIANGLES)))
    more = "time set: 2\nnumber of steps: 2\nfilename numbers: 1 2\ntime values: 0 9\n"
    text = case("1 g*", ["scalar per node: 2 heat h*"], [0.5], more)
    loaded = load(store(tmp_path, text, g3=body), notes=notes)
    assert (loaded.n_frames, loaded.start_s, dict(loaded.tracks)) == (1, 0.5, {})
    assert "left out: variables at other times than the geometry: heat" in notes


def test_variables_at_other_times_are_left_out_with_a_note(tmp_path, notes):
    """Those of a time set with more times than the geometry are read at its times."""
    flow = {f"f{i}": variable("<", (1, {"coordinates": np.full(5, i)})) for i in range(5)}
    path = moving(
        tmp_path, "<", ["scalar per node: 2 heat h*", "scalar per node: 3 flow f*"], **flow
    )
    with path.open("a") as file:
        file.write("time set: 2\nnumber of steps: 2\nfilename numbers: 1 2\ntime values: 0.5 9\n")
        file.write("time set: 3\nnumber of steps: 5\nfilename numbers: 0 1 2 3 4\n")
        file.write("time values: 0.25 0.5 0.6 0.75 1\n")
    [(name, track)] = load(path, notes=notes).tracks.items()
    assert (name, track.values[:, 0, 0].tolist()) == ("flow", [1, 3, 4])
    assert "left out: variables at other times than the geometry: heat" in notes


@pytest.mark.parametrize("form", FORMATS)
def test_parts_are_meshes(tmp_path, form, notes):
    line, ghost = block(form, "bar2", [[0, 1]]), block(form, "g_hexa8", [range(8)])
    shapes = [
        part(form, 2, "left", SQUARE, block(form, "tria3", TRIANGLES), line),
        part(form, 5, "right", CUBE, ghost, block(form, "quad4", FACES)),
        part(form, 7, "axis", SQUARE, line),
    ]
    path = store(tmp_path, case("g"), g=geometry(form, *shapes))
    with pytest.raises(InvalidInputError, match="2 meshes: /left, /right; choose one"):
        load(path)
    assert load(path, object="right").n_verts == 8
    both = load(path, merge=True, notes=notes)
    assert [one.name for one in both.surface.parts] == ["/left", "/right"]
    assert "left out: parts without faces: axis" in notes
    assert "left out: elements of points, lines and ghosts: bar2, g_hexa8" in notes


def test_merged_parts_keep_the_nodes_of_their_solids(tmp_path):
    bodies = [(CUBE, "hexa8", [*range(8)]), (2 * CUBE, "tetra4", [4, 0, 1, 3])]
    shapes = [
        part("<", number, f"body{number}", points, block("<", kind, [nodes]))
        for number, (points, kind, nodes) in enumerate(bodies, 1)
    ]
    merged = load(store(tmp_path, case("g"), g=geometry("<", *shapes)), merge=True)
    found = merged.vertices[0][merged.surface.cells.nodes]
    np.testing.assert_array_equal(found, np.concatenate([p[nodes] for p, _, nodes in bodies]))


def test_uneven_times_are_kept(tmp_path):
    assert load(moving(tmp_path, "<", times=(0, 0.5, 0.55))).times.tolist() == [0, 0.5, 0.55]


def test_times_must_ascend_unless_a_rate_is_given(tmp_path):
    path = moving(tmp_path, "<", times=(0, 2, 1))
    with pytest.raises(FormatError, match="step 1 at time 2 and step 2 at 1; times must ascend"):
        load(path)
    assert load(path, fps=10).fps == 10


def test_files_outside_the_folder_need_permission(tmp_path):
    (tmp_path / "case").mkdir()
    body = geometry("<", part("<", 1, "sheet", SQUARE, block("<", "tria3", TRIANGLES)))
    (tmp_path / "g").write_bytes(body)
    path = store(tmp_path / "case", case('"../g"'))
    with pytest.raises(FormatError, match="outside its folder"):
        load(path)
    assert load(path, allow_outside=True).n_verts == 5


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("FORMAT\ntype: ensight\n", "of type 'ensight'; 'ensight gold' is supported"),
        ("hello", "of type '\\(none\\)'"),
        (case("g").replace("model: g", ""), "has 0 models"),
        (case("1 1 g", times=[0, 1]), "in one file \\(file set\\)"),
        (case("1 g changing_geometry_per_part", times=[0]), "changing_geometry_per_part"),
        (case("2 g*", times=[0]), "no time set 2"),
        (case("g"), "refers to the file 'g', which does not exist"),
        (case("1 g*", times=[0], more="time set: x\n"), "bad number"),
        (case("1 g*", times=["a"]), "bad number"),
        (case("1 g*", times=[0], more="number of steps: 4\n"), "has 1 times in time set 1"),
        (
            case(
                "2 g*",
                more="TIME\ntime set: 2\nnumber of steps: 3\nfilename numbers: 1 2\n"
                "time values: 0 1 2\n",
            ),
            "has 2 file numbers for the 3 times",
        ),
    ],
)
def test_unsupported_cases_are_named(tmp_path, text, words):
    with pytest.raises(FormatError, match=words):
        load(store(tmp_path, text))


def unsupported():
    sheet = part("<", 1, "sheet", SQUARE, block("<", "tria3", TRIANGLES))
    line = part("<", 1, "line", SQUARE, block("<", "bar2", [[0, 1]]))
    strange = part("<", 1, "sheet", SQUARE, block("<", "tria7", TRIANGLES))
    grid = part("<", 1, "grid", SQUARE).replace(b"coordinates", b"block\0\0\0\0\0\0")
    return [
        (geometry("<", line), "no elements with faces"),
        (geometry("<", strange), "unknown type 'tria7'; known are point, bar2"),
        (geometry("<", grid), "the structured part 'grid'"),
        (geometry("<", sheet, sheet), "contains part 1 twice"),
        (geometry("<", sheet)[:-4], "truncated, or damaged at byte"),
        (b"Fortran Binary".ljust(80) + bytes(900), "is Fortran binary"),
        (b"no such thing\n" * 9, "where 'node id' is expected"),
        (geometry("text", part("text", 1, "a", SQUARE))[:-20], "truncated, or damaged at line"),
    ]


@pytest.mark.parametrize(("data", "words"), unsupported())
def test_unsupported_geometries_are_named(tmp_path, data, words):
    with pytest.raises(FormatError, match=words):
        load(store(tmp_path, case("g"), g=data))


@pytest.mark.damaged
@pytest.mark.parametrize("form", FORMATS)
def test_damaged_files_are_an_error_or_readable(tmp_path, form):
    solid = block(form, "nfaced", FACES, sizes=([6], [4] * 6))
    body = geometry(form, part(form, 1, "body", CUBE, solid, block(form, "tria3", TRIANGLES)))
    heat = variable(form, (1, {"coordinates": np.arange(8)}))
    path = store(tmp_path, case("g", ["scalar per node: heat h"]), g=body, h=heat)
    originals = {name: (tmp_path / name).read_bytes() for name in ("a.case", "g", "h")}
    for name, data in originals.items():
        read_damaged(tmp_path / name, 60, 500, readers=(lambda _: load(path),))
        (tmp_path / name).write_bytes(data)
