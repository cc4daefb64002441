"""Functions of the package with sequences, paths, bytes and open files."""

import ast
import copy
import inspect
import pickle
import pydoc
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.codec.decoder import decode as decode_bytes
from meshreel.codec.encoder import encode as encode_sequence
from meshreel.errors import (
    CorruptStreamError,
    FormatError,
    InvalidInputError,
    Keyword,
    TruncatedStreamError,
)
from meshreel.formats.file_errors import errors_naming
from meshreel.runtime.progress import silent
from samples.meshes import waving_grid
from samples.opening import open_source

GRID = waving_grid(9)
DATA = encode_sequence(GRID, quality=60, block_frames=4)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """grid.npz, grid.reel and frames/f_000.ply and so on."""
    made = tmp_path_factory.mktemp("files")
    (made / "frames").mkdir()
    meshreel.save(GRID, made / "grid.npz")
    meshreel.save(GRID, made / "frames" / "f_%03d.ply")
    (made / "grid.reel").write_bytes(DATA)
    return made


def sources(folder):
    """Return every kind of input with the same sequence."""
    return {
        "sequence": GRID,
        "text": str(folder / "grid.npz"),
        "path": folder / "grid.npz",
        "stored frames": open_source(folder / "grid.npz"),
    }


@pytest.mark.parametrize("kind", ["sequence", "text", "path", "stored frames"])
def test_encode_accepts_every_kind_of_sequence(folder, kind):
    expected = encode_sequence(meshreel.load(folder / "grid.npz"), quality=60, block_frames=4)
    given = sources(folder)[kind]
    assert meshreel.encode(given, quality=60, block_frames=4) == expected


def test_encode_accepts_folders_and_lists_of_frames(folder):
    frames = sorted((folder / "frames").iterdir())
    expected = encode_sequence(meshreel.load(folder / "frames"))
    assert meshreel.encode(folder / "frames") == expected
    assert meshreel.encode(frames) == expected


def test_encode_parses_memory_given_as_text(folder):
    data = meshreel.encode(folder / "grid.npz", memory="1GB")
    assert data == meshreel.encode(folder / "grid.npz")
    with pytest.raises(InvalidInputError, match="memory takes a size such as 100kB"):
        meshreel.encode(folder / "grid.npz", memory="much")


def test_encode_accepts_its_first_argument_by_name(folder):
    encode: Any = meshreel.encode
    assert encode(sequence=folder / "grid.npz") == meshreel.encode(folder / "grid.npz")


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
def test_functions_accept_every_bytes_type(kind):
    data = kind(DATA)
    np.testing.assert_array_equal(meshreel.decode(data).vertices, decode_bytes(DATA).vertices)
    assert meshreel.info(data) == meshreel.info(DATA)
    assert meshreel.compare(data, DATA).max_error_percent == 0
    assert meshreel.encode(data) == meshreel.encode(decode_bytes(DATA))


@pytest.mark.parametrize("kind", [str, Path])
def test_decode_and_info_accept_the_path_of_a_stream(folder, kind):
    path = kind(folder / "grid.reel")
    decoded = meshreel.decode(path, frames=slice(2, 7))
    np.testing.assert_array_equal(decoded.vertices, decode_bytes(DATA).vertices[2:7])
    assert meshreel.info(path) == meshreel.info(DATA)


def test_decode_and_info_accept_an_open_file(folder):
    with meshreel.open(folder / "grid.reel") as reel:
        decoded = meshreel.decode(reel, frames=slice(2, 7))
        assert meshreel.info(reel) == meshreel.info(DATA)
    expected = meshreel.decode(DATA, frames=slice(2, 7))
    np.testing.assert_array_equal(decoded.vertices, expected.vertices)
    np.testing.assert_array_equal(decoded.faces, expected.faces)
    assert (decoded.timing, decoded.name) == (expected.timing, expected.name)


def test_decode_rejects_n_modes_for_an_open_file(folder):
    with (
        meshreel.open(folder / "grid.reel") as reel,
        pytest.raises(InvalidInputError, match=r"to meshreel\.open"),
    ):
        meshreel.decode(reel, n_modes=2)


def test_compare_accepts_every_kind_of_input(folder):
    expected = repr(meshreel.compare(GRID, decode_bytes(DATA)))
    reel = folder / "grid.reel"
    assert repr(meshreel.compare(GRID, reel)) == expected
    assert repr(meshreel.compare(folder / "grid.npz", str(reel))) == expected
    assert repr(meshreel.compare(open_source(folder / "grid.npz"), DATA)) == expected
    with meshreel.open(reel) as opened:
        assert repr(meshreel.compare(GRID, opened)) == expected


@pytest.mark.parametrize("kind", [str, Path])
@pytest.mark.parametrize("function", ["encode", "decode", "info", "compare", "open"])
def test_error_names_a_missing_file(tmp_path, function, kind):
    arguments = [GRID] if function == "compare" else []
    missing = kind(tmp_path / "nope.reel")
    with pytest.raises(InvalidInputError, match=r"nope\.reel' does not exist|no file .*nope\.reel"):
        getattr(meshreel, function)(*arguments, missing)


@pytest.mark.parametrize("function", ["decode", "info"])
def test_folder_is_rejected_as_stream(tmp_path, function):
    with pytest.raises(InvalidInputError, match="is a folder"):
        getattr(meshreel, function)(tmp_path)


@pytest.mark.parametrize("function", ["decode", "info"])
def test_error_names_a_damaged_file(tmp_path, function):
    path = tmp_path / "cut.reel"
    path.write_bytes(DATA[:-30])
    with pytest.raises(TruncatedStreamError, match=r"cut\.reel: "):
        getattr(meshreel, function)(path)


def test_error_names_a_file_that_is_not_a_stream(folder):
    with pytest.raises(CorruptStreamError, match=r"grid\.npz: not a \.reel stream"):
        meshreel.decode(folder / "grid.npz")


@pytest.mark.parametrize("given", [3, None, {"vertices": 1}, np.zeros((2, 3, 3), np.float32)])
@pytest.mark.parametrize("function", ["encode", "decode", "info", "compare"])
def test_error_names_the_type_of_an_invalid_argument(function, given):
    arguments = [GRID] if function == "compare" else []
    with pytest.raises(InvalidInputError, match=f"got {type(given).__name__}"):
        getattr(meshreel, function)(*arguments, given)


def test_encode_warns_with_the_notes_of_load(tmp_path):
    path, notes = tmp_path / "grid.stl", []
    meshreel.save(waving_grid(1), path)
    meshreel.load(path, notes=notes)
    with pytest.warns(UserWarning, match="corners") as warned:
        meshreel.encode(path)
    assert [str(one.message) for one in warned] == notes
    assert {one.filename for one in warned} == {__file__}


def test_encode_has_the_options_of_the_codec():
    ours, theirs = inspect.signature(meshreel.encode), inspect.signature(encode_sequence)
    assert list(ours.parameters.values())[1:] == list(theirs.parameters.values())[1:]


def test_error_keeps_its_path_and_keywords_when_pickled():
    with pytest.raises(FormatError) as caught, errors_naming("walk.zip"), errors_naming("a.obj"):
        raise FormatError("has no times; set ", Keyword("fps"))
    error = pickle.loads(pickle.dumps(caught.value))
    assert str(error) == "walk.zip: a.obj: has no times; set fps"
    assert (error.path, Keyword("fps") in error.args) == ("walk.zip", True)


def test_error_has_its_message_when_that_is_given_by_name():
    assert InvalidInputError(message="there are no frames").args == ("there are no frames",)


@pytest.mark.parametrize("function", ["encode", "decode", "info", "compare"])
def test_functions_can_be_pickled(function):
    assert pickle.loads(pickle.dumps(getattr(meshreel, function))) is getattr(meshreel, function)


def test_dir_lists_the_api_and_nothing_else():
    assert [name for name in dir(meshreel) if not name.startswith("__")] == sorted(meshreel.__all__)


def test_every_name_of_the_api_has_a_docstring():
    for name in meshreel.__all__:
        assert inspect.getdoc(getattr(meshreel, name)), name


def test_help_begins_with_the_whole_api():
    head = pydoc.plain(pydoc.render_doc(meshreel)).partition("PACKAGE CONTENTS")[0]
    assert [name for name in meshreel.__all__ if name not in head] == []


@pytest.mark.slow
def test_help_contains_docstrings_of_functions_and_classes():
    text = pydoc.plain(pydoc.render_doc(meshreel))
    assert "Encode a sequence to the bytes of a `.reel` stream." in text
    assert "class MeshSequence" in text


def test_type_checkers_see_every_name():
    tree = ast.parse(Path(meshreel.__file__).read_text(encoding="utf-8"))
    conditions = (node for node in tree.body if isinstance(node, ast.If))
    [block] = (node for node in conditions if ast.unparse(node.test) == "TYPE_CHECKING")
    imports = (node for node in block.body if isinstance(node, ast.ImportFrom))
    names = {name.asname or name.name for node in imports for name in node.names}
    assert names - {"paper"} == set(meshreel.__all__)


def test_the_silent_callback_stays_the_same_object():
    assert copy.deepcopy(silent) is pickle.loads(pickle.dumps(silent)) is silent


def test_signatures_show_no_addresses_of_objects():
    functions = [getattr(meshreel, name) for name in meshreel.__all__]
    shown = [str(inspect.signature(one)) for one in functions if inspect.isfunction(one)]
    assert shown
    assert not [text for text in shown if " at 0x" in text]


def closed_file(folder):
    with meshreel.open(folder / "grid.reel") as reel:
        pass
    return reel


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda f: meshreel.save(f / "a.npz", GRID), "a sequence and then a path"),
        (lambda f: meshreel.save(GRID, BytesIO()), "meshreel.encode returns the bytes"),
        (lambda f: meshreel.save("a.npz", "b.npz"), "meshreel.load reads files"),
        (lambda f: meshreel.save(b"text", f / "a.reel"), "not a .reel stream"),
        (lambda f: meshreel.save(3, f / "a.npz"), "got int"),
        (lambda f: meshreel.save(GRID, f / "a.reel", quality=9, kg=2), "quality and kg exclude"),
        (lambda f: meshreel.load(3), "the bytes of a .reel stream; got int"),
        (lambda f: meshreel.load(DATA, fps=24), "fps has no effect on a source that is not a p"),
        (lambda f: meshreel.load(f / "frames" / "f_%04d.ply"), "no numbered one; .*dir/f_%04d.obj"),
        (lambda f: meshreel.load(f / "none" / "f_%04d.ply"), "no numbered one"),
        (lambda f: meshreel.open(GRID), "its bytes, or a binary file; got MeshSequence"),
        (lambda f: meshreel.open(f / "grid.npz"), "not a .reel file; meshreel.load reads it"),
        (lambda f: closed_file(f)[0], "the .reel file is closed; open it again"),
        (lambda f: closed_file(f).track("heat"), "no track 'heat'"),
        (
            lambda f: meshreel.MeshSequence(GRID.vertices, GRID.faces, "walk", 25),
            "fps must be a nu",
        ),
        (
            lambda f: meshreel.MeshSequence(GRID.vertices, GRID.faces, 25, 3),
            "name must be text; go",
        ),
        (lambda f: GRID.replace(start_s="x"), "start_s must be a number; got 'x'"),
        (lambda f: meshreel.concatenate(GRID), r"\[first, second\]\); got a MeshFrame"),
        (lambda f: meshreel.concatenate("ab"), "got a str"),
        (lambda f: GRID.replace(frames=3), r"no parameter 'frames'; .*sequence\[2:5\] selects"),
        (lambda f: (GRID + GRID).replace(frames=3), "no parameter 'frames'"),
        (lambda f: meshreel.decode(DATA, frames=slice(5, 3, 2)), "5:3:2 select no frame"),
        (lambda f: meshreel.load(source=f, fsp=25), "mean 'fps'"),  # type: ignore[call-arg]
        (lambda f: GRID[9], "there is no frame 9; there are 9, from 0 to 8"),
        (lambda f: pickle.dumps(meshreel.open(DATA)), "cannot be pickled; open it by its path"),
        (lambda f: pickle.dumps(meshreel.open(BytesIO(DATA))), "cannot be pickled"),
    ],
)
def test_mistakes_are_errors_with_a_remedy(folder, call, message):
    before = sorted(folder.iterdir())
    with pytest.raises(meshreel.MeshReelError, match=message):
        call(folder)
    assert sorted(folder.iterdir()) == before


def test_a_missing_name_is_a_key_error_and_a_missing_frame_an_index_error(folder):
    with meshreel.open(folder / "grid.reel") as reel:
        with pytest.raises(KeyError, match=r"^there is no track 'heat'; there are no tracks$"):
            reel.track("heat")
        with pytest.raises(IndexError, match=r"^there is no frame 9; "):
            reel[9]


def test_a_file_is_pickled_by_its_path_and_options(folder, monkeypatch):
    changing = meshreel.concatenate([GRID, GRID])
    meshreel.save(changing, folder / "two.reel", overwrite=True)
    monkeypatch.chdir(folder)
    with meshreel.open("two.reel", n_modes=1) as reel:
        expected, pickled = reel.segments[1].read(0, 3), pickle.dumps((reel, reel.segments[1]))
    monkeypatch.chdir("/")
    both, segment = pickle.loads(pickled)
    assert (both.n_segments, segment.n_frames) == (2, GRID.n_frames)
    np.testing.assert_array_equal(both.segments[1].read(0, 3), expected)
    np.testing.assert_array_equal(segment.read(0, 3), expected)
    both.close()
    segment.close()
    (folder / "two.reel").unlink()


@pytest.mark.parametrize("given", [bytes, bytearray, memoryview, BytesIO])
def test_streams_in_memory_are_loaded_opened_and_saved(given, tmp_path):
    assert np.array_equal(meshreel.load(given(DATA)).vertices, meshreel.decode(DATA).vertices)
    with meshreel.open(given(DATA)) as reel:
        assert len(reel) == len(meshreel.load(reel)) == 9
    [path] = meshreel.save(given(DATA), tmp_path / "a.reel")
    assert meshreel.load(path).n_frames == 9
    assert (path.read_bytes() == DATA) == (given is not BytesIO)  # which is decoded
    meshreel.save(given(DATA), tmp_path / "a.npz")
    assert np.array_equal(
        meshreel.load(tmp_path / "a.npz").vertices, meshreel.decode(DATA).vertices
    )


def test_save_encodes_with_a_quality_and_load_reads_an_output_pattern(tmp_path):
    for options in ({"quality": 95}, {"kg": 0.5}):
        [path] = meshreel.save(GRID, tmp_path / "a.reel", overwrite=True, **options)
        assert path.read_bytes() == meshreel.encode(GRID, **options)
    meshreel.save(GRID, tmp_path / "f_%d.obj")
    (tmp_path / "f_010.obj").write_text("not of this pattern")
    (tmp_path / "f_x.obj").write_text("nor this")
    loaded = meshreel.load(tmp_path / "f_%d.obj", fps=25)
    np.testing.assert_allclose(loaded.vertices, GRID.vertices, atol=1e-6)
