"""Conversion from every readable format to every writable one, directly and through streams."""

import itertools
from contextlib import nullcontext

import numpy as np
import pytest
from scipy.spatial import cKDTree

import meshreel
from meshreel.formats.kinds import SequenceFormat
from meshreel.formats.load import load
from meshreel.formats.options import WriteOptions
from meshreel.formats.registry import FORMATS, is_written
from meshreel.operations.save import save
from samples.costs import slow_but
from samples.meshes import assert_same_surface, quad_sheet

WRITABLE = [kind for kind in FORMATS.values() if is_written(kind)]
EXTENSIONS = [kind.extension for kind in WRITABLE]
APPROXIMATE = {".glb", ".gltf", ".reel"}
TRIANGLES = {".glb", ".gltf", ".stl"}
TIMELESS = {".pc2"}
WITHOUT_UV = {".off", ".stl", ".ply", ".pvd", ".vtkhdf", ".vtp", ".vtu"}
"""Formats that do not store the corner attributes of the sheet."""
ERROR = 1e-3
"""Tolerance relative to the diagonal: twice the error requested from lossy formats."""


def target_of(folder, extension):
    """Return a path with this extension for a sequence, or a pattern for its frames."""
    is_whole = isinstance(FORMATS[extension], SequenceFormat)
    return folder / (f"walk{extension}" if is_whole else f"walk_%02d{extension}")


def source_of(target):
    return str(target).replace("%02d", "*")


def save_and_load(sequence, folder, extension):
    extra = getattr(FORMATS[extension], "extra", None)
    if extra is not None and not extra.is_installed:
        pytest.skip(f"{extension} needs {extra.library}, which is not installed")
    folder.mkdir(exist_ok=True)
    target = target_of(folder, extension)
    max_error = 50 * ERROR if extension in APPROXIMATE else None
    if max_error and sequence.error_bound:  # of the sum
        max_error *= 2.01
    save(sequence, target, options=WriteOptions(max_error=max_error))
    fps = (
        24 if extension in TIMELESS or not isinstance(FORMATS[extension], SequenceFormat) else None
    )
    return load(source_of(target), fps=fps)


@pytest.fixture(scope="module")
def converted(tmp_path_factory):
    """Returns the same sheet after a round trip through a format."""
    sequences = {}

    def get(extension):
        if extension not in sequences:
            sequences[extension] = save_and_load(
                quad_sheet(), tmp_path_factory.mktemp("converted"), extension
            )
        return sequences[extension]

    return get


@pytest.mark.every_case
@pytest.mark.parametrize(
    ("source", "target"),
    slow_but(
        list(zip(EXTENSIONS, [*EXTENSIONS[1:], *EXTENSIONS[:1]], strict=True)),  # each once
        list(itertools.product(EXTENSIONS, repeat=2)),
    ),
)
def test_positions_and_polygons_survive_every_conversion(source, target, converted, tmp_path):
    expected = converted(source)
    result = save_and_load(expected, tmp_path / "out", target)
    assert result.n_frames == expected.n_frames == 6
    assert result.fps == expected.fps == 24
    if target == ".stl":  # welding reorders vertices by first use in triangles
        positions, expected_positions = (
            sorted(map(tuple, sequence.vertices[2])) for sequence in (result, expected)
        )
        assert positions == expected_positions
        return
    if target in TRIANGLES:
        assert_same_triangles(result, expected)
        return
    if target in APPROXIMATE:
        diagonal = np.linalg.norm(np.ptp(expected.vertices, axis=(0, 1)))
        assert np.abs(result.vertices - expected.vertices).max() < 20 * ERROR * diagonal
    else:
        np.testing.assert_array_equal(result.vertices, expected.vertices)
    np.testing.assert_array_equal(result.faces, expected.faces)
    sizes, expected_sizes = (
        sequence.surface.sizes(len(sequence.faces)) for sequence in (result, expected)
    )
    np.testing.assert_array_equal(sizes, expected_sizes)


def assert_same_triangles(result, expected):
    """Assert equal vertex trajectories and triangles, up to the order of vertices."""
    tolerance = 20 * ERROR * np.linalg.norm(np.ptp(expected.vertices, axis=(0, 1)))
    distances, match = cKDTree(expected.vertices[0]).query(result.vertices[0])
    assert distances.max() < tolerance
    assert sorted(match) == list(range(expected.n_verts))
    assert np.abs(result.vertices - expected.vertices[:, match]).max() < tolerance
    triangles, expected_triangles = (
        sorted(map(tuple, np.sort(faces, axis=1)))
        for faces in (match[result.faces], expected.faces)
    )
    assert triangles == expected_triangles


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_stream_preserves_what_a_format_stores(extension, converted):
    expected = converted(extension)
    # A .reel and a .glb are lossy: the bounds add up, which a warning says.
    with pytest.warns(match="bounds include the error") if expected.error_bound else nullcontext():
        data = meshreel.encode(expected, max_error=0.01)
    decoded = meshreel.decode(data)
    np.testing.assert_array_equal(decoded.faces, expected.faces)
    assert_same_surface(decoded.surface, expected.surface)
    assert (decoded.fps, decoded.start_s) == (expected.fps, expected.start_s)


@pytest.mark.parametrize("extension", sorted({*EXTENSIONS} - WITHOUT_UV))
def test_texture_coordinates_survive_conversions(extension, converted):
    (uv, *_) = converted(extension).surface.of_kind(meshreel.Kind.UV)
    expected = quad_sheet().surface.attributes[0].per_item()
    items = uv.per_item()
    if extension in TRIANGLES:
        assert {tuple(row) for row in items.round(6)} == {tuple(row) for row in expected.round(6)}
        return
    np.testing.assert_allclose(items, expected, atol=1e-7)


L_SHAPE = """v 0 2 0\nv 1 2 0\nv 1 1 0\nv 3 1 0\nv 3 0 0\nv 0 0 0\nf 1 6 5 4 3 2\n"""
BOW = "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nf 1 2 3 4\n"


@pytest.fixture
def l_shape(tmp_path):
    path = tmp_path / "l.obj"
    path.write_text(L_SHAPE)
    return path


def area(sequence):
    a, b, c = np.moveaxis(sequence.vertices[0][sequence.faces].astype(float), 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2


@pytest.mark.parametrize("name", ["copy.stl", "copy.glb", "copy.obj", "copy.ply", "copy.npz"])
def test_every_format_stores_the_area_of_a_concave_polygon(l_shape, name):
    (path,) = meshreel.save(meshreel.load(l_shape), l_shape.with_name(name))
    copy = meshreel.load(path)
    assert area(copy) == pytest.approx(4)
    if name not in ("copy.stl", "copy.glb"):
        assert copy.surface.face_sizes.tolist() == [6]


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_streams_preserve_the_area_of_a_concave_polygon(l_shape, order):
    decoded = meshreel.decode(meshreel.encode(meshreel.load(l_shape), order=order, lossless=True))
    assert area(decoded) == pytest.approx(4)


def test_a_note_counts_polygons_that_cross_themselves(tmp_path, notes):
    (tmp_path / "bow.obj").write_text(BOW)
    meshreel.load(tmp_path / "bow.obj", notes=notes)
    assert notes == ["triangles overlap in 1 polygon with crossing sides"]
