"""Listing of folders in stores, and versions of files."""

import fsspec
import pytest

from meshreel.errors import StoreError
from meshreel.runtime.stores.filesystem import files_below, files_in, matches

FILES = {"/bucket/a/1.obj": b"1", "/bucket/a/b/22.obj": b"22", "/bucket/a/b/3.ply": b"333",
         "/bucket/ab/4.obj": b"4"}  # fmt: skip


@pytest.fixture
def memory():
    store = fsspec.filesystem("memory")
    store.store.clear()
    for path, data in FILES.items():
        store.pipe(path, data)
    yield store
    store.store.clear()


@pytest.mark.parametrize("extension", ["", "/"])
def test_files_below_lists_the_folder_recursively(memory, extension):
    files = files_below(f"memory://bucket/a{extension}")
    assert sorted((file.name, file.address, file.size_bytes) for file in files) == [
        ("1.obj", "memory:///bucket/a/1.obj", 1),
        ("b/22.obj", "memory:///bucket/a/b/22.obj", 2),
        ("b/3.ply", "memory:///bucket/a/b/3.ply", 3),
    ]


@pytest.mark.parametrize("folder", ["none", "a/1.obj"])
def test_listing_is_empty_when_the_folder_does_not_exist(memory, folder):
    assert files_below(f"memory://bucket/{folder}") == []
    assert files_in(f"memory://bucket/{folder}") == []


def test_files_in_lists_only_the_folder_itself(memory):
    assert files_in("memory://bucket/a") == ["memory:///bucket/a/1.obj"]


def test_matches_lists_the_files_of_a_pattern(memory):
    assert matches("memory://bucket/*/*.obj") == [
        "memory:///bucket/a/1.obj", "memory:///bucket/ab/4.obj",
    ]  # fmt: skip
    assert matches("memory://bucket/a/b/?.*") == ["memory:///bucket/a/b/3.ply"]


def version_of(name):
    [version] = [one.version for one in files_below("memory://bucket/a") if one.name == name]
    return version


def test_version_changes_only_with_its_file(memory):
    before = version_of("1.obj"), version_of("b/22.obj")
    memory.pipe("/bucket/a/1.obj", b"0")
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
def test_version_is_the_first_available_property(memory, monkeypatch, facts, version):
    monkeypatch.setattr(
        type(memory), "find", lambda store, path, detail: {"/bucket/a/1.obj": facts}
    )
    assert [(one.version, one.size_bytes) for one in files_below("memory://bucket/a")] == [
        (version, 0)
    ]


@pytest.mark.parametrize("function", [files_below, files_in, matches])
def test_web_server_lists_no_folders(function):
    with pytest.raises(StoreError, match="lists no folders"):
        function("https://example.invalid/frames/")
