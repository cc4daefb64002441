"""Tracks of a sequence: valid and invalid values."""

import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError
from meshreel.model.surface import Domain, Surface
from meshreel.model.tracks import MAX_COLUMNS, TrackKind, TrackPart, value_range
from samples.meshes import grid_faces

QUADS = Surface(face_sizes=np.full(9, 4, np.int32))
FANS = np.array([0, 4, 5, 0, 5, 1]) + [[i] for i in range(11) if i % 4 < 3]
FANS = FANS.reshape(-1, 3)


def sequence(surface=None, tracks=None, **named):
    given = {} if surface is None else {"surface": surface}
    faces = grid_faces(4, 4) if surface is None else FANS
    return meshreel.MeshSequence(np.zeros((5, 16, 3)), faces, tracks=tracks or named, **given)


def test_arrays_become_tracks_of_the_domain_of_their_size():
    result = sequence(
        a=np.zeros((5, 16)), b=np.zeros((5, 18, 3), np.float32), c=np.zeros((5, 54, 9), np.int16)
    ).tracks
    assert [one.domain for one in result.values()] == [Domain.VERTEX, Domain.FACE, Domain.CORNER]
    kinds = [TrackKind.SCALAR, TrackKind.VECTOR, TrackKind.OTHER]
    assert [one.kind for one in result.values()] == kinds
    assert [one.shape for one in result.values()] == [(5, 16, 1), (5, 18, 3), (5, 54, 9)]
    assert sequence(QUADS, x=np.zeros((5, 9))).tracks["x"].domain is Domain.FACE


def test_values_are_stored_read_only():
    values = np.arange(80.0).reshape(5, 16)
    track = sequence(x=values).tracks["x"]
    np.testing.assert_array_equal(track[2][:, 0], values[2])
    assert len(track) == 5
    with pytest.raises(ValueError, match="read-only"):
        track.values[0] = 1
    assert sequence(on=np.ones((5, 16), bool)).tracks["on"].dtype == np.uint8


def test_tracks_are_an_xarray_dataset():
    pytest.importorskip("xarray")
    tracks = {
        "heat": meshreel.Track(np.arange(80.0).reshape(5, 16), unit="degC"),
        "flow": np.arange(270.0).reshape(5, 18, 3),
        "stress": np.zeros((5, 18, 6)),
    }
    whole = sequence(tracks=tracks).replace(times=[0, 1, 2, 4, 8])
    reel = meshreel.open(meshreel.encode(whole, tracks={"heat": "0.5K"}))
    stored_bound = reel.track("heat").error_bound
    for result, bound in [(whole.to_xarray(), 0.0), (reel.to_xarray(), stored_bound)]:
        assert result.heat.dims == ("time", "node")
        assert result.heat.attrs == {"units": "degC", "kind": "scalar", "error_bound": bound}
        assert result.flow.dims == ("time", "face", "component")
        assert result.stress.dims == ("time", "face", "component_6")
        assert (result.time.values.tolist(), result.time.units) == ([0, 1, 2, 4, 8], "s")
        np.testing.assert_allclose(result.flow.sel(time=4).values, tracks["flow"][3], atol=1)
    np.testing.assert_array_equal(reel.to_xarray().heat.values, reel.track("heat")[:][..., 0])
    assert "time" not in sequence(tracks=tracks).to_xarray().coords


REFUSED = {
    "has 4 frames; the positions have 5": np.zeros((4, 16)),
    "the mesh has 16 vertices, 18 faces and 54 corners": np.zeros((5, 17)),
    r"values of shape \(5,\) do not fit vertices, faces, corners or cells": np.zeros(5),
    r"none of them 0; got \(5, 16, 0\)": np.zeros((5, 16, 0)),
    "must be bool, uint8, .* got complex128": np.zeros((5, 16), complex),
    f"at most {MAX_COLUMNS} components; got 10000": np.zeros((5, 16, 10000)),
    "for domain face; the mesh has 16 vert": meshreel.Track(np.zeros((5, 16)), "face"),
}


@pytest.mark.parametrize("words", REFUSED)
def test_tracks_that_do_not_fit_are_rejected(words):
    with pytest.raises(InvalidInputError, match=f"track 'x'.*{words}"):
        sequence(x=REFUSED[words])


@pytest.mark.parametrize(
    ("shape", "dtype", "given", "words"),
    [
        ((5, 16, 2), float, {"kind": "normal"}, "normal have 3 numbers; got 2"),
        ((5, 16, 3), int, {"kind": "normal"}, "must be float32 or float64; got int64"),
        ((5, 16, 3), np.int16, {"kind": "velocity"}, "must be float32 or float64; got int16"),
        ((5, 16, 2), np.uint8, {"kind": "uv"}, "must be float32 or float64; got uint8"),
        ((5, 16), float, {"kind": "colour"}, "kind must be one of scalar, .*; got 'colour'"),
        ((5, 16), float, {"domain": "edge"}, "must be one of vertex, face, corner, cell; got"),
        ((5, 16, 4), float, {"kind": "vector"}, r"vector have 2 numbers \(2 or 3\); got 4"),
    ],
)
def test_values_that_do_not_suit_the_kind_are_rejected(shape, dtype, given, words):
    with pytest.raises(InvalidInputError, match=words):
        meshreel.Track(np.zeros(shape, dtype), **given)


@pytest.mark.parametrize(("kind", "n_columns"), [("color", 3), ("vector", 2), ("scalar", 1)])
def test_integers_are_accepted_by_some_kinds(kind, n_columns):
    assert meshreel.Track(np.zeros((5, 16, n_columns), np.uint8), kind=kind).kind == kind


def test_empty_name_is_rejected():
    with pytest.raises(InvalidInputError, match="needs a non-empty name; got ''"):
        sequence(tracks={"": np.zeros((5, 16))})


def test_range_covers_the_finite_numbers_of_each_column():
    values = np.zeros((5, 16, 2))
    values[3, 4] = [7, np.nan]
    values[1, 2] = [np.inf, -2]
    low, high = value_range(meshreel.Track(values), 2)
    assert low.tolist() == [0, -2]
    assert high.tolist() == [7, 0]
    low, high = value_range(meshreel.Track(np.full((2, 3), np.nan)))
    assert np.isnan([low, high]).all()


def test_slice_of_a_track_has_its_frames():
    track = meshreel.Track(np.arange(40.0).reshape(10, 4), unit="Pa")
    part = TrackPart(track, range(3, 8))
    assert (part.shape, part.unit, part.kind) == ((5, 4, 1), "Pa", track.kind)
    np.testing.assert_array_equal(part.read(1, 3), track.values[4:6])
