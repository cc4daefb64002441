"""Reading arbitrary bytes as a USD file returns a sequence or raises an error of meshreel."""

import contextlib

import numpy as np
import pytest

from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.load import load
from meshreel.formats.save import save
from samples.datasets import damaged_versions
from samples.meshes import waving_grid

EXTENSIONS = ["usd", "usda", "usdc", "usdz"]
TRIANGLE = """def Mesh "m" {
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
}"""


@pytest.fixture(scope="module")
def whole_files(tmp_path_factory):
    """The bytes of a small file of each format."""
    folder = tmp_path_factory.mktemp("whole")
    for extension in EXTENSIONS:
        save(waving_grid(3, 4, 4), folder / f"x.{extension}")
    return {extension: (folder / f"x.{extension}").read_bytes() for extension in EXTENSIONS}


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize(
    "data", [b"", b"\0", b"hello", b"PXR-USDC", b"#usda 1.0\n(", b"PK\3\4" * 9]
)
def test_load_rejects_other_data(tmp_path, capfd, extension, data):
    path = tmp_path / f"x.{extension}"
    path.write_bytes(data)
    with pytest.raises(FormatError, match=rf"x\.{extension}: "):
        load(path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_load_rejects_truncated_files(tmp_path, whole_files, extension):
    data, path = whole_files[extension], tmp_path / f"x.{extension}"
    # Text ends with brackets, and a package with a directory that readers do not need.
    end = data.rindex(b"PK\1\2") if extension == "usdz" else len(data) - 4
    for length in np.linspace(0, end - 1, 40).astype(int):
        path.write_bytes(data[:length])
        with pytest.raises(MeshReelError, match=rf"x\.{extension}"):
            load(path)


@pytest.mark.slow
@pytest.mark.parametrize("extension", ["usda", "usdz"])
def test_load_raises_only_our_errors_for_changed_bytes(tmp_path, whole_files, extension):
    data, path = whole_files[extension], tmp_path / f"x.{extension}"
    for damaged in damaged_versions(data, 70, n_header=len(data)):
        path.write_bytes(damaged)
        with contextlib.suppress(MeshReelError):
            assert load(path).n_frames >= 1


def test_load_rejects_attributes_of_another_type(tmp_path):
    path = tmp_path / "x.usda"
    rows = {
        "points": 'string[] points = ["a", "b"]',
        "faceVertexCounts": "float[] faceVertexCounts = [3.5]",
        "faceVertexIndices": 'token faceVertexIndices = "x"',
    }
    good = {
        "points": "point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]",
        "faceVertexCounts": "int[] faceVertexCounts = [3]",
        "faceVertexIndices": "int[] faceVertexIndices = [0, 1, 2]",
    }
    for name, row in rows.items():
        body = "\n".join({**good, name: row}.values())
        path.write_text(f'#usda 1.0\ndef Mesh "m" {{\n{body}\n}}\n')
        with pytest.raises(FormatError, match=r"x\.usda: "):
            load(path)


def test_load_terminates_for_a_file_that_refers_to_itself(tmp_path, notes):
    path = tmp_path / "x.usda"
    path.write_text(
        f'#usda 1.0\n{TRIANGLE}\ndef "a" (references = @x.usda@</a>) {{\n'
        'def "b" (references = </a>) {\n}\n}\n'
    )
    assert load(path, notes=notes).n_frames == 1
    assert "missing or invalid" in notes[0]


def test_load_rejects_too_many_nested_instances(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.formats.usd.reading.MAX_PRIMS", 100)
    levels = [f'class "l0" {{\n{TRIANGLE}\n}}']
    for level in range(1, 8):
        copies = [
            f'def "c{k}" (\ninstanceable = true\nreferences = </l{level - 1}>\n) {{\n}}'
            for k in range(10)
        ]
        levels.append(f'class "l{level}" {{\n' + "\n".join(copies) + "\n}")
    levels.append('def "all" (references = </l7>) {\n}')
    (tmp_path / "x.usda").write_text("#usda 1.0\n" + "\n".join(levels))
    with pytest.raises(FormatError, match="more than 100 prims"):
        load(tmp_path / "x.usda")
