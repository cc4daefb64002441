"""Layers outside of the folder of a USD file, and files of arbitrary bytes."""

import contextlib

import numpy as np
import pytest
from pxr import Sdf

from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.load import load
from meshreel.operations.save import save
from samples.datasets import damaged_versions
from samples.meshes import waving_grid

MESH = """#usda 1.0
(
    defaultPrim = "m"
)
def Mesh "m" {
    point3f[] points.timeSamples = { 1: [(0, 0, 0), (1, 0, 0), (0, 1, 0)] }
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
}
"""
CLIPS = """def Mesh "m" (clips = { dictionary default = {
    %s
    string primPath = "/m"
    double2[] active = [(0, 0)]
    double2[] times = [(0, 0), (2, 2)]
    } }) {
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
}"""
TEMPLATE = """string templateAssetPath = "%s"
    double templateStartTime = 1
    double templateEndTime = 2
    double templateStride = 1"""
OWN = MESH.partition(")\n")[2].replace('"m"', '"own"')
IN_A_VARIANT = """def "a" (
    prepend variantSets = "v"
    variants = { string v = "one" }
) {
    variantSet "v" = {
        "one" { }
        "two" (references = @%s@) { }
    }
}"""
ARCS = {
    "sublayer": ("subLayers = [@%s@]", ""),
    "reference": ("", 'def "a" (references = @%s@) { }'),
    "payload": ("", 'def "a" (payload = @%s@) { }'),
    "variant": ("", IN_A_VARIANT),
    "clips": ("", CLIPS % "asset[] assetPaths = [@%s@]"),
    "manifest": ("", CLIPS % "asset[] assetPaths = [@./in.usda@]\nasset manifestAssetPath = @%s@"),
    "template": ("", CLIPS % TEMPLATE),
}


@pytest.fixture
def folder(tmp_path):
    """A folder with a layer, a link out of it, and the same layer in its parent."""
    result = tmp_path / "in"
    (result / "sub").mkdir(parents=True)
    for path in (tmp_path / "out.usda", result / "in.usda", result / "sub" / "deep.usda"):
        path.write_text(MESH)
    for number in (1, 2):
        (tmp_path / f"out.{number}.usda").write_text(MESH)
    (result / "link.usda").symlink_to(tmp_path / "out.usda")
    return result


def file_with_reference(folder, arc, asset):
    """Write a file with a mesh that also refers to a layer, and return its path."""
    header, body = (part % asset if "%s" in part else part for part in ARCS[arc])
    path = folder / "a.usda"
    path.write_text(f"#usda 1.0\n(\n{header}\n)\n{OWN}{body}\n")
    return path


@pytest.mark.parametrize("arc", ARCS)
@pytest.mark.parametrize("asset", ["../out.usda", "{above}/out.usda", "./link.usda", "../no.usda"])
def test_load_rejects_a_layer_outside_of_the_folder_before_opening_it(folder, arc, asset):
    if arc == "template":
        asset = asset.replace(".usda", ".#.usda").replace("./link", "../link")
    path = file_with_reference(folder, arc, asset.format(above=folder.parent))
    with pytest.raises(FormatError, match=r"a\.usda: refers to the file .* outside its folder"):
        load(path, merge=True)
    for name in ("out.usda", "out.1.usda", "in/link.usda"):
        assert Sdf.Layer.Find(str(folder.parent / name)) is None
    assert load(path, merge=True, allow_outside=True).n_verts >= 3


@pytest.mark.parametrize("arc", ["sublayer", "reference", "payload", "variant", "clips"])
@pytest.mark.parametrize("asset", ["./in.usda", "in.usda", "sub/deep.usda", "./gone.usda"])
def test_load_reads_layers_in_the_folder_or_below(folder, arc, asset):
    assert load(file_with_reference(folder, arc, asset), merge=True).n_verts >= 3


def test_load_reads_a_layer_in_a_parent_folder_within_that_of_the_file(folder):
    deep = file_with_reference(folder, "reference", "../in.usda").rename(
        folder / "sub" / "middle.usda"
    )
    assert (
        load(file_with_reference(folder, "sublayer", f"./sub/{deep.name}"), merge=True).n_verts == 6
    )


def test_load_rejects_an_outside_reference_of_a_nested_layer(folder):
    deep = file_with_reference(folder, "reference", "../../out.usda").rename(
        folder / "sub" / "middle.usda"
    )
    with pytest.raises(FormatError, match=r"refers to the file '\.\./\.\./out\.usda' outside"):
        load(file_with_reference(folder, "sublayer", f"./sub/{deep.name}"), merge=True)


def test_load_rejects_an_expression_that_leads_outside(folder):
    (folder / "low.usda").write_text(
        '#usda 1.0\ndef "a" (references = @`"${PLACE}/in.usda"`@</m>) {\n}\n'
    )
    path = folder / "a.usda"
    path.write_text(
        '#usda 1.0\n(\nexpressionVariables = { string PLACE = ".." }\n'
        f"subLayers = [@./low.usda@]\n)\n{OWN}"
    )
    (folder.parent / "in.usda").write_text(MESH)
    with pytest.raises(FormatError, match="outside its folder"):
        load(path, merge=True)


def test_load_rejects_a_layer_found_only_in_the_working_directory(folder, monkeypatch):
    monkeypatch.chdir(folder.parent)
    with pytest.raises(FormatError, match=r"refers to the file 'out\.usda' outside its"):
        load(file_with_reference(folder, "reference", "out.usda"), merge=True)


def test_load_reads_a_file_that_is_a_link(folder):
    assert load(folder / "link.usda").n_verts == 3


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


def test_load_terminates_for_a_file_that_refers_to_itself(tmp_path, notes):
    path = tmp_path / "x.usda"
    path.write_text(
        f'#usda 1.0\n{TRIANGLE}\ndef "a" (references = @x.usda@</a>) {{\n'
        'def "b" (references = </a>) {\n}\n}\n'
    )
    assert load(path, notes=notes).n_frames == 1
    assert "missing or invalid" in notes[0]


def test_load_rejects_too_many_nested_instances(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.formats.usd.unread.MAX_PRIMS", 100)
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
