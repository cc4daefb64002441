from pathlib import Path

import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.sources import find_files, natural_order


def touch(folder, *names):
    for name in names:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text("not empty")
    return folder


def names(found):
    return [path.name for path in found.paths]


def test_natural_order_sorts_unpadded_numbers():
    mixed = ["f10.obj", "F2.obj", "f1.obj", "f02.obj", "g.obj", "10.obj", "9.obj"]
    expected = ["9.obj", "10.obj", "f1.obj", "f02.obj", "F2.obj", "f10.obj", "g.obj"]
    assert [str(path) for path in natural_order(map(Path, mixed))] == expected


VALUES = "t_0.25 t_0.5 t_1.0, t_0.5 t_1 t_1.5 t_10, r-0.001 r-0.0015 r-0.01 r-0.021330, a0.05 a0.1"
OTHERS = "v1.2 v1.10, v1.9.2 v1.10.1, t1.1 t1.2 t1.10 t2.1, f1.099 f1.999 f1.1000, f.9 f.10"


@pytest.mark.parametrize("names", [*VALUES.split(", "), *OTHERS.split(", ")])
def test_natural_order_tells_decimal_numbers_from_versions_and_counts(names):
    files = [f"{name}.obj" for name in names.split()]
    assert natural_order(reversed(files)) == files


def test_folder_means_its_sorted_mesh_files(tmp_path):
    touch(tmp_path, "f_10.obj", "f_2.OBJ", ".f_1.obj", "f.mtl", "notes.txt", "._x.ply")
    result = find_files(tmp_path)
    assert (names(result), result.name) == (["f_2.OBJ", "f_10.obj"], tmp_path.name)


def test_pattern_means_its_matches(tmp_path):
    touch(tmp_path, "f_10.obj", "f_2.obj", "f_2.mtl", "g_1.obj", "f_3.ply")
    result = find_files(f"{tmp_path}/f_*.[om]*")
    assert (names(result), result.name) == (["f_2.obj", "f_10.obj"], tmp_path.name)


@pytest.mark.parametrize(("field", "found"), [("%04d", "f_0002.obj"), ("%d", "f_2.obj")])
def test_numbered_pattern_means_numbers_of_its_width(tmp_path, field, found):
    touch(tmp_path, "f_2.obj", "f_02.obj", "f_0002.obj", "g_2.obj", "f_x.obj")
    assert names(find_files(f"{tmp_path}/f_{field}.obj")) == [found]


def test_existing_file_takes_precedence_over_a_pattern(tmp_path):
    touch(tmp_path, "a[1].obj", "a1.obj")
    result = find_files(str(tmp_path / "a[1].obj"))
    assert (names(result), result.name) == (["a[1].obj"], "a[1]")


def test_list_keeps_its_order(tmp_path):
    touch(tmp_path, "b.obj", "a.obj")
    result = find_files([tmp_path / "b.obj", str(tmp_path / "a.obj")])
    assert (names(result), result.name) == (["b.obj", "a.obj"], tmp_path.name)


def test_list_of_one_folder_means_its_files(tmp_path):
    assert names(find_files((touch(tmp_path, "b.obj", "a.obj"),))) == ["a.obj", "b.obj"]


@pytest.mark.parametrize("extension", [".npz", ".OBJ", ".ply", ".off", ".stl"])
def test_name_of_a_single_file_is_its_stem(tmp_path, extension):
    assert find_files(touch(tmp_path, f"walk{extension}") / f"walk{extension}").name == "walk"


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("none.obj", "there is no file or folder '.*none.obj'"),
        ("frame_%04d.obj", r"no numbered one; .* such as dir/f_%04d\.obj"),
        ("none_*.obj", "the pattern '.*' matches no file"),
    ],
)
def test_error_for_a_missing_source_repeats_it(tmp_path, source, message):
    with pytest.raises(InvalidInputError, match=message):
        find_files(f"{tmp_path}/{source}")


@pytest.mark.parametrize("name", ["wlak.glb", "WALKS.GLB", "walk.gltf"])
def test_error_for_a_missing_file_suggests_a_similar_name(tmp_path, name):
    touch(tmp_path, "walk.glb", "other.npz")
    with pytest.raises(InvalidInputError, match=r"'.*'; did you mean '.*walk\.glb'\?$"):
        find_files(tmp_path / name)


def test_empty_list_is_rejected():
    with pytest.raises(InvalidInputError, match="the list of frame files is empty"):
        find_files([])


def test_error_names_a_missing_file_of_a_list(tmp_path):
    touch(tmp_path, "a.obj")
    with pytest.raises(InvalidInputError, match=r"there is no file or folder '.*b\.obj'"):
        find_files([tmp_path / "a.obj", tmp_path / "b.obj"])


@pytest.mark.parametrize(
    ("files", "source", "message"),
    [
        (["a.txt"], "a.txt", r"unknown file extension \.txt; known are \.obj, \.ply, .*\.npz"),
        (["a.txt"], "*.txt", r"unknown file extension \.txt"),
        (["a.fbx"], "a.fbx", r"\.fbx files are neither read nor written; .* as Alembic \(\.abc"),
        (["a.Blend"], "*.Blend", r"\.blend files .* exchange animations with Blender as"),
        (["README"], "README", r"unknown file extension \(none\)"),
        (["a.obj", "b.obj", "a.ply"], ".", r"\(2 \.obj and 1 \.ply\); choose one with a pattern"),
        (["a.obj", "a.ply"], "*", r"\(1 \.obj and 1 \.ply\)"),
        (["a.npz", "b.npz"], "*.npz", r"2 \.npz files, each a whole sequence; choose one"),
        (["a.txt"], ".", r"contains no frames \(\.obj, \.ply, .*\.drc\)$"),
        (["a.npz"], ".", r"contains no frames .*; it contains a\.npz: use that file"),
        (["b.npz", "a.glb"], ".", r"it contains a\.glb and 1 more: name one, .*`meshreel batch`"),
    ],
)
def test_error_for_unsuitable_formats_lists_what_exists(tmp_path, files, source, message):
    touch(tmp_path, *files)
    with pytest.raises(FormatError, match=message):
        find_files(f"{tmp_path}/{source}")
