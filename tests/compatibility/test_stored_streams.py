"""Streams that earlier builds wrote stay readable, to the same integers and nearly the same floats.

A name says what is inside: v<format version>_<method>_<what>.reel, with what this build must decode
it to beside it as .npz. `PYTHONPATH=tests python tests/compatibility/test_stored_streams.py` writes
those of this build; it never replaces what is there.
"""

from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.bitstream.layout import FORMAT_VERSION
from meshreel.codec.methods import METHOD_NAMES
from meshreel.surface import Kind
from samples.materials import dressed_sheets
from samples.meshes import assert_same_surface, irregular_sequence, two_sheets, waving_grid

HERE = Path(__file__).parent
STREAMS = sorted(HERE.glob("*.reel"))


@pytest.mark.every_case
@pytest.mark.parametrize("path", STREAMS, ids=lambda path: path.stem)
def test_stored_stream_decodes_to_what_it_always_did(path):
    decoded = meshreel.decode(path.read_bytes())
    expected = meshreel.load(path.with_suffix(".npz"))
    np.testing.assert_array_equal(decoded.faces, expected.faces)
    assert decoded.vertices.dtype == expected.vertices.dtype
    assert decoded.fps == expected.fps
    diagonal = np.linalg.norm(np.ptp(expected.vertices, axis=(0, 1)))
    assert np.abs(decoded.vertices - expected.vertices).max() < 1e-6 * diagonal


@pytest.mark.parametrize("version", range(2, FORMAT_VERSION + 1))
def test_stored_surface_comes_back_exactly(version):
    decoded = meshreel.decode((HERE / f"v{version}_reel_sheets.reel").read_bytes())
    assert_same_surface(decoded.surface, two_sheets().surface)
    assert decoded.start_s == two_sheets().start_s


def test_stored_texture_coordinates_on_a_grid_come_back_exactly():
    decoded = meshreel.decode((HERE / "v2_reel_sheets-uv-bits.reel").read_bytes())
    given, found = (one.surface.of_kind(Kind.UV)[0].values for one in (two_sheets(), decoded))
    np.testing.assert_array_equal(found, np.rint(given * 1024) / 1024)


@pytest.mark.parametrize("version", range(2, FORMAT_VERSION + 1))
def test_stored_materials_come_back_exactly(version):
    decoded = meshreel.decode((HERE / f"v{version}_reel_materials.reel").read_bytes())
    assert_same_surface(decoded.surface, dressed_sheets().surface)


def test_every_version_has_a_stream_when_the_folder_is_listed():
    versions = {int(path.name[1:].split("_")[0]) for path in STREAMS}
    assert versions == set(range(1, FORMAT_VERSION + 1))


def new_streams():
    """Streams of this build, by name."""
    shuffled = np.random.default_rng(1).permutation(99)
    grid = waving_grid()
    mixed = meshreel.MeshSequence(grid.vertices[:, np.argsort(shuffled)], shuffled[grid.faces], 24)
    return {
        "pca-qp_grid": meshreel.encode(waving_grid(), "pca-qp"),
        "pca-qp_irregular": meshreel.encode(
            irregular_sequence(), "pca-qp", laplacian="combinatorial"
        ),
        "pca-qp_shuffled-vertices": meshreel.encode(
            mixed, "pca-qp", order="vertices", block_frames=5
        ),
        **{
            f"{name}_irregular": meshreel.encode(
                irregular_sequence(7), name, n_modes=3, block_frames=3
            )
            for name in METHOD_NAMES
            if name not in ("pca-qp", "reel")
        },
        "reel_grid": meshreel.encode(waving_grid(40, 14, 15)),
        "reel_sheets": meshreel.encode(two_sheets()),
        "reel_sheets-uv-bits": meshreel.encode(two_sheets(), uv_bits=10),
        "reel_materials": meshreel.encode(dressed_sheets()),
        "reel_irregular": meshreel.encode(irregular_sequence(7), max_error=0.5, effort=9),
        "reel_shuffled-drop": meshreel.encode(
            mixed, quality=60, effort=1, order="drop", block_frames=5
        ),
        "pca-qp_rows": meshreel.encode(waving_grid(), "pca-qp", n_modes=3, bits=[8, 7, 4]),
        "pca-qp_shuffled-drop": meshreel.encode(
            mixed, "pca-qp", order="drop", n_modes=3, anchors=0
        ),
    }


if __name__ == "__main__":
    for name, data in new_streams().items():
        target = HERE / f"v{FORMAT_VERSION}_{name}.reel"
        if not target.exists():
            meshreel.save(meshreel.decode(data), target.with_suffix(".npz"))
            target.write_bytes(data)
