"""Codecs of users, given as two functions."""

import re

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.evaluation.own_codec import own_codec
from meshreel.evaluation.positions import compare_positions
from meshreel.model.flag import simulate_flag
from meshreel.studies.study import evaluate
from samples.pages import ROOT

CODEC = """
SETTINGS = (8, 10)

def encode(vertices, faces, setting):
    return vertices.round(setting - 7).tobytes()

def decode(data, faces):
    assert faces.shape[1] == 3
    import numpy as np
    return np.frombuffer(data, np.float32).reshape(4, -1, 3)
"""


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def written(text=CODEC, name="mine"):
        (tmp_path / f"{name}.py").write_text(text)
        return own_codec(f"{name}.py:encode,decode", ["reel"])

    return written


def report(peer, folder):
    flag = simulate_flag(4, n_rows=6, n_columns=8)
    evaluation = evaluate(compare_positions({}, [peer]), [flag], folder)
    return evaluation.measured[0][0]


def test_own_codec_is_measured_with_our_connectivity(write, tmp_path):
    results = report(write(), tmp_path / "out")
    first, second = results.measured
    assert first["params"] == "setting 8"
    assert first["connectivity_bytes"] > 0
    assert first["size_bytes"] == 4 * 48 * 12 + first["connectivity_bytes"]
    assert 0 < second["quality"]["max_error_percent"] < first["quality"]["max_error_percent"]


def test_codec_with_faces_gets_none_and_no_added_bytes(write, tmp_path):
    text = CODEC.replace("assert faces.shape[1] == 3", "assert faces is None")
    results = report(write(text + "HAS_FACES = True\n"), tmp_path / "out")
    assert [each["size_bytes"] for each in results.measured] == [4 * 48 * 12] * 2


def test_results_of_an_earlier_version_are_not_reused(write, tmp_path):
    before = report(write(), tmp_path / "out").measured[0]
    again = report(write(), tmp_path / "out").measured[0]
    changed = report(write(CODEC.replace("setting - 7", "setting - 10")), tmp_path / "out")
    assert again == before
    assert changed.measured[0]["quality"] != before["quality"]


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("reshape(4, -1, 3)", "reshape(-1, 3)"), r"shape \(4, 48, 3\); got \(192, 3\)"),
        ((".tobytes()", ""), "encode must return bytes; got ndarray"),
        (("import numpy as np", "raise ValueError('broken')"), "ValueError: broken"),
    ],
)
def test_wrong_results_are_refusals_with_their_reason(change, words, write, tmp_path):
    [first, _] = report(write(CODEC.replace(*change)), tmp_path / "out").measured
    assert re.search(words, first["refused"])


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("mine", "not of the form module:encode,decode"),
        ("mine:encode", "not of the form"),
        ("absent_module:encode,decode", "cannot be imported: ModuleNotFoundError"),
        ("absent.py:encode,decode", "cannot be imported: FileNotFoundError"),
        ("named_once:encode,unpack", "module named_once has no function 'unpack'"),
        ("reel.py:encode,decode", "has the name of another one"),
        ("bare:encode,decode", "has no SETTINGS"),
    ],
)
def test_codecs_that_cannot_be_called_are_refused(text, words, write, tmp_path):
    write()
    (tmp_path / "named_once.py").write_text(CODEC)
    (tmp_path / "reel.py").write_text(CODEC)
    (tmp_path / "bare.py").write_text(CODEC.replace("SETTINGS", "VALUES"))
    with pytest.raises(InvalidInputError, match=words):
        own_codec(text, ["reel"])


def test_codec_of_the_examples_returns_positions_within_a_step(monkeypatch):
    peer = own_codec(str(ROOT / "examples" / "own_codec.py") + ":encode,decode", [])
    flag = simulate_flag(4, n_rows=6, n_columns=8)
    for setting in peer.settings:
        data = peer.encode(flag, setting)
        decoded = peer.decode(data, flag.vertices.shape, np.float64, flag.faces)
        step = np.ptp(flag.vertices, axis=(0, 1)).max() / (2**setting - 1)
        assert np.abs(decoded - flag.vertices).max() <= 0.501 * step
