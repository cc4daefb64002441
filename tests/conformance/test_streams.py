"""The stored streams: the core and the plain reader find in them what is said beside them."""

import pytest

from conformance.by_core import read_by_core
from conformance.check import differences
from conformance.make import FOLDER, STREAMS
from conformance.reader import read

QUICK = (
    "corrections",
    "everything_quantised",
    "grid_live",
    "hub_in_order",
    "key_blocks",
    "large_residuals",
    "no_more_rows",
    "one_face",
    "paper_blocks",
    "paper_gft",
    "pinched",
    "tangled",
)
"""One of each kind; the plain reader takes a second or so for some of the others."""

LARGEST_FOLDER_BYTES = 1_000_000


def test_every_stream_is_stored_with_what_it_holds():
    assert {path.stem for path in FOLDER.glob("*.reel")} == set(STREAMS)
    assert {path.stem for path in FOLDER.glob("*.json")} == set(STREAMS)
    assert len(STREAMS) >= 40
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < LARGEST_FOLDER_BYTES


@pytest.mark.every_case
@pytest.mark.parametrize("name", STREAMS)
def test_core_finds_what_is_said_of_a_stream(name):
    assert differences(name, read_by_core) == []


@pytest.mark.every_case
@pytest.mark.parametrize("name", QUICK)
def test_plain_reader_finds_what_is_said_of_a_stream(name):
    assert differences(name, read) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(STREAMS) - set(QUICK)))
def test_plain_reader_finds_what_is_said_of_a_stream_when_it_takes_longer(name):
    assert differences(name, read) == []
