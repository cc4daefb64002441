"""Outputs that must not be written are rejected before any work."""

import pytest

import meshreel
from samples.commands import assert_fails, run
from samples.meshes import waving_grid


@pytest.mark.parametrize("force", [(), ("--force",)])
def test_encode_never_replaces_its_input(tmp_path, force):
    data = meshreel.encode(waving_grid(3))
    (tmp_path / "walk.reel").write_bytes(data)
    done = run("encode", "walk.reel", "-o", "walk.reel", *force, cwd=tmp_path)
    assert_fails(done, "walk.reel is the input, which is never replaced")
    assert (tmp_path / "walk.reel").read_bytes() == data
