"""The core and the plain reader decode the stored streams to their descriptions."""

from contextlib import suppress
from io import BytesIO

import pytest

import meshreel
from conformance.bits import DamagedError
from conformance.by_core import read_all_by_core, reported_by_core
from conformance.by_hand import with_nugget
from conformance.check import differences
from conformance.make import FOLDER, REFUSED, REFUSED_FOLDER, STREAMS
from conformance.reader import read, read_all
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import CorruptStreamError

QUICK = (
    "corrections",
    "everything_quantised",
    "grid_live",
    "grid_one_frame",
    "grid_one_frame_not_manifold",
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
"""Streams of each kind that the plain reader decodes quickly."""

REFUSED_FILES = sorted(REFUSED_FOLDER.glob("*.reel"))

MAX_FOLDER_BYTES = 1_000_000


def test_every_stream_is_stored_with_its_description():
    assert {path.stem for path in FOLDER.glob("*.reel")} == set(STREAMS)
    assert {path.stem for path in FOLDER.glob("*.json")} == set(STREAMS)
    assert len(STREAMS) >= 40
    assert sum(path.stat().st_size for path in FOLDER.iterdir()) < MAX_FOLDER_BYTES


@pytest.mark.every_case
@pytest.mark.parametrize("name", STREAMS)
def test_core_reproduces_the_description(name):
    assert differences(name, read_all_by_core, reported_by_core) == []


@pytest.mark.every_case
@pytest.mark.parametrize("name", QUICK)
def test_plain_reader_reproduces_the_description(name):
    assert differences(name, read_all) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(STREAMS) - set(QUICK)))
def test_plain_reader_reproduces_the_description_of_slow_streams(name):
    assert differences(name, read_all) == []


def test_every_refused_stream_is_stored():
    assert {path.stem for path in REFUSED_FILES} == set(REFUSED)


def surface_and_first_frames(data):
    reel = ReelFile(BytesIO(data))
    return reel.surface, [part[0] for part in (reel, *reel.tracks.values())]


@pytest.mark.every_case
@pytest.mark.parametrize("path", REFUSED_FILES, ids=lambda path: path.stem)
def test_every_reader_refuses_a_stream_that_breaks_a_rule(path):
    data = path.read_bytes()
    with pytest.raises(CorruptStreamError):
        meshreel.decode(data)
    with pytest.raises(CorruptStreamError):
        surface_and_first_frames(data)
    with pytest.raises(DamagedError):
        read(data)


@pytest.mark.parametrize("path", REFUSED_FILES, ids=lambda path: path.stem)
def test_info_refuses_streams_with_a_broken_header_or_leading_section(path):
    of_blocks = "rests", "rounding", "grid", "relation"  # info does not decode blocks
    is_of_blocks = path.stem.startswith(of_blocks)
    with suppress(CorruptStreamError) if is_of_blocks else pytest.raises(CorruptStreamError):
        meshreel.info(path.read_bytes())


def test_every_reader_refuses_a_nugget_out_of_range():
    assert meshreel.decode(with_nugget(24)).n_frames == 2
    with pytest.raises(CorruptStreamError, match="nugget"):
        meshreel.decode(with_nugget(25))
    with pytest.raises(DamagedError, match="nugget"):
        read(with_nugget(25))
