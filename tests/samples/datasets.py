"""A small animation with a full surface, and comparisons."""

import contextlib
from dataclasses import replace

import numpy as np

from meshreel.errors import MeshReelError
from meshreel.formats.load import load
from meshreel.kernel.polygons import triangulate
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import PLAIN, Attribute, Domain, FaceGroups, Kind, Part, Surface
from samples.costs import draws

COUNTS = np.array([4, 3, 5, 3], np.int32)
CORNERS = np.array([0, 1, 2, 3, 1, 4, 2, 5, 6, 7, 8, 9, 5, 7, 9], np.int32)
N_VERTS = 11  # the last one has no face


def full_surface():
    """Return a surface with attributes of every domain and type, groups and two parts."""
    rng = np.random.default_rng(3)
    uv = rng.random((6, 2)).astype(np.float32)
    return Surface(
        COUNTS,
        (
            Attribute("UVMap", Kind.UV, Domain.CORNER, uv, rng.integers(0, 6, 15).astype(np.int32)),
            Attribute("uv", Kind.UV, Domain.VERTEX, rng.random((N_VERTS, 2))),
            Attribute(
                "Cd", Kind.COLOR, Domain.VERTEX, rng.integers(0, 256, (N_VERTS, 4), np.uint8)
            ),
            Attribute("wärme", Kind.OTHER, Domain.FACE, rng.random((4, 1)).astype(np.float32)),
            Attribute("id", Kind.OTHER, Domain.VERTEX, np.arange(N_VERTS, dtype=np.int32)[:, None]),
        ),
        (FaceGroups("material", ("skin", "Stoff é"), np.array([0, 1, -1, 1], np.int32)),),
        (Part("/root/body", 5, 2), Part("/root/head", 6, 2)),
    )


def surface_of_arrays(surface):
    """Return what point and cell data keep of a surface, in the order of names."""
    kept = [one for one in surface.attributes if one.domain is not Domain.CORNER]
    kept += [
        Attribute(group.name, Kind.OTHER, Domain.FACE, group.numbers[:, None])
        for group in surface.groups
    ]
    kept.sort(key=lambda one: (one.domain is Domain.FACE, one.name))
    return replace(surface, attributes=tuple(kept), groups=(), parts=())


def polygon_surface():
    return Surface(COUNTS)


def surfaced_sequence(
    n_frames=5, dtype=np.float32, fps=25.0, start_s=0.0, surface=None, name="walk"
):
    """Return an animation of quads, triangles and a pentagon, with full-precision values."""
    rng = np.random.default_rng(n_frames)
    vertices = rng.standard_normal((n_frames, N_VERTS, 3)).astype(dtype)
    faces, _ = triangulate(COUNTS, CORNERS, vertices[0])
    surface = full_surface() if surface is None else surface
    return MeshSequence(vertices, faces, fps, name, start_s, surface)


def plain_sequence(**options):
    """Return the same animation without a surface."""
    return surfaced_sequence(surface=PLAIN, **options)


def positions_of(source):
    """Return the positions of all frames of a source, of shape (T, V, 3)."""
    return source.read(0, source.n_frames)


def assert_same_positions(found, expected):
    """Assert that positions, their type, and triangles are equal bit for bit."""
    assert (found.n_frames, found.n_verts) == (expected.n_frames, expected.n_verts)
    assert found.dtype == expected.dtype
    assert positions_of(found).tobytes() == positions_of(expected).tobytes()
    np.testing.assert_array_equal(found.faces, expected.faces)


def read_damaged(path, *amounts, readers=(load,), **options):
    """Read damaged versions of a file by each reader; any error but MeshReelError is raised."""
    for damaged in damaged_versions(path.read_bytes(), *amounts, **options):
        path.write_bytes(damaged)
        for read in readers:
            with contextlib.suppress(MeshReelError):
                read(path)


def damaged_versions(data, n_damaged=120, n_header=200, seed=1):
    """Yield files with some bytes changed, or a range removed, doubled or zeroed."""
    rng = np.random.default_rng(seed)
    for index in range(draws(n_damaged)):
        damaged = bytearray(data)
        begin, end = sorted(rng.integers(0, len(data) + 1, 2))
        in_header = rng.integers(min(len(data), n_header))
        match index % 7:
            case 0:
                del damaged[begin:]
            case 1:
                for position in rng.integers(0, len(data), rng.integers(1, 4)):
                    damaged[position] = rng.integers(256)
            case 2:
                damaged[in_header] = rng.integers(256)
            case 3:
                damaged[in_header] = rng.choice(list(b"0123456789-. \n\r\\#elnv/fo"))
            case 4:
                del damaged[begin : begin + 30]
            case 5:
                damaged[begin:end] = damaged[begin:end] * 2
            case 6:
                damaged[begin : begin + 60] = bytes(len(damaged[begin : begin + 60]))
        yield bytes(damaged)
