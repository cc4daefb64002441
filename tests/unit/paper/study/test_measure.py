import numpy as np
import pytest

import meshreel
from meshreel.paper.study import runs
from meshreel.paper.sweeps import Setting
from meshreel.studies.runs import Store, result_of
from samples.meshes import waving_grid

SETTING = Setting("pca-qp", 4, anchors=0.05)


@pytest.fixture
def calls(monkeypatch):
    """The options of every call of `encode` by the runs."""
    made = []

    def counted(sequence, **options):
        made.append(options)
        return meshreel.encode(sequence, **options)

    monkeypatch.setattr(runs, "encode", counted)
    return made


@pytest.fixture
def store(tmp_path):
    return Store.for_sequence(tmp_path, waving_grid())


def test_stored_result_is_not_encoded_again(store, calls):
    first = result_of(runs.variant_run(waving_grid(), SETTING), store)
    assert len(calls) == 2  # order kept, order dropped
    assert result_of(runs.variant_run(waving_grid(), SETTING), store) == first
    assert len(calls) == 2


def test_result_agrees_with_its_stored_stream(store):
    sequence = waving_grid()
    result = result_of(runs.variant_run(sequence, SETTING, shown_frame=3), store)
    data = store.path(SETTING.key, "reel").read_bytes()
    smallest = meshreel.encode(sequence, **SETTING.options(), order="drop")
    decoded = meshreel.decode(data)
    assert result["rate_bpvf"] == 8 * len(data) / (12 * 99)
    assert result["rate_order_dropped_bpvf"] == 8 * len(smallest) / (12 * 99)
    assert result["quality"] == meshreel.compare(sequence, decoded).as_dict()
    np.testing.assert_array_equal(np.load(store.path(SETTING.key, "npy")), decoded.vertices[3])
    assert set(result["machine"]) >= {"cpu", "cores", "python", "numpy", "scipy"}
