"""Representations of objects in one line."""

from io import BytesIO

import numpy as np
import pytest

import meshreel
from samples.meshes import grid_faces, waving_grid

GRID = waving_grid(9)
DATA = meshreel.encode(GRID, block_frames=4, effort=5)


@pytest.mark.parametrize(
    "shown",
    [
        GRID,
        meshreel.ReelFile(BytesIO(DATA)),
        meshreel.info(DATA),
        meshreel.compare(GRID, DATA),
        meshreel.Encoder(grid_faces(3, 4), BytesIO(), name="live"),
    ],
    ids=lambda shown: type(shown).__name__,
)
def test_repr_is_one_line_that_begins_with_the_type(shown):
    text = repr(shown)
    assert text.startswith(f"<{type(shown).__name__}")
    assert "\n" not in text
    assert len(text) < 200


def test_repr_of_quality_contains_the_errors():
    quality = meshreel.compare(GRID, DATA)
    assert f"KG error {quality.kg_error_percent:.4g} %" in repr(quality)
    assert f"STED {quality.sted:.4g}" in repr(quality)
    assert f"largest error {quality.max_error_percent:.4g} %" in repr(quality)
    assert "9 frames" in repr(quality)


def test_repr_of_stream_info_contains_shape_and_size():
    stream = meshreel.info(DATA)
    assert f"9 frames, {GRID.n_verts} vertices, {GRID.n_faces} faces" in repr(stream)
    assert f"reel, {len(DATA)} bytes, {stream.ratio:.1f} x smaller" in repr(stream)
    assert "cut off" not in repr(stream)


def test_repr_of_encoder_contains_its_progress():
    encoder = meshreel.Encoder(GRID.faces, BytesIO(), fps=25, block_frames=9)
    assert repr(encoder) == (
        f"<Encoder, open: 0 frames pushed, 0 bytes written, {GRID.n_faces} faces, 25 fps>"
    )
    for frame in GRID.vertices:
        encoder.push(frame)
    encoder.close()
    assert repr(encoder).startswith("<Encoder, closed: 9 frames pushed")
    assert f"{encoder.size_bytes} bytes written" in repr(encoder)


def test_repr_of_one_frame_is_in_the_singular():
    frame = meshreel.MeshSequence(np.eye(3)[None], [[0, 1, 2]])
    counts = "1 frame, 3 vertices, 1 face, "
    assert repr(frame).startswith(f"<MeshSequence: {counts}")
    assert repr(meshreel.ReelFile(BytesIO(meshreel.encode(frame)))).startswith(
        f"<ReelFile: {counts}"
    )
