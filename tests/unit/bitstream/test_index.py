import pytest

from meshreel.bitstream.index import BlockPlace, read_index, write_index
from meshreel.errors import CorruptStreamError

PLACES = [BlockPlace(2, 100, (10, 5)), BlockPlace(3, 115, (4, 1))]
END = 120


def test_places_come_back_when_they_are_written():
    assert read_index(write_index(PLACES), END, n_tracks=2) == PLACES


def test_group_of_a_track_follows_those_before_it():
    assert [PLACES[1].group(track) for track in range(2)] == [(115, 119), (119, 120)]


@pytest.mark.parametrize(
    "places",
    [
        [BlockPlace(0, 100, (10, 5)), PLACES[1]],
        [PLACES[0], BlockPlace(0, 115, (4, 1))],
        [PLACES[0], BlockPlace(3, 115, (5, 0))],
    ],
    ids=["no frame in the first", "no frame in the last", "no byte of a track"],
)
def test_an_index_is_refused_when_a_block_is_empty(places):
    with pytest.raises(CorruptStreamError, match="lists 2 blocks"):
        read_index(write_index(places), END, n_tracks=2)


@pytest.mark.parametrize(("payload", "end"), [(b"", 119), (b"", 121), (b"\1", END)])
def test_an_index_is_refused_when_it_ends_elsewhere(payload, end):
    with pytest.raises(CorruptStreamError):
        read_index(write_index(PLACES) + payload, end, n_tracks=2)
