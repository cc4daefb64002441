import numpy as np
import pytest

import meshreel
from meshreel.app.batch.discovery import find_inputs
from meshreel.errors import FormatError
from meshreel.formats.inspection import inspect_source
from meshreel.formats.load import load
from meshreel.formats.options import Reading
from meshreel.formats.segments import open_any
from meshreel.formats.sources import find_files
from meshreel.model.notes import Notes
from meshreel.model.surface import Domain
from samples.d3plot import END, Model, padded, root, state, words_of, write_family
from samples.datasets import positions_of, read_damaged

CODES = ["<4", ">4", "<8", ">8"]
FLOATS = {"4": np.float32, "8": np.float64}
CUBE = np.array(
    [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]]
)
TWO_CUBES = np.concatenate([CUBE, CUBE[4:] + np.array([0, 0, 1]), [[5, 5, 5], [6, 5, 5]]])
"""Two cubes, one above the other, and two nodes of a beam."""

SHELLS = np.array([[8, 9, 10, 10, 2], [8, 10, 11, 11, 2]])
SOLIDS = np.array([[*range(8), 0], [*range(4, 12), 1]])
BEAM = np.array([[12, 13, 0, 0, 0, 2]])
POSITIONS = 1, 0, 0
"""IU, IV and IA of states with positions only."""


def flags(positions=1, velocity=0, acceleration=0, **more):
    words = {"it": 19, "nglbv": 18, "nv3d": 27, "nv1d": 30, "nv2d": 33, "neiph": 34, "maxint": 36}
    words |= {"ioshl1": 43, "ioshl2": 44, "ioshl3": 45, "ioshl4": 46, "idtdt": 56, "ndim": 15}
    given = {words[name]: value for name, value in more.items()}
    return {20: positions, 21: velocity, 22: acceleration} | given


def whole_model(**control):
    return Model(
        TWO_CUBES,
        SOLIDS,
        beams=BEAM,
        shells=SHELLS,
        part_ids=(10, 20, 30),
        titles={10: "lower block", 20: "upper block", 30: "skin"},
        control=flags(**control),
    )


def moved(index, nodes=TWO_CUBES):
    return nodes * (1 + index / 3) + index / 7


def sheet(n_shells=3, **control):
    """A strip of quads."""
    x = np.arange(n_shells + 1)
    nodes = np.stack([np.repeat(x, 2), np.tile([0, 1], n_shells + 1), 0 * np.repeat(x, 2)], axis=1)
    first = 2 * np.arange(n_shells)[:, None]
    shells = np.concatenate([first + np.array([0, 2, 3, 1]), np.zeros_like(first)], axis=1)
    return Model(nodes, shells=shells, control=flags(**control))


@pytest.mark.parametrize("code", CODES)
@pytest.mark.parametrize("name", ["d3plot", "D3PLOT", "crash.d3plot"])
def test_positions_times_and_parts_are_those_of_the_states(tmp_path, code, name, notes):
    states = [state(2 + index / 8, moved(index), code=code) for index in range(3)]
    path = write_family(tmp_path / name, whole_model(), [states[:1], states[1:]], code)
    loaded = load(path, notes=notes)
    expected = np.array([moved(index) for index in range(3)]).astype(FLOATS[code[1]])
    assert loaded.vertices.tobytes() == expected.tobytes()
    assert (loaded.fps, loaded.start_s, loaded.name) == (8.0, 2.0, path.stem)
    [parts] = loaded.surface.groups
    assert parts.labels == ("lower block", "upper block", "skin")
    assert np.bincount(parts.numbers).tolist() == [5, 5, 2]  # the cubes share a face
    [cell_attribute] = loaded.surface.attributes
    assert (cell_attribute.name, cell_attribute.domain) == ("part", "cell")
    assert np.bincount(cell_attribute.values[:, 0]).tolist() == [1, 1, 2]
    assert "left out: elements without faces: beams" in notes


@pytest.mark.parametrize("code", CODES)
def test_the_last_state_keeps_the_time_at_which_the_run_ended(tmp_path, code, notes):
    times = [0, 0.5, 1, 1.5, 1.75]
    states = [state(time, moved(0), code=code) for time in times]
    loaded = load(write_family(tmp_path / "d3plot", whole_model(), [states], code), notes=notes)
    assert loaded.times.tolist() == times
    assert not [note for note in notes if "time" in note]


def test_unnamed_parts_have_numbers(tmp_path):
    model = whole_model()
    model.titles = {10: "block", 20: "block"}
    path = write_family(tmp_path / "d3plot", model, [[state(0, TWO_CUBES)]])
    assert load(path).surface.groups[0].labels == ("block 10", "block 20", "part 30")


def test_keywords_after_the_titles_are_skipped(tmp_path):
    model = whole_model()
    model.after = ([90100, 9], [0x2A2A2A2A] * 180)
    loaded = load(write_family(tmp_path / "d3plot", model, [[state(0, moved(1))]]))
    assert loaded.vertices[0].tobytes() == moved(1).astype(np.float32).tobytes()


SHAPES = {
    "hexahedron": (range(8), 6, 1),
    "wedge with two edges": ((0, 1, 2, 3, 4, 4, 7, 7), 5, 1 / 2),
    "wedge with two triangles": ((0, 1, 2, 2, 4, 5, 6, 6), 5, 1 / 2),
    "pyramid": ((0, 1, 2, 3, 4, 4, 4, 4), 5, 1 / 3),
    "tetrahedron": ((0, 1, 2, 4, 4, 4, 4, 4), 4, 1 / 6),
    "old tetrahedron": ((0, 1, 2, 2, 4, 4, 4, 4), 4, 1 / 6),
}


@pytest.mark.parametrize("kind", ["solids", "thick_shells"])
@pytest.mark.parametrize("shape", SHAPES)
def test_degenerate_solids_have_closed_surfaces_facing_outward(tmp_path, shape, kind):
    nodes, n_faces, volume = SHAPES[shape]
    model = Model(CUBE, control=flags(), **{kind: np.array([[*nodes, 0]])})
    loaded = load(write_family(tmp_path / "d3plot", model, [[state(0, CUBE)]]))
    corners = loaded.vertices[0].astype(float)[loaded.faces]
    assert loaded.surface.n_faces(len(loaded.faces)) == n_faces
    assert loaded.n_verts == len(CUBE)
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(volume)


@pytest.mark.parametrize("ten_nodes", ["early", "late"])
def test_further_nodes_of_ten_node_solids_are_skipped(tmp_path, ten_nodes):
    model = whole_model()
    model.ten_nodes = ten_nodes
    loaded = load(write_family(tmp_path / "d3plot", model, [[state(0, moved(1))]]))
    assert loaded.vertices[0].tobytes() == moved(1).astype(np.float32).tobytes()
    assert loaded.surface.groups[0].labels == ("lower block", "upper block", "skin")


@pytest.mark.parametrize("ten_nodes", ["early", "late"])
def test_ten_node_tetrahedra_keep_the_nodes_on_their_edges(tmp_path, ten_nodes):
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    ends = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])
    nodes = np.concatenate([corners, corners[ends].mean(axis=1)])
    model = Model(nodes, np.array([[*range(8), 0]]), part_ids=(1,), control=flags())
    model.ten_nodes, model.last_nodes = ten_nodes, [[9, 10]]
    loaded = load(write_family(tmp_path / "d3plot", model, [[state(0, nodes)]]))
    assert (loaded.n_verts, len(loaded.faces)) == (10, 4)
    assert loaded.surface.cells.types.tolist() == [24]
    assert loaded.surface.cells.nodes.tolist() == [*range(10)]
    model.last_nodes = [[9, 11]]
    path = write_family(tmp_path / "d3plot", model, [[state(0, nodes)]])
    with pytest.raises(FormatError, match="ten-node solids with node numbers above 10"):
        load(path)


@pytest.mark.parametrize("number", [1 << 30, 7])
def test_part_numbers_beyond_the_parts_are_an_error(tmp_path, number):
    model = whole_model()
    model.solids = SOLIDS + (np.arange(9) == 8) * (number - 1)
    path = write_family(tmp_path / "d3plot", model, [[state(0, moved(0))]])
    with pytest.raises(FormatError, match=rf"element of part {number + 1}, but at most 5 parts"):
        load(path)


DELETION = {"maxint": -10_003}


def test_deleted_elements_begin_a_segment_without_nodes_of_their_own(tmp_path):
    alive = [[1, 2, 3, 3, 2], [1, 2, 3, 3, 2], [1, 0, 3, 3, 2], [1, 0, 0, 3, 2]]
    states = [state(index, moved(index), alive[index]) for index in range(4)]
    path = write_family(tmp_path / "d3plot", whole_model(**DELETION), [states])
    loaded = load(path)
    assert [segment.n_frames for segment in loaded.segments] == [2, 1, 1]
    assert [np.bincount(segment.surface.groups[0].numbers, minlength=3).tolist() for segment in
            loaded.segments] == [[5, 5, 2], [6, 0, 2], [6, 0, 1]]  # fmt: skip
    assert [segment.n_verts for segment in loaded.segments] == [14, 14, 13]
    last = np.delete(moved(3), 9, axis=0).astype(np.float32)
    assert positions_of(loaded.segments[2])[0].tobytes() == last.tobytes()
    assert loaded.fps == 1


def test_deleted_elements_can_be_kept_with_a_track(tmp_path):
    alive = np.array([[1, 2, 3, 3, 2], [1, 2, 3, 3, 2], [1, 0, 3, 3, 2], [1, 0, 0, 3, 2]])
    states = [state(index, moved(index), alive[index]) for index in range(4)]
    path = write_family(tmp_path / "d3plot", whole_model(**DELETION), [states])
    notes = Notes()
    kept = load(path, keep_deleted=True, notes=notes)
    assert not any(note.subject == "deleted elements" for note in notes)
    track = kept.tracks["alive"]
    assert (kept.surface.cells.n_cells, track.domain) == (4, Domain.CELL)
    without_beam = alive[:, :4]
    np.testing.assert_array_equal(track.values[..., 0].sum(axis=1), (without_beam > 0).sum(axis=1))
    decoded = meshreel.decode(meshreel.encode(kept, max_error="0.001u"))
    np.testing.assert_array_equal(decoded.tracks["alive"].values, track.values)
    load(path, notes=notes)
    assert any(note.subject == "deleted elements" for note in notes)


def test_deleted_nodes_delete_their_elements(tmp_path):
    model = sheet(maxint=-3)
    visible = np.ones((2, 8))
    visible[1, 7] = 0
    states = [state(index, model.nodes, visible[index]) for index in range(2)]
    loaded = load(write_family(tmp_path / "d3plot", model, [states]))
    assert [len(segment.faces) for segment in loaded.segments] == [6, 4]


def test_frames_without_elements_are_an_error(tmp_path):
    model = sheet(**DELETION)
    states = [state(index, model.nodes, [1 - index] * 3) for index in range(2)]
    path = write_family(tmp_path / "d3plot", model, [states])
    with pytest.raises(FormatError, match="all elements with faces are deleted"):
        load(path)


def test_results_at_nodes_are_tracks(tmp_path):
    model = sheet(velocity=1, acceleration=1, it=12, idtdt=11, nglbv=2)
    rng = np.random.default_rng(0)
    widths = {
        "temperature": 1, "heat_flux": 3, "mass_scaling": 1, "temperature_rate": 1,
        "residual_force": 3, "residual_moment": 3, "velocity": 3, "acceleration": 3,
    }  # fmt: skip
    values = {name: rng.random((2, 8, width)) for name, width in widths.items()}
    states = [
        state(index, [7, 7], model.nodes, *(value[index] for value in values.values()))
        for index in range(2)
    ]
    loaded = load(write_family(tmp_path / "d3plot", model, [states]))
    assert set(loaded.tracks) == set(widths)
    for name, expected in values.items():
        track = loaded.tracks[name]
        assert track.values.reshape(expected.shape).tobytes() == expected.astype("f4").tobytes()
    assert loaded.tracks["velocity"].kind == "velocity"


@pytest.mark.parametrize("version", [0, 3, 4])
def test_tables_of_particles_are_skipped(tmp_path, version, notes):
    """Two SPH particles with 3 values, and an airbag of 4 particles with 2 values."""
    model = sheet()
    model.part_ids, model.ten_nodes = (1,), ""
    model.control |= {37: 2, 54: 1000 * version + 1}
    sph = [11, 1, 1, *[0] * 8]
    variables = [4, 2, 4, 2]  # of geometry, particles, their number, and of the bag in a state
    variables += [1] * (version == 4)  # chambers
    model.more = (sph, variables, [1] * 8, [65] * 64)
    model.last = ([1, 1, 2, 1], [1, 4, 9, 1])
    states = [
        state(index, moved(index, model.nodes), np.ones((2, 3)), [4, 0.5], np.ones((4, 2)))
        for index in range(3)
    ]
    loaded = load(write_family(tmp_path / "d3plot", model, [states]), notes=notes)
    assert loaded.n_frames == 3
    assert "left out: elements without faces: SPH particles, particles of airbags" in notes


@pytest.mark.parametrize("n_points", [1, 8])
def test_results_of_elements_are_tracks_of_cells(tmp_path, n_points, notes):
    model = whole_model(
        nv3d=9 * n_points,
        neiph=2,
        nv1d=6,
        nv2d=33,
        ioshl1=1000,
        ioshl2=1000,
        ioshl3=1000,
        ioshl4=1000,
    )  # fmt: skip
    rng = np.random.default_rng(0)
    tables = [rng.random(shape) for shape in ((2, n_points, 9), (1, 6), (2, 33))]
    loaded = load(
        write_family(tmp_path / "d3plot", model, [[state(0, TWO_CUBES, *tables)]]), notes=notes
    )
    solids, _, shells = (table.astype(np.float32) for table in tables)
    cells = loaded.surface.cells
    assert (cells.types == 12).sum() == len(solids)
    rows = np.repeat([0, 1, 2], [1, 1, len(shells)])  # the part of each cell
    mean = solids.mean(axis=1)
    expected = {
        "stress": [*mean[:, :6], shells[:, :6]],
        "plastic_strain": [*mean[:, 6:7], shells[:, 6:7]],
        "thickness": [np.nan, np.nan, shells[:, 29:30]],
        "internal_energy": [np.nan, np.nan, shells[:, 32:33]],
    }
    assert set(loaded.tracks) == set(expected)
    for name, of_parts in expected.items():
        assert loaded.tracks[name].domain == "cell"
        values = loaded.tracks[name].values[0].reshape(len(rows), -1)
        for part in range(3):
            np.testing.assert_allclose(
                values[rows == part],
                np.broadcast_to(of_parts[part], values[rows == part].shape),
                rtol=1e-6,
            )
    assert not any("the inside" in note for note in notes)
    assert any("other integration points" in note and " of shells" in note for note in notes)


def test_rigid_shells_without_results_are_nan(tmp_path):
    model = sheet(ndim=5, nv2d=21, ioshl1=1000, ioshl2=1000)
    model.shells[1, 4] = 1
    model.more = ([1, 2, 1, 20],)
    results = np.arange(42).reshape(2, 21)
    loaded = load(write_family(tmp_path / "d3plot", model, [[state(0, model.nodes, results)]]))
    assert loaded.tracks["plastic_strain"].values.ravel().tolist() == pytest.approx(
        [6, np.nan, 27], nan_ok=True
    )


def test_states_follow_the_geometry_and_continue_in_the_next_files(tmp_path):
    model = sheet(n_shells=40)
    states = [state(index, moved(index, model.nodes)) for index in range(5)]
    assert len(states[0]) > 4 * 180
    data = root(model)
    block = len(data) + len(states[0])
    (tmp_path / "d3plot").write_bytes(data + states[0])  # full, without an end mark
    rest = b"".join(states[1:]) + words_of([END], "<4")
    for number in range(1, 99):  # states are longer than a file
        (tmp_path / f"d3plot{number:02}").write_bytes(rest[:400])
        rest = rest[400:]
        if not rest:
            break
    loaded = load(tmp_path / "d3plot")
    assert block % 2048
    expected = [moved(index, model.nodes) for index in range(5)]
    assert loaded.vertices.tobytes() == np.array(expected, np.float32).tobytes()


def test_members_are_read_in_the_order_of_their_numbers(tmp_path):
    model = sheet()
    states = [[state(index, moved(index, model.nodes))] for index in range(3)]
    write_family(tmp_path / "d3plot", model, states[:2])
    (tmp_path / "d3plot100").write_bytes(padded(states[2][0]))
    (tmp_path / "d3plot01.bak").write_bytes(b"unrelated")
    assert load(tmp_path / "d3plot").n_frames == 3


def test_adapted_meshes_replace_later_states_and_begin_segments(tmp_path):
    coarse, fine = sheet(2), sheet(5)
    states = [state(index, coarse.nodes) for index in range(4)]
    write_family(tmp_path / "d3plot", coarse, [states])
    write_family(tmp_path / "d3plotaa", fine, [[state(time, fine.nodes) for time in (2, 3, 4)]])
    loaded = load(tmp_path / "d3plot")
    assert [(segment.n_frames, len(segment.faces)) for segment in loaded.segments] == [
        (2, 4),
        (3, 10),
    ]
    assert loaded.fps == 1


def test_states_without_positions_are_at_rest(tmp_path, notes):
    model = sheet(positions=0, velocity=1)
    states = [state(index, np.ones((8, 3))) for index in range(2)]
    loaded = load(write_family(tmp_path / "d3plot", model, [states]), notes=notes)
    assert (loaded.vertices == model.nodes).all()
    assert "left out: motion: the states contain no positions" in notes


def test_an_incomplete_last_state_is_left_out_with_a_note(tmp_path, notes):
    model = sheet()
    write_family(tmp_path / "d3plot", model, [[]])
    states = state(0, model.nodes) + state(1, model.nodes)
    (tmp_path / "d3plot01").write_bytes(states[:-8])
    assert load(tmp_path / "d3plot", notes=notes).n_frames == 1
    assert "the last state is incomplete and not read: 23 words of 25" in notes


def test_missing_members_are_an_error(tmp_path):
    with pytest.raises(FormatError, match=r"no states.*d3plot01.*next to it"):
        load(write_family(tmp_path / "d3plot", sheet(), []))


@pytest.mark.parametrize(
    ("control", "words"),
    [
        ({15: 3}, "NDIM 3"),
        ({15: 8}, "reduced rigid bodies"),
        ({48: 67108864}, "multi-physics results"),
        ({54: 10_000_000}, "discrete elements"),
        ({11: 11}, "file type is 11"),
        ({11: -1}, "DATABASE_EXTENT_BINARY_COMP"),
        ({18: -5}, "negative size nglbv"),
        ({16: 7}, "node numbers outside 1..7"),
        ({18: 3}, "states are not 28 words long"),
    ],
)
def test_unsupported_contents_are_named(tmp_path, control, words):
    model = sheet()
    model.control |= control
    states = [state(index, model.nodes) for index in range(3)]
    path = write_family(tmp_path / "d3plot", model, [states])
    with pytest.raises(FormatError, match=words):
        load(path)


def test_models_of_beams_are_an_error(tmp_path):
    model = Model(TWO_CUBES, beams=BEAM, control=flags())
    with pytest.raises(FormatError, match="neither shells nor solids"):
        load(write_family(tmp_path / "d3plot", model, [[state(0, TWO_CUBES)]]))


def test_damaged_files_are_an_error_or_readable(tmp_path):
    path = write_family(tmp_path / "d3plot", whole_model(**DELETION), [])
    member = b"".join(state(index, moved(index), [1, 2, 3, 3, 2]) for index in range(2))
    (tmp_path / "d3plot01").write_bytes(padded(member))
    read_damaged(path)


def test_frames_stay_in_the_files_until_they_are_read(tmp_path):
    model = sheet()
    states = [state(index, moved(index, model.nodes)) for index in range(3)]
    path = write_family(tmp_path / "d3plot", model, [states])
    opened = open_any(find_files(path), Reading(max_loaded_bytes=0))
    (tmp_path / "d3plot01").write_bytes(padded(b"".join(state(i, model.nodes) for i in range(3))))
    assert (positions_of(opened) == model.nodes).all()


def test_batches_find_root_files_only(tmp_path):
    path = write_family(tmp_path / "d3plot", sheet(), [[state(0, sheet().nodes)]])
    [result] = find_inputs(tmp_path)
    assert (result.source, len(result.files)) == (path, 2)


def test_inspection_counts_all_files(tmp_path):
    path = write_family(tmp_path / "d3plot", sheet(), [[state(0, sheet().nodes)]])
    write_family(tmp_path / "d3plotaa", sheet(5), [[state(1, sheet(5).nodes)]])
    result = inspect_source(path, Reading())
    size = sum(path.stat().st_size for path in tmp_path.iterdir())
    assert (result.n_files, result.size_bytes, result.meshes[0].n_segments) == (4, size, 2)
    assert len(find_files(path).with_companions()) == 4


def test_deleted_elements_survive_encoding(tmp_path):
    alive = [[1, 2, 3, 3, 2], [1, 0, 3, 3, 2], [1, 0, 0, 3, 2]]
    states = [state(index, moved(index), alive[index]) for index in range(3)]
    path = write_family(tmp_path / "d3plot", whole_model(**DELETION), [states])
    loaded = load(path)
    data = meshreel.encode(loaded, max_error="0.001u")
    for number, segment in enumerate(loaded.segments):
        decoded = meshreel.decode(data, segment=number)
        assert abs(positions_of(segment) - decoded.vertices).max() <= 0.001
        assert segment.surface.groups[0].labels == decoded.surface.groups[0].labels
