"""Every installed peer meets the error bound of its settings."""

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.evaluation.comparison import matching
from meshreel.evaluation.draco import DRACO, decode, encode, prepare, restore, separate_equal
from meshreel.evaluation.peers import (
    peers_named,
    positions_of_deltas,
    quantized_deltas,
    tolerance_of,
    why_missing,
)
from meshreel.evaluation.positions import PEERS
from meshreel.evaluation.recorded import COLUMNS, read_recorded
from meshreel.metrics.reference import bounding_box_reference
from meshreel.model.flag import simulate_flag
from meshreel.model.sequence import MeshSequence

BOUND_BITS = {"draco", "meshopt", "pco"}
LOSSLESS = {"blosc2", "npz"}


NAMES = [peer.name for peer in PEERS]


@pytest.fixture(scope="module")
def small_flag():
    return simulate_flag(8, n_rows=8, n_columns=9)


def round_trip(peer, sequence, setting):
    """Encode and decode; return vertices in the order of the sequence."""
    source = peer.prepare(sequence) if peer.prepare else sequence
    data = peer.encode(source, setting)
    decoded = peer.decode(data, source.vertices.shape, source.vertices.dtype)
    if peer.restore:
        decoded = peer.restore(decoded, source, setting)
    return decoded


def error_bound(peer, sequence, setting):
    """The largest error of a coordinate that a setting allows."""
    if peer.name in LOSSLESS:
        return 0.0
    if peer.name in BOUND_BITS:
        return 0.5001 * np.ptp(sequence.vertices, axis=(0, 1)).max() / (2**setting - 1)
    return 1.0001 * setting * bounding_box_reference(sequence.vertices).diagonal


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("peer", PEERS, ids=NAMES)
def test_round_trip_of_a_peer_is_within_its_error_bound(peer, small_flag, dtype):
    if not peer.is_available:
        pytest.skip(*why_missing([peer]))
    sequence = MeshSequence(small_flag.vertices.astype(dtype), small_flag.faces)
    for setting in {*peer.quick, *peer.settings}:
        decoded = round_trip(peer, sequence, setting)
        assert decoded.shape == sequence.vertices.shape
        slack = 4 * np.finfo(np.float32).eps * np.abs(sequence.vertices).max()
        worst = np.abs(decoded.astype(float) - sequence.vertices).max()
        allowed = error_bound(peer, sequence, setting)
        assert worst <= (allowed + slack if allowed else 0)


@pytest.mark.parametrize("peer", PEERS, ids=NAMES)
def test_peers_encode_a_single_frame(peer, small_flag):
    if not peer.is_available:
        pytest.skip(*why_missing([peer]))
    sequence = MeshSequence(small_flag.vertices[:1], small_flag.faces)
    setting = peer.quick[0]
    worst = np.abs(round_trip(peer, sequence, setting).astype(float) - sequence.vertices).max()
    assert worst <= error_bound(peer, sequence, setting) + 1e-5


def test_draco_restores_every_coincident_vertex(small_flag):
    vertices = small_flag.vertices.copy()
    vertices[:, 1:30:2] = vertices[:, :1]
    vertices[3] = 0
    sequence = MeshSequence(vertices, small_flag.faces)
    decoded = round_trip(DRACO, sequence, 12)
    assert np.abs(decoded - vertices).max() <= np.ptp(vertices) / 2**12


def test_error_counts_vertices_that_draco_drops(small_flag):
    vertices = np.concatenate([small_flag.vertices, small_flag.vertices[:, :2] + 1], axis=1)
    sequence = MeshSequence(vertices, small_flag.faces)
    with pytest.raises(InvalidInputError, match="drops 2 of 74 vertices"):
        round_trip(DRACO, sequence, 10)


def test_positions_that_draco_cannot_match_are_an_error(small_flag):
    source = prepare(small_flag)
    decoded = decode(encode(source, 10), source.vertices.shape, np.float32)
    with pytest.raises(InvalidInputError, match="cannot match positions"):
        restore(decoded[:, ::-1], source, 10)


def test_separate_equal_makes_all_positions_distinct():
    frame = np.zeros((500, 3), np.float32)
    frame[::3] = 1.5
    apart = separate_equal(frame)
    assert len({row.tobytes() for row in apart}) == 500
    assert np.abs(apart - frame).max() < 1e-4


def test_separate_equal_keeps_distinct_positions(small_flag):
    frame = small_flag.vertices[0].astype(np.float32)
    assert np.array_equal(separate_equal(frame), frame)


def test_sums_of_quantized_deltas_are_within_half_a_step():
    rng = np.random.default_rng(0)
    vertices = 1e3 + rng.normal(size=(5, 7, 3))
    head, deltas = quantized_deltas(vertices, 16)
    step = np.ptp(vertices, axis=(0, 1)).max() / (2**16 - 1)
    back = positions_of_deltas(head, deltas, np.float64)
    assert np.abs(back - vertices).max() <= 0.5001 * step


def test_quantized_deltas_of_a_point_are_zero():
    head, deltas = quantized_deltas(np.full((3, 4, 3), 2.5), 8)
    assert not deltas.any()
    assert (positions_of_deltas(head, deltas, np.float32) == 2.5).all()


def test_peers_named_returns_peers_in_registry_order():
    assert [peer.name for peer in peers_named(["npz", "draco", "npz"], PEERS)] == ["draco", "npz"]
    assert peers_named(["none"], PEERS) == ()
    assert peers_named(None, PEERS) == PEERS


@pytest.mark.parametrize("names", [["draco", "zip"], [], ["none", "draco"]])
def test_error_for_an_unknown_peer_lists_the_peers(names):
    with pytest.raises(InvalidInputError, match="choose from draco, sz3, zfp"):
        peers_named(names, PEERS)


def test_tolerance_is_relative_to_the_diagonal(small_flag):
    diagonal = bounding_box_reference(small_flag.vertices).diagonal
    assert tolerance_of(small_flag, 0.01) == pytest.approx(0.01 * diagonal)
    point = MeshSequence(np.zeros_like(small_flag.vertices), small_flag.faces)
    with pytest.raises(InvalidInputError, match="no extent"):
        tolerance_of(point, 0.01)


ROW = {
    "sequence": "flag", "n": "72", "k": "8", "m": "112", "codec": "famc", "params": "q=8, tr=1",
    "bytes_total": "100", "bytes_connectivity": "20", "bpvf_total": "1.39",
    "kg_error_percent": "0.5", "max_err_over_diag": "0.002", "enc_s": "1.5", "dec_s": "0.5",
    "rms_err_over_diag": "0.001",
}  # fmt: skip


@pytest.fixture
def write(tmp_path):
    def write_rows(*rows, columns=COLUMNS):
        lines = [",".join(columns)]
        lines += [",".join(f'"{row[name]}"' for name in columns) for row in rows]
        path = tmp_path / "rd.csv"
        path.write_text("\n".join(lines))
        return path

    return write_rows


def test_read_recorded_returns_errors_in_percent(write):
    (point,) = read_recorded(write(ROW))
    assert (point["codec"], point["params"]) == ("famc (recorded)", "q=8, tr=1")
    assert point["sequence"] == {"name": "flag", "n_verts": 72, "n_frames": 8}
    assert point["rate_bpvf"] == 1.39
    assert point["quality"] == pytest.approx(
        {"kg_error_percent": 0.5, "max_error_percent": 0.2, "rms_error_percent": 0.1}
    )
    assert point["seconds"] == {"encode": 1.5, "decode": 0.5}


def test_matching_omits_rows_of_another_name_or_shape(write):
    rows = [ROW, ROW | {"sequence": "cow"}, ROW | {"n": "71"}, ROW | {"k": "9"}]
    points = read_recorded(write(*rows))
    result = matching(points, {"name": "flag", "n_verts": 72, "n_frames": 8})
    assert result == points[:1]


def test_error_names_missing_columns(write):
    path = write(ROW, columns=[name for name in COLUMNS if name not in ("k", "enc_s")])
    with pytest.raises(InvalidInputError, match="lacks the column k, enc_s; required: sequence"):
        read_recorded(path)


@pytest.mark.parametrize(
    ("column", "text"),
    [("bpvf_total", "much"), ("n", "7.5"), ("enc_s", ""), ("kg_error_percent", "nan"),
     ("dec_s", "-1"), ("max_err_over_diag", "inf")],
)  # fmt: skip
def test_error_names_line_and_column_of_an_invalid_number(write, column, text):
    with pytest.raises(InvalidInputError, match=f"line 3: column {column} must be .*{text!r}"):
        read_recorded(write(ROW, ROW | {column: text}))


def test_error_names_line_and_column_of_a_short_row(tmp_path):
    path = tmp_path / "rd.csv"
    path.write_text(",".join(COLUMNS) + "\nflag,72,8\n")
    with pytest.raises(InvalidInputError, match="line 2: column codec is empty"):
        read_recorded(path)


def test_file_that_is_not_text_is_rejected(tmp_path):
    path = tmp_path / "rd.csv"
    path.write_bytes(b"\xff\xfe\x00\x80")
    with pytest.raises(InvalidInputError, match="is not a CSV file in UTF-8"):
        read_recorded(path)
