"""Files and folders of stores: listed, read and written."""

import sys
from io import BytesIO

import fsspec
import numpy as np
import pytest

import meshreel
from meshreel.errors import InvalidInputError, StoreError
from meshreel.runtime.stores.filesystem import files_below, files_in, matches
from meshreel.runtime.stores.transfer import read_whole
from samples.captures import capture
from samples.commands import assert_fails, run, run_json
from samples.materials import dressed_sheet
from samples.meshes import waving_grid
from samples.stores import put


@pytest.fixture
def memory():
    """An empty store in the memory of this process."""
    store = fsspec.filesystem("memory")
    store.store.clear()
    yield store
    store.store.clear()


@pytest.fixture
def walk():
    return waving_grid(6)


def names(store):
    return sorted(store.store)


def temporary_files(monkeypatch, tmp_path):
    """Return a function that lists temporary files."""
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    return lambda: sorted(path.name for path in tmp_path.iterdir())


def test_sequence_is_downloaded_from_a_store(memory, walk, monkeypatch, tmp_path):
    left_files = temporary_files(monkeypatch, tmp_path)
    put(walk, "memory://bucket/walk.npz")
    notes: list[str] = []
    loaded = meshreel.load("memory://bucket/walk.npz", notes=notes)
    assert np.array_equal(loaded.vertices, walk.vertices)
    assert any("downloaded memory://bucket/walk.npz" in note for note in notes)
    assert left_files() == []


@pytest.mark.parametrize(("size", "message"), [(9, "cut short: 5 of 9"), (4, "more than 4 B")])
def test_files_of_another_size_than_announced_are_refused(memory, monkeypatch, size, message):
    class File(BytesIO):
        size: int

    File.size = size
    monkeypatch.setattr(type(memory), "open", lambda *_, **__: File(b"12345"))
    with pytest.raises(StoreError, match=message):
        read_whole("memory://a", 100)


def test_encode_and_compare_accept_addresses(memory, walk):
    put(walk, "memory://bucket/walk.npz")
    data = meshreel.encode("memory://bucket/walk.npz", quality=60)
    assert data == meshreel.encode(walk, quality=60)
    assert meshreel.compare("memory://bucket/walk.npz", walk).max_error_percent == 0


def test_compare_command_accepts_addresses(memory, walk, tmp_path):
    put(walk, "memory://bucket/walk.npz")
    meshreel.save(walk, tmp_path / "walk.npz")
    figures = run_json("compare", "memory://bucket/walk.npz", tmp_path / "walk.npz")
    assert figures["max_error_percent"] == 0


def test_register_downloads_addresses(memory):
    pytest.importorskip("scipy", reason="the extra [register] is not installed")
    put(capture(2, 0.1), "memory://capture/frame_%02d.ply")
    assert meshreel.register("memory://capture/frame_*.ply", tolerance="2%").n_segments == 1


def test_frames_of_a_folder_are_loaded_in_natural_order(memory, walk):
    put(walk, "memory://bucket/frames/f_%d.obj")
    assert names(memory) == [f"/bucket/frames/f_{number}.obj" for number in range(6)]
    for source in ("memory://bucket/frames", "memory://bucket/frames/*.obj"):
        loaded = meshreel.load(source)
        assert np.allclose(loaded.vertices, walk.vertices, atol=1e-6)


def test_frames_of_equal_names_in_several_folders_are_an_error(memory, walk):
    for folder in "ab":
        put(walk, f"memory://bucket/{folder}/f_%d.obj")
    with pytest.raises(InvalidInputError, match="two remote frames have the same file name"):
        meshreel.load("memory://bucket/*/*.obj")


def test_referenced_files_are_transferred_too(memory, tmp_path):
    put(dressed_sheet(), "memory://bucket/walk.gltf")
    local = tmp_path / "walk.gltf"
    meshreel.save(dressed_sheet(), local)
    expected, loaded = meshreel.load(local), meshreel.load("memory://bucket/walk.gltf")
    assert np.array_equal(loaded.vertices, expected.vertices)
    assert loaded.surface.images == expected.surface.images


def test_mesh_of_a_point_cache_is_transferred_too(memory, walk):
    put(walk, "memory://bucket/walk.pc2")
    loaded = meshreel.load("memory://bucket/walk.pc2")
    assert np.array_equal(loaded.faces, walk.faces)


def test_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec.core", None)
    with pytest.raises(meshreel.StoreError, match=r"needs fsspec.*meshreel\[s3\]"):
        meshreel.open("s3://bucket/walk.reel")


def test_missing_library_of_a_scheme_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "s3fs", None)
    classes = sys.modules["fsspec.registry"]._registry
    monkeypatch.delitem(classes, "s3", raising=False)
    with pytest.raises(meshreel.StoreError, match=r"s3fs.*meshreel\[s3\]"):
        meshreel.open("s3://bucket/walk.reel")


def test_unknown_scheme_is_rejected():
    with pytest.raises(meshreel.StoreError, match="nowhere"):
        meshreel.open("nowhere://bucket/walk.reel")


def test_commands_read_addresses(memory, walk, tmp_path):
    put(walk, "memory://bucket/walk.npz")
    encoded = run_json("encode", "memory://bucket/walk.npz", "-o", tmp_path / "walk.reel")
    assert any("downloaded memory://bucket/walk.npz" in note for note in encoded["notes"])
    data = (tmp_path / "walk.reel").read_bytes()
    assert data == meshreel.encode(walk)
    memory.pipe("/bucket/walk.reel", data)
    assert run_json("info", "memory://bucket/walk.reel")["size_bytes"] == len(data)
    for options, n_frames in (((), 6), (("--frames", "2:4"), 2)):
        command = "decode", "memory://bucket/walk.reel", "-o", tmp_path / "back.npz", "--force"
        assert run_json(*command, *options)["n_frames"] == n_frames
    run_json("convert", "memory://bucket/walk.npz", "-o", tmp_path / "walk.mdd")
    assert meshreel.load(tmp_path / "walk.mdd").n_frames == 6


@pytest.mark.parametrize("command", ["encode", "convert", "decode", "register"])
def test_commands_write_no_addresses(command, walk, tmp_path):
    extension = ".reel" if command == "decode" else ".npz"
    output = "s3://bucket/walk" + (".npz" if command in ("convert", "decode") else ".reel")
    meshreel.save(walk, tmp_path / f"walk{extension}")
    done = run(command, tmp_path / f"walk{extension}", "-o", output)
    assert_fails(done, f"{output}: the output must be on this machine")


def test_save_writes_no_addresses(walk):
    with pytest.raises(meshreel.StoreError, match="the output must be on this machine"):
        meshreel.save(walk, "s3://bucket/walk.npz")


def test_live_recording_needs_a_local_file(walk):
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
def test_commands_reject_addresses_when_they_need_local_files(arguments, tmp_path):
    (tmp_path / "in").mkdir()
    assert_fails(run(*arguments, cwd=tmp_path), "must be on this machine")


FILES = {"/bucket/a/1.obj": b"1", "/bucket/a/b/22.obj": b"22", "/bucket/a/b/3.ply": b"333",
         "/bucket/ab/4.obj": b"4"}  # fmt: skip


@pytest.fixture
def memory_store():
    store = fsspec.filesystem("memory")
    store.store.clear()
    for path, data in FILES.items():
        store.pipe(path, data)
    yield store
    store.store.clear()


@pytest.mark.parametrize("extension", ["", "/"])
def test_files_below_lists_the_folder_recursively(memory_store, extension):
    files = files_below(f"memory://bucket/a{extension}")
    assert sorted((file.name, file.size_bytes) for file in files) == [
        ("1.obj", 1), ("b/22.obj", 2), ("b/3.ply", 3),
    ]  # fmt: skip


@pytest.mark.parametrize("folder", ["none", "a/1.obj"])
def test_listing_is_empty_when_the_folder_does_not_exist(memory_store, folder):
    assert files_below(f"memory://bucket/{folder}") == []
    assert files_in(f"memory://bucket/{folder}") == []


def test_files_in_lists_only_the_folder_itself(memory_store):
    assert files_in("memory://bucket/a") == ["memory:///bucket/a/1.obj"]


def test_matches_lists_the_files_of_a_pattern(memory_store):
    assert matches("memory://bucket/*/*.obj") == [
        "memory:///bucket/a/1.obj", "memory:///bucket/ab/4.obj",
    ]  # fmt: skip
    assert matches("memory://bucket/a/b/?.*") == ["memory:///bucket/a/b/3.ply"]


def version_of(name):
    [version] = [one.version for one in files_below("memory://bucket/a") if one.name == name]
    return version


def test_version_changes_only_with_its_file(memory_store):
    before = version_of("1.obj"), version_of("b/22.obj")
    memory_store.pipe("/bucket/a/1.obj", b"0")
    assert version_of("1.obj") not in ("", before[0])
    assert version_of("b/22.obj") == before[1]


@pytest.mark.parametrize(
    ("facts", "version"),
    [
        ({"ETag": "e", "LastModified": "l"}, "e"),
        ({"ETag": "", "LastModified": "l", "size": None}, "l"),
        ({"mtime": 1.5}, "1.5"),
        ({}, ""),
    ],
)
def test_version_is_the_first_available_property(memory_store, monkeypatch, facts, version):
    monkeypatch.setattr(
        type(memory_store), "find", lambda store, path, detail: {"/bucket/a/1.obj": facts}
    )
    assert [(one.version, one.size_bytes) for one in files_below("memory://bucket/a")] == [
        (version, 0)
    ]


@pytest.mark.parametrize("function", [files_below, files_in, matches])
def test_web_server_lists_no_folders(function):
    with pytest.raises(StoreError, match="lists no folders"):
        function("https://example.invalid/frames/")
