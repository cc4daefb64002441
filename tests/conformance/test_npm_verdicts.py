"""Damaged streams: the npm package in Node accepts those that the Python package accepts."""

import json
import struct
import subprocess
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

import meshreel
from conformance import segments
from conformance.make import FOLDER, REFUSED_FOLDER
from meshreel.codec.bitstream.container import write_sections
from meshreel.codec.bitstream.layout import INDEX_POSITION, Section
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import MeshReelError
from samples.costs import draws
from samples.streams import Stream
from samples.web_package import built_package

NAMES = (
    "example",
    "grid_live",
    "key_blocks",
    "max_error",
    "named",
    "no_index",
    "tracks_of_triangles",
)
MEMORY = 20_000_000
PROGRAM = Path(__file__).with_name("npm_verdicts.mjs")


def flipped(data, rng):
    """Change a byte, or cut the stream."""
    changed = bytearray(data)
    changed[rng.integers(len(data))] ^= rng.integers(1, 256)
    return bytes(changed if rng.integers(2) else data[: rng.integers(len(data))])


def rearranged(data, rng):
    """Change, omit, repeat or move a section; checksums are right."""
    stream = Stream(data)
    parts, number, kind = list(stream.sections), rng.integers(len(stream.sections)), rng.integers(4)
    section, payload = parts[number]
    if kind == 0 and payload:
        changed = bytearray(payload)
        changed[rng.integers(len(payload))] = rng.integers(256)
        parts[number] = section, bytes(changed)
    elif kind == 1:
        parts.insert(rng.integers(len(parts) + 1), parts[number])
    else:
        del parts[number]
        if kind == 2:
            parts.insert(rng.integers(len(parts) + 1), (section, payload))
    head = data[: stream.header_size_bytes]
    if rng.integers(2) and parts:  # the position of INDEX as it now is
        ids = [section for section, _ in parts]
        if parts[-1][0] is Section.END and Section.INDEX in ids:
            before = write_sections(parts[: ids.index(Section.INDEX)])
            position = INDEX_POSITION.pack(len(head) + sum(map(len, before)))
            parts[-1] = Section.END, position
    return head + b"".join(write_sections(parts))


def verdict(data):
    """Return whether a stream decodes as a whole, and whether frames of its blocks do."""
    try:
        meshreel.decode(data, memory=MEMORY)
        return True, True
    except MeshReelError:
        pass
    try:
        with ReelFile(BytesIO(data), memory=MEMORY) as reel:
            assert reel.faces is not None
            assert reel.surface is not None
            for frame in range(reel.n_frames):
                reel.read(frame, frame + 1)
            for track in reel.tracks.values():
                track.frames(range(reel.n_frames))
        return False, True
    except MeshReelError:
        return False, False


def verdicts_of_node(streams):
    script = built_package() / "index.js"
    data = b"".join(struct.pack("<I", len(stream)) + stream for stream in streams)
    command = ["node", PROGRAM, script.as_uri(), str(MEMORY)]
    found = subprocess.run(command, input=data, capture_output=True, check=True, timeout=100)
    return [tuple(one) for one in json.loads(found.stdout)]


@pytest.mark.every_case
@pytest.mark.parametrize("damage", [flipped, rearranged])
def test_node_accepts_what_python_accepts(damage):
    rng = np.random.default_rng(20)
    streams = [
        damage((FOLDER / f"{name}.reel").read_bytes(), rng)
        for name in NAMES
        for _ in range(draws(100))
    ]
    expected = list(map(verdict, streams))
    assert verdicts_of_node(streams) == expected
    assert 0 < expected.count((False, True)) < len(expected)


def test_node_refuses_streams_that_break_a_rule():
    paths = sorted([*REFUSED_FOLDER.glob("*.reel"), *segments.REFUSED_FOLDER.glob("*.reel")])
    verdicts = verdicts_of_node([path.read_bytes() for path in paths])
    whole = zip(paths, (is_whole for is_whole, _ in verdicts), strict=True)
    assert [path.stem for path, is_whole in whole if is_whole] == []
