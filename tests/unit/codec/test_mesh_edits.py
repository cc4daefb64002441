"""Meshes stored as edits of other meshes."""

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import meshreel
from conformance.segments import edits
from conformance.sources import grid
from meshreel import MeshSequence
from meshreel.codec import mesh_edits
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.joining import separate_stream
from meshreel.codec.mesh_edits import BaseMesh, MeshEdits, find_edit
from meshreel.codec.open_stream import OpenStream

SHEET = grid(30, 40).astype(np.int32)
N_VERTS = 1200


def edit_of(faces, n_verts=N_VERTS):
    return find_edit(BaseMesh(SHEET, N_VERTS), np.asarray(faces, np.int32), n_verts)


def frames_of(faces, n_verts, n_frames=2, seed=0):
    vertices = np.random.default_rng(seed).normal(size=(n_frames, n_verts, 3))
    return MeshSequence(vertices.astype(np.float32), np.asarray(faces, np.int32))


def round_trip(*meshes, **options):
    """Return the stream of the meshes, after checking that it has their faces."""
    sequence = MeshSequence.of_segments(
        [frames_of(faces, n_verts, seed=i) for i, (faces, n_verts) in enumerate(meshes)]
    )
    data = meshreel.encode(sequence, order="keep", **options)
    decoded = meshreel.decode(data)
    for segment, original in zip(decoded.segments, sequence.segments, strict=True):
        np.testing.assert_array_equal(segment.faces, original.faces)
    return data, sequence, decoded


def sections_of(data, segment):
    return [section.id for section in OpenStream(data, segment=segment).file.leading]


def test_dropped_faces_are_listed_as_runs():
    result = edit_of(np.delete(SHEET, slice(100, 160), axis=0))
    np.testing.assert_array_equal(result.base_verts, np.arange(N_VERTS))
    expected = np.delete(np.arange(len(SHEET)), slice(100, 160))
    np.testing.assert_array_equal(result.base_faces, expected)
    assert len(result.payload) < 20


def test_a_run_of_vertices_is_dropped_with_its_faces():
    kept = SHEET[(SHEET >= 400).all(axis=1) | (SHEET < 300).all(axis=1)]
    result = edit_of(np.where(kept >= 400, kept - 100, kept), N_VERTS - 100)
    np.testing.assert_array_equal(result.base_verts, np.delete(np.arange(N_VERTS), slice(300, 400)))
    assert (result.base_faces >= 0).all()


def test_inserted_vertices_and_faces_are_new():
    moved = np.where(SHEET >= 600, SHEET + 3, SHEET)
    result = edit_of([*moved[:900], [600, 601, 602], *moved[900:]], N_VERTS + 3)
    assert np.flatnonzero(result.base_verts < 0).tolist() == [600, 601, 602]
    assert np.flatnonzero(result.base_faces < 0).tolist() == [900]


def test_vertices_are_not_searched_for_when_most_numbers_are_equal_or_shifted(monkeypatch):
    monkeypatch.delattr(mesh_edits, "match_vertices")
    kept = SHEET[(SHEET >= 903).all(axis=1) | (SHEET < 900).all(axis=1)]
    result = edit_of(np.where(kept >= 903, kept - 3, kept), N_VERTS - 3)
    np.testing.assert_array_equal(result.base_verts, np.delete(np.arange(N_VERTS), slice(900, 903)))


def test_faces_in_another_order_are_new():
    result = edit_of([SHEET[-1], *SHEET[:-1]])
    assert np.flatnonzero(result.base_faces < 0).tolist() == [0]


@pytest.mark.parametrize("n_verts", [N_VERTS, N_VERTS + 5, N_VERTS - 5])
def test_an_unrelated_mesh_is_no_edit(n_verts):
    rng = np.random.default_rng(1)
    assert edit_of(rng.integers(0, n_verts, SHEET.shape), n_verts) is None
    assert edit_of(rng.permutation(N_VERTS)[SHEET]) is None  # renumbered


def test_a_mesh_that_is_no_edit_is_the_next_base():
    edits_of_stream, holes = MeshEdits(), np.delete(SHEET, slice(100, 160), axis=0)
    other = SHEET[::-1].copy()
    assert edits_of_stream.edit_to(SHEET, N_VERTS) is None
    assert edits_of_stream.edit_to(holes, N_VERTS) is not None
    assert edits_of_stream.edit_to(SHEET, N_VERTS) is None
    assert edits_of_stream.edit_to(other, N_VERTS) is None
    assert edits_of_stream.edit_to(holes, N_VERTS) is None


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"lossless": True}, {"block_frames": 1}])
def test_edited_meshes_share_connectivity_and_order(options):
    holes = np.delete(SHEET, slice(100, 160), axis=0)
    data, sequence, decoded = round_trip((SHEET, N_VERTS), (holes, N_VERTS), **options)
    shared = sections_of(data, 1)
    assert shared[:3] == [Section.CONNECTIVITY, Section.ORDER, Section.EDIT]
    alone = meshreel.encode(sequence.segments[1], order="keep", **options)
    mesh_sections = (Section.CONNECTIVITY, Section.ORDER)
    leading = OpenStream(alone).file.leading
    stored = sum(section.payload_bytes for section in leading if section.id in mesh_sections)
    base = meshreel.encode(sequence.segments[0], order="keep", **options)
    assert len(data) < len(base) + len(alone) - stored / 2
    if "lossless" in options:
        np.testing.assert_array_equal(decoded.segments[1].vertices, sequence.segments[1].vertices)


def test_meshes_without_order_are_no_edits():
    holes = np.delete(SHEET, slice(100, 160), axis=0)
    sequence = MeshSequence.of_segments([frames_of(SHEET, N_VERTS), frames_of(holes, N_VERTS)])
    data = meshreel.encode(sequence, order="drop")
    assert Section.EDIT not in sections_of(data, 1)


def test_live_encoder_writes_edits(tmp_path):
    holes = np.delete(SHEET, slice(100, 160), axis=0)
    path = tmp_path / "live.reel"
    frames = np.random.default_rng(4).normal(size=(4, N_VERTS, 3)).astype(np.float32)
    with meshreel.Encoder(SHEET, path, order="keep") as encoder:
        for number, frame in enumerate(frames):
            encoder.push(frame, faces=SHEET if number < 2 else holes)
    data = path.read_bytes()
    assert Section.EDIT in sections_of(data, 1)
    np.testing.assert_array_equal(meshreel.decode(data).segments[1].faces, holes)


def test_a_segment_alone_has_the_base_and_the_edit():
    holes = np.delete(SHEET, slice(100, 160), axis=0)
    data, _, decoded = round_trip((SHEET, N_VERTS), (holes, N_VERTS), (SHEET[:-9], N_VERTS))
    alone = meshreel.decode(separate_stream(OpenStream(data, segment=1)))
    np.testing.assert_array_equal(alone.faces, holes)
    np.testing.assert_array_equal(alone.vertices, decoded.segments[1].vertices)


@pytest.mark.slow
@given(st.data())
def test_any_edit_round_trips(data):
    faces, n_verts = data.draw(st.sampled_from(edits()))
    rng = np.random.default_rng(data.draw(st.integers(0, 10**6)))
    kept = faces[rng.random(len(faces)) < data.draw(st.sampled_from([0.6, 0.9, 0.99, 1.0]))]
    start, length = rng.integers(0, n_verts), int(rng.integers(-3, 4))
    if length >= 0:
        kept, count = np.where(kept >= start, kept + length, kept), n_verts + length
    else:
        kept = kept[((kept < start) | (kept >= start - length)).all(axis=1)]
        stop = min(n_verts, start - length)
        kept, count = np.where(kept >= start, kept - (stop - start), kept), n_verts - stop + start
    new = rng.integers(0, count, (int(rng.integers(0, 4)), 3))
    at = int(rng.integers(0, len(kept) + 1))
    changed = np.concatenate([kept[:at], new, kept[at:]])
    if len(changed):
        small = data.draw(st.sampled_from([0, 100]))  # any edit, from either search
        with (
            patch.object(mesh_edits, "SMALL_BYTES_PER_FACE", small),
            patch.object(mesh_edits, "MAX_SIZE", 100),
        ):
            round_trip((faces, n_verts), (changed, count), step=0.01)
