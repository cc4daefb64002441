"""The corpus: its manifest, files from git, and measurements."""

import subprocess
import sys

import numpy as np
import pytest

import meshreel
from corpus.measure import MIN_TIMED, SETTINGS, Subject, features, measure, memory_growth
from corpus.sources import KINDS, Files, Source, UnavailableError, first_frames, read_manifest
from corpus.tables import TABLES, losses_of, n_broken
from corpus.visible import SeenFrame
from samples.captures import as_frames, capture
from samples.meshes import irregular_sequence, waving_grid

NAME = "owner/meshes"


def source(path, commit="HEAD", **options):
    return Source(
        name="some", repo=NAME, commit=commit, licence="CC0-1.0", kind="cloth", path=path,
        needs=(), options=options,
    )  # fmt: skip


@pytest.fixture(scope="module")
def mirrors(tmp_path_factory):
    """A folder with the mirror of a repository that contains 12 frames."""
    folder = tmp_path_factory.mktemp("mirrors")
    repository = folder / "owner+meshes"
    meshreel.save(waving_grid(12).replace(name="walk"), repository / "frames" / "walk_%d.obj")
    git = ["git", "-C", str(repository), "-c", "user.name=a", "-c", "user.email=a@example.com"]
    for words in (["init", "-q"], ["add", "."], ["commit", "-qm", "frames"]):
        subprocess.run([*git, *words], check=True)
    return folder


def test_manifest_names_enough_sequences_of_known_kinds():
    sources = read_manifest()
    assert len(sources) >= 300
    assert {one.kind for one in sources} == set(KINDS)
    assert len({one.name for one in sources}) == len(sources)
    assert all(len(one.commit) == 40 for one in sources)


def test_frames_come_from_git_in_the_order_of_their_numbers(mirrors, tmp_path):
    sequence = source("frames/walk_*.obj", fps=25).load(Files(tmp_path, mirrors))
    np.testing.assert_array_equal(sequence.vertices, waving_grid(12).vertices)
    assert sequence.fps == 25


def test_missing_files_are_named(mirrors, tmp_path):
    with pytest.raises(UnavailableError, match=f"{NAME} has no file frames/run.obj"):
        Files(tmp_path, mirrors).fetch(source("frames/run.obj"))


def test_frames_are_cut_to_the_limits():
    long = waving_grid(130)
    assert first_frames(long).n_frames == 120
    wide = meshreel.MeshSequence(np.zeros((6, 70_000, 3), np.float32), long.faces)
    assert first_frames(wide).n_frames == 2


def test_vertices_without_faces_are_left_out_of_comparisons():
    original = irregular_sequence()
    subject = Subject.of(original).sequence
    assert subject.n_verts == len(np.unique(original.faces)) < original.n_verts


@pytest.mark.parametrize("sequence", [waving_grid(4), as_frames(capture(2))])
def test_all_codecs_are_measured_and_tables_made(sequence, monkeypatch):
    monkeypatch.setattr("corpus.visible.LINES", 216)  # a fifth, for speed
    for package in ("DracoPy", "pysz", "zfpy", "flip_evaluator"):
        pytest.importorskip(package)
    figures = measure(sequence, is_drawn=True)
    assert figures["n_frames"] == sequence.n_frames
    assert list(figures["settings"]) == list(SETTINGS)
    bounded = figures["settings"]["0.1%"]
    assert 0 < bounded["max"] <= 0.1
    assert not bounded["is_broken"]
    peers = {"draco", "sz3", "zfp"} if sequence.n_segments == 1 else {"draco"}
    assert peers <= bounded.keys()
    row = {"name": "some", "kind": "cloth", "repo": NAME, **figures}
    row |= {"features": features(sequence), "n_positions": MIN_TIMED}
    row["memory"] = {"encode": 100 * MIN_TIMED, "decode": 20 * MIN_TIMED}
    refused = {"name": "other", "kind": "cloth", "repo": NAME, "path": "a.obj", "refused": "no"}
    for make in TABLES.values():
        table = make([row, refused])
        assert all(len(line) == len(table.header) for line in table.rows)
    assert n_broken([row, refused])[1] == 2
    assert all(other < mine for _, _, mine, other in losses_of(row))


def test_flag_looks_like_its_original_at_the_default_quality():
    pytest.importorskip("flip_evaluator")
    flag = meshreel.simulate_flag(12)
    seen = SeenFrame(flag.vertices, flag.faces, is_drawn=True)
    fine, coarse = (
        seen.errors(meshreel.decode(meshreel.encode(flag, order="vertices", quality=q)).vertices)
        for q in (80, 60)
    )
    assert fine["flip"] < 0.05
    assert fine["silhouette_px"] < 0.5
    assert fine["normal"] < 1.5
    assert all(fine[key] < coarse[key] for key in fine)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_grows_by_the_decoded_positions_at_least():
    sequence = waving_grid(2000)
    assert memory_growth(sequence)["decode"] > sequence.vertices.nbytes


def test_features_tell_resting_vertices_and_repeated_sides():
    still = waving_grid(1)
    vertices = np.repeat(still.vertices, 3, axis=0)
    vertices[:, 0, 2] += [0, 1, 2]
    found = features(meshreel.MeshSequence(vertices, still.faces))
    assert found["resting"] == pytest.approx(1 - 1 / still.n_verts)
    flat = still.vertices * np.float32([1, 1, 0])
    assert features(meshreel.MeshSequence(flat, still.faces))["repeated"] > 0.9
