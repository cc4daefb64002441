"""Files of every kind from and to stores: copied whole, said, and never over another unasked."""

import sys
from pathlib import Path

import fsspec
import numpy as np
import pytest

import meshreel
from meshreel.runtime.stores import transfer
from samples.commands import assert_fails, run, run_json
from samples.materials import dressed_sheet
from samples.meshes import waving_grid


@pytest.fixture
def memory():
    """The store of this process; empty."""
    store = fsspec.filesystem("memory")
    store.store.clear()
    yield store
    store.store.clear()


@pytest.fixture
def walk():
    return waving_grid(6)


def names(store):
    return sorted(store.store)


def leftovers(monkeypatch, tmp_path):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return lambda: sorted(path.name for path in tmp_path.iterdir())


def test_what_is_saved_into_a_store_is_loaded_from_it(memory, walk, monkeypatch, tmp_path):
    there = leftovers(monkeypatch, tmp_path)
    assert meshreel.save(walk, "memory://bucket/walk.npz") == ["memory://bucket/walk.npz"]
    notes: list[str] = []
    loaded = meshreel.load("memory://bucket/walk.npz", notes=notes)
    assert np.array_equal(loaded.vertices, walk.vertices)
    assert any("downloaded memory://bucket/walk.npz" in note for note in notes)
    assert there() == []


def test_encode_and_compare_take_addresses(memory, walk):
    meshreel.save(walk, "memory://bucket/walk.npz")
    data = meshreel.encode("memory://bucket/walk.npz", quality=60)
    assert data == meshreel.encode(walk, quality=60)
    assert meshreel.compare("memory://bucket/walk.npz", walk).max_error_percent == 0


def test_output_in_a_store_is_kept_unless_it_may_be_replaced(memory, walk):
    memory.pipe("/bucket/walk.npz", b"mine")
    with pytest.raises(
        meshreel.InvalidInputError, match=r"memory://bucket/walk\.npz already exists"
    ):
        meshreel.save(walk, "memory://bucket/walk.npz")
    assert memory.cat("/bucket/walk.npz") == b"mine"
    meshreel.save(walk, "memory://bucket/walk.npz", overwrite=True)
    assert meshreel.load("memory://bucket/walk.npz").n_frames == 6


def test_output_that_comes_up_during_the_work_is_kept(memory, walk, monkeypatch):
    uploading = transfer.upload_all

    def late(files, *, overwrite):
        memory.pipe("/bucket/walk.npz", b"theirs")
        uploading(files, overwrite=overwrite)

    monkeypatch.setattr("meshreel.formats.remote.upload_all", late)
    with pytest.raises(meshreel.InvalidInputError, match="exists"):
        meshreel.save(walk, "memory://bucket/walk.npz")
    assert memory.cat("/bucket/walk.npz") == b"theirs"


def test_frames_of_a_folder_come_in_natural_order(memory, walk):
    written = meshreel.save(walk, "memory://bucket/frames/f_%d.obj")
    assert names(memory) == [f"/bucket/frames/f_{number}.obj" for number in range(6)]
    assert written[0] == "memory://bucket/frames/f_0.obj"
    for source in ("memory://bucket/frames", "memory://bucket/frames/*.obj"):
        loaded = meshreel.load(source)
        assert np.allclose(loaded.vertices, walk.vertices, atol=1e-6)


def test_frames_are_uploaded_all_or_none(memory, walk):
    memory.pipe("/bucket/f_3.obj", b"mine")
    with pytest.raises(meshreel.InvalidInputError, match=r"f_3\.obj already exists"):
        meshreel.save(walk, "memory://bucket/f_%d.obj")
    assert names(memory) == ["/bucket/f_3.obj"]


def test_frames_that_came_before_a_failure_go_again(memory, walk, monkeypatch, tmp_path):
    there = leftovers(monkeypatch, tmp_path)
    putting = memory.put_file

    def breaking(place, path, **options):
        if path.endswith("f_3.obj"):
            raise ConnectionError("line is cut")
        putting(place, path, **options)

    monkeypatch.setattr(type(memory), "put_file", staticmethod(breaking))
    with pytest.raises(meshreel.StoreError, match=r"line is cut.*is kept in") as failure:
        meshreel.save(walk, "memory://bucket/f_%d.obj")
    assert names(memory) == []
    kept = Path(str(failure.value).rpartition(" ")[2])
    assert len(list(kept.iterdir())) == 6
    assert there() == [kept.name]


def test_files_that_were_there_stay_when_an_upload_fails(memory, tmp_path, monkeypatch):
    for name in ("a", "d"):
        memory.pipe(f"/bucket/{name}", b"old")
    files = {}
    for name in "abcd":
        (tmp_path / name).write_bytes(b"new")
        files[tmp_path / name] = f"memory://bucket/{name}"
    putting = memory.put_file

    def breaking(place, path, **options):
        if path.endswith("/c"):
            raise ConnectionError("line is cut")
        putting(place, path, **options)

    monkeypatch.setattr(type(memory), "put_file", staticmethod(breaking))
    with pytest.raises(meshreel.StoreError, match="line is cut"):
        transfer.upload_all(files, overwrite=True)
    assert names(memory) == ["/bucket/a", "/bucket/d"]
    assert (memory.cat("/bucket/a"), memory.cat("/bucket/d")) == (b"new", b"old")


def test_files_that_others_name_come_along(memory, tmp_path):
    meshreel.save(dressed_sheet(), "memory://bucket/walk.gltf")
    assert {"/bucket/walk.gltf", "/bucket/walk.bin"} & set(names(memory))
    local = tmp_path / "walk.gltf"
    meshreel.save(dressed_sheet(), local)
    expected, loaded = meshreel.load(local), meshreel.load("memory://bucket/walk.gltf")
    assert np.array_equal(loaded.vertices, expected.vertices)
    assert loaded.surface.images == expected.surface.images


def test_mesh_beside_a_point_cache_comes_along(memory, walk):
    meshreel.save(walk, "memory://bucket/walk.pc2")
    assert names(memory) == ["/bucket/walk.obj", "/bucket/walk.pc2"]
    loaded = meshreel.load("memory://bucket/walk.pc2")
    assert np.array_equal(loaded.faces, walk.faces)


def test_outputs_of_other_schemes_appear_under_their_names_at_the_end(walk, tmp_path):
    address = f"file://{tmp_path.as_posix()}/deep/walk.npz"
    assert meshreel.save(walk, address) == [address]
    assert [path.name for path in (tmp_path / "deep").iterdir()] == ["walk.npz"]


def test_no_hidden_file_is_left_when_it_cannot_be_renamed(monkeypatch, tmp_path):
    def refusing(store, old, new, **options):
        raise PermissionError("no renaming here")

    monkeypatch.setattr(type(fsspec.filesystem("file")), "mv", refusing)
    (tmp_path / "walk.npz").write_bytes(b"new")
    there = tmp_path / "there"
    with pytest.raises(meshreel.StoreError, match="no renaming here"):
        transfer.upload_all(
            {tmp_path / "walk.npz": f"file://{there.as_posix()}/walk.npz"}, overwrite=False
        )
    assert list(there.iterdir()) == []


def test_web_server_takes_no_outputs(walk):
    with pytest.raises(meshreel.StoreError, match="takes no files"):
        meshreel.save(walk, "https://example.invalid/walk.npz")


def test_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(meshreel.StoreError, match=r"needs fsspec.*meshreel\[remote\]"):
        meshreel.open("s3://bucket/walk.reel")


def test_missing_library_of_a_scheme_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "s3fs", None)
    classes = sys.modules["fsspec.registry"]._registry
    monkeypatch.delitem(classes, "s3", raising=False)
    with pytest.raises(meshreel.StoreError, match=r"s3fs.*meshreel\[remote\]"):
        meshreel.open("s3://bucket/walk.reel")


def test_unknown_scheme_is_refused():
    with pytest.raises(meshreel.StoreError, match="nowhere"):
        meshreel.open("nowhere://bucket/walk.reel")


def test_commands_take_addresses(memory, walk, tmp_path):
    meshreel.save(walk, "memory://bucket/walk.npz")
    made = run_json("encode", "memory://bucket/walk.npz", "-o", "memory://bucket/walk.reel")
    assert made["output"] == "memory://bucket/walk.reel"
    assert any("downloaded memory://bucket/walk.npz" in note for note in made["notes"])
    data = memory.cat("/bucket/walk.reel")
    assert data == meshreel.encode(walk)
    shown = run_json("info", "memory://bucket/walk.reel")
    assert shown["size_bytes"] == len(data)
    part = run_json(
        "decode", "memory://bucket/walk.reel", "-o", "memory://bucket/out/f_%d.obj",
        "--frames", "2:4",
    )  # fmt: skip
    assert part["outputs"] == [f"memory://bucket/out/f_{number}.obj" for number in (2, 3)]
    assert set(part["outputs"]) <= {f"memory:/{name}" for name in names(memory)}
    whole = run_json("decode", "memory://bucket/walk.reel", "-o", tmp_path / "back.npz")
    assert whole["n_frames"] == 6
    made = run_json("convert", "memory://bucket/walk.npz", "-o", "memory://bucket/walk.mdd")
    assert made["outputs"] == ["memory://bucket/walk.mdd", "memory://bucket/walk.obj"]


def test_commands_keep_what_is_there(memory, walk):
    meshreel.save(walk, "memory://bucket/walk.npz")
    memory.pipe("/bucket/walk.reel", b"mine")
    done = run("encode", "memory://bucket/walk.npz", "-o", "memory://bucket/walk.reel")
    assert_fails(done, "memory://bucket/walk.reel already exists", "--force")
    assert memory.cat("/bucket/walk.reel") == b"mine"


def test_live_recording_needs_a_file_of_this_machine(walk):
    with pytest.raises(meshreel.StoreError, match="must be on this machine"):
        meshreel.Encoder(walk.faces, "s3://bucket/live.reel")


@pytest.mark.parametrize(
    "arguments",
    [
        ("view", "s3://bucket/walk.reel"),
        ("export", "s3://bucket/walk.reel", "-o", "page.html"),
        ("render", "s3://bucket/walk.reel", "-o", "page.png"),
    ],
)
def test_commands_that_need_files_of_this_machine_say_so(arguments, tmp_path):
    (tmp_path / "in").mkdir()
    assert_fails(run(*arguments, cwd=tmp_path), "must be on this machine")


def test_folder_of_textures_goes_into_a_store_and_mixes_with_no_other(memory):
    pytest.importorskip("imagecodecs", reason="the extra [textures] is not installed")
    written = meshreel.save(waving_grid(4), "memory://bucket/walk.vat/")
    assert set(written) == {f"memory:/{name}" for name in names(memory)}
    assert all(name.startswith("/bucket/walk.vat/") for name in names(memory))
    with pytest.raises(meshreel.InvalidInputError, match="exists"):
        meshreel.save(waving_grid(4), "memory://bucket/walk.vat/")
    memory.pipe("/bucket/walk.vat/other.png", b"mine")
    with pytest.raises(meshreel.InvalidInputError, match="must not be mixed with the output"):
        meshreel.save(waving_grid(4), "memory://bucket/walk.vat/", overwrite=True)
