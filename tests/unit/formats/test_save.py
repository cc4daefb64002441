import tracemalloc

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.load import load
from meshreel.formats.options import WriteOptions
from meshreel.formats.outputs import check_output
from meshreel.formats.registry import FORMATS, is_written
from meshreel.model.sequence import MeshSequence
from meshreel.operations.save import save
from samples.materials import dressed_sheet
from samples.meshes import waving_grid
from samples.opening import open_source, stored


def names(paths):
    return [path.name for path in paths]


def listing(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize(
    ("pattern", "options", "expected"),
    [
        ("f_%04d.obj", {}, ["f_0000.obj", "f_0001.obj"]),
        ("%d.ply", {}, ["0.ply", "1.ply"]),
        ("a%2dz.OFF", {}, ["a 0z.OFF", "a 1z.OFF"]),
        ("50%_%03d.stl", {}, ["50%_000.stl", "50%_001.stl"]),
        ("new/er/f_%d.obj", {}, ["f_0.obj", "f_1.obj"]),
        ("f_%02d.obj", {"start_number": 99}, ["f_99.obj", "f_100.obj"]),
        ("a.npz", {}, ["a.npz"]),
    ],
)
def test_files_are_numbered_by_the_pattern(tmp_path, make_sequence, pattern, options, expected):
    checked = check_output(tmp_path / pattern, 2, overwrite=False, **options)
    paths = save(make_sequence(2), str(tmp_path / pattern), **options)
    assert (names(checked), names(paths)) == (expected, expected)
    assert sorted(listing(paths[0].parent)) == sorted(expected)


def test_save_takes_options_of_the_format_by_name(tmp_path, make_sequence):
    sequence = make_sequence(2)
    [path] = save(sequence, tmp_path / "a.reel", max_error=0.1)
    with meshreel.open(path) as reel:
        assert reel.error_bound is not None
    with pytest.raises(InvalidInputError, match="option 'max_eror' is unknown; did you mean"):
        save(sequence, tmp_path / "b.reel", max_eror=0.1)
    with pytest.raises(InvalidInputError, match=r"max_error has no effect on a \.npz file"):
        save(sequence, tmp_path / "b.npz", max_error=0.1)
    assert listing(tmp_path) == ["a.reel"]


def test_save_reports_progress_for_every_frame(tmp_path, make_sequence):
    seen = []
    save(make_sequence(2), tmp_path / "%d.obj", progress=lambda *step: seen.append(step))
    assert seen == [("writing", 0.5), ("writing", 1.0)]


def test_existing_files_are_replaced_only_if_allowed(tmp_path, make_sequence):
    (tmp_path / "f_1.obj").write_text("old")
    with pytest.raises(InvalidInputError, match=r"f_1\.obj already exists"):
        save(make_sequence(3), tmp_path / "f_%d.obj")
    assert (listing(tmp_path), (tmp_path / "f_1.obj").read_text()) == (["f_1.obj"], "old")
    save(make_sequence(2), tmp_path / "f_%d.obj", overwrite=True)
    assert (tmp_path / "f_1.obj").read_text().startswith("v ")


def test_failed_save_leaves_the_folder_unchanged(tmp_path, make_sequence):
    (tmp_path / "f_0.stl").write_text("old")
    vertices = make_sequence(3, np.float64).vertices.copy()
    vertices[2, 0, 0] = 1e39
    sequence = MeshSequence(vertices, make_sequence().faces)
    with pytest.raises(InvalidInputError, match="STL stores float32"):
        save(sequence, tmp_path / "f_%d.stl", overwrite=True)
    assert (listing(tmp_path), (tmp_path / "f_0.stl").read_text()) == (["f_0.stl"], "old")


@pytest.mark.parametrize("n_frames", [None, 1, 3])
@pytest.mark.parametrize("output", ["", "folder/", "new/"])
def test_check_output_suggests_a_pattern_for_a_folder(tmp_path, output, n_frames):
    (tmp_path / "folder").mkdir()
    with pytest.raises(FormatError, match=r"is a folder.* pattern such as .*frame_%04d\.obj"):
        check_output(f"{tmp_path}/{output}", n_frames, overwrite=True)


@pytest.mark.parametrize(
    ("name", "n_frames", "error", "message"),
    [
        ("a.obj", 2, InvalidInputError, r"there are 2; use a pattern such as .*a_%04d\.obj"),
        ("%d_%d.obj", 2, InvalidInputError, "has 2 number fields"),
        ("f_%d.npz", None, InvalidInputError, r"a \.npz file contains all frames"),
        ("a.txt", None, FormatError, r"unknown file extension \.txt; known are \.obj, \.ply"),
        ("a.fbx", None, FormatError, r"with other programs as Alembic .*, USD .* or glTF"),
        ("none/a.npz", None, InvalidInputError, r"the output folder .*none does not exist"),
        ("old.npz", None, InvalidInputError, "already exists"),
        ("old_%d.obj", None, InvalidInputError, "already exists"),
    ],
)
def test_check_output_explains_unsuitable_outputs(tmp_path, name, n_frames, error, message):
    for existing in ("old.npz", "old_0.obj"):
        (tmp_path / existing).touch()
    with pytest.raises(error, match=message):
        check_output(tmp_path / name, n_frames, overwrite=False)


@pytest.mark.parametrize(("name", "number"), [("a.npz", 1), ("a.obj", 0), ("f_%d.obj", -1)])
def test_start_number_without_pattern_is_rejected(tmp_path, make_sequence, name, number):
    with pytest.raises(InvalidInputError, match=r"start_number"):
        save(make_sequence(1), tmp_path / name, start_number=number)
    assert listing(tmp_path) == []


@pytest.mark.parametrize(
    ("name", "options", "word"),
    [
        ("a.npz", WriteOptions(normals=True), r"normals.* \.npz .* \.glb, \.gltf"),
        ("a.reel", WriteOptions(normals=True), r"normals .* \.reel file"),
        ("a.glb", WriteOptions(lossless=True), r"lossless .* \.glb file; it is for \.reel$"),
        ("f_%d.obj", WriteOptions(max_error=1), r"max_error .* \.reel, .*\.glb, \.gltf"),
    ],
)
def test_options_without_effect_are_rejected(tmp_path, make_sequence, name, options, word):
    with pytest.raises(InvalidInputError, match=word):
        save(make_sequence(2), tmp_path / name, options=options)
    assert listing(tmp_path) == []


def test_save_notes_the_error_of_a_stream(tmp_path, make_sequence, notes):
    path = tmp_path / "a.reel"
    save(waving_grid(), path, options=WriteOptions(max_error=0.2), notes=notes)
    assert path.read_bytes() == meshreel.encode(waving_grid(), max_error=0.2)
    result = meshreel.compare(waving_grid(), load(path)).max_error_percent
    assert result <= 0.2
    assert notes[0].startswith(f"encoded with a largest error of {result:.4f} % of the diagonal")


def test_lossless_option_writes_a_lossless_stream(tmp_path, notes):
    path = tmp_path / "a.reel"
    save(waving_grid(), path, options=WriteOptions(lossless=True), notes=notes)
    assert path.read_bytes() == meshreel.encode(waving_grid(), lossless=True)
    assert notes == ["encoded losslessly"]
    with pytest.raises(InvalidInputError, match="max_error has no effect with lossless"):
        save(waving_grid(), path, overwrite=True, options=WriteOptions(lossless=True, max_error=1))


@pytest.mark.parametrize("name", ["a.npz", "a.h5", "f_%d.ply"])
def test_save_never_replaces_its_inputs(tmp_path, make_sequence, name):
    if name == "a.h5":
        pytest.importorskip("h5py")
    paths = save(make_sequence(3), tmp_path / name)
    before = [path.read_bytes() for path in paths]
    source = paths if len(paths) > 1 else paths[0]
    with pytest.raises(InvalidInputError, match="is the input"):
        save(open_source(source), tmp_path / name, overwrite=True)
    assert [path.read_bytes() for path in paths] == before


def test_save_never_replaces_its_input_stream(tmp_path):
    (tmp_path / "a.reel").write_bytes(data := meshreel.encode(waving_grid()))
    with (
        meshreel.open(tmp_path / "a.reel") as reel,
        pytest.raises(InvalidInputError, match="is the input"),
    ):
        save(reel, tmp_path / "a.reel", overwrite=True)
    assert (tmp_path / "a.reel").read_bytes() == data


@pytest.mark.parametrize(
    "extension", sorted(one.extension for one in FORMATS.values() if is_written(one))
)
def test_save_notes_materials_that_are_left_out(extension, tmp_path, notes):
    result = FORMATS[extension]
    extra = getattr(result, "extra", None)
    if extra is not None and not extra.is_installed:
        pytest.skip(f"{extension} needs {extra.library}, which is not installed")
    save(dressed_sheet(1), tmp_path / f"a{extension}", notes=notes)
    said = (
        f"left out, as {extension} files cannot store it: material properties (red, gr\u00fcn) and "
    )
    is_said = f"{said}2 texture images" in notes
    assert is_said != getattr(result, "holds_materials", False)


OUTPUTS = ["f_%02d.obj", "f_%02d.ply", "f_%02d.off", "f_%02d.stl", "a.npz", "a.reel"]


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize("output", OUTPUTS)
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_saving_stored_frames_writes_the_bytes_of_loaded_ones(tmp_path, output, dtype):
    sequence = waving_grid()
    save(sequence.replace(vertices=sequence.vertices.astype(dtype)), tmp_path / "f_%d.ply")
    folders = [tmp_path / "opened", tmp_path / "loaded"]
    for folder, read in zip(folders, [open_source, load], strict=True):
        folder.mkdir()
        save(read(tmp_path / "*.ply"), folder / output)
    assert contents(folders[0]) == contents(folders[1])
    assert len(contents(folders[0])) == (sequence.n_frames if "%" in output else 1)


@pytest.mark.parametrize("output", [*OUTPUTS, "a.usda", "a.usdz", "a.abc"])
@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (np.nan, "every position must be finite; vertex 0 of frame 3 has x = nan"),
        (None, "the file ends here"),
    ],
)
def test_nothing_is_written_when_frames_cannot_be_read(tmp_path, output, changed, message):
    def read(start, stop):
        if changed is None and stop > 3:
            raise InvalidInputError("the file ends here")
        vertices = sequence.vertices[start:stop].copy()
        vertices[np.arange(start, stop) == 3] = changed
        return vertices

    sequence = waving_grid(5)
    with pytest.raises(InvalidInputError, match=message):
        save(stored(sequence, read), tmp_path / output)
    assert contents(tmp_path) == {}


def test_folder_is_checked_before_frames_are_read(tmp_path):
    def read(start, stop):
        raise AssertionError

    with pytest.raises(InvalidInputError, match=r"the output folder .*none does not exist"):
        save(stored(waving_grid(5), read), tmp_path / "none/a.npz")


@pytest.mark.slow
@pytest.mark.parametrize("output", ["f_%03d.ply", "f_%03d.stl", "a.npz"])
def test_saving_stored_frames_needs_a_tenth_of_the_memory(tmp_path, output):
    n_frames, n_verts = 200, 3000
    faces = np.arange(n_verts, dtype=np.int32).reshape(-1, 3)
    mesh = MeshSequence(np.zeros((1, n_verts, 3), np.float32), faces)
    frames = stored(
        mesh,
        lambda start, stop: np.full((stop - start, n_verts, 3), start, np.float32),
        n_frames=n_frames,
    )

    def write():
        save(frames, tmp_path / output, overwrite=True)

    write()  # first use imports modules and fills caches, which must not count
    tracemalloc.start()
    try:
        write()
        assert tracemalloc.get_traced_memory()[1] < n_frames * n_verts * 12 / 10
    finally:
        tracemalloc.stop()
