"""Assumptions about Draco, and streams that are refused."""

import DracoPy
import numpy as np
import pytest

from meshreel.connectivity import edgebreaker_extent
from meshreel.connectivity.draco import HEAD, TAIL, decode_surface, encode_surface
from meshreel.connectivity.edgebreaker_extent import STANDARD, VALENCE, connectivity_size
from meshreel.connectivity.triangles import repeats_before
from meshreel.entropy.varint import write_varint
from meshreel.errors import CorruptStreamError, TruncatedStreamError


def zero_stream(faces, n_verts):
    """A stream of Draco's own with the attribute that this room puts around the connectivity."""
    names = np.zeros((n_verts, 3), np.float32)
    names[:, 0] = np.arange(n_verts)
    return DracoPy.encode(
        names,
        faces,
        quantization_bits=1,
        compression_level=7,
        quantization_range=1e9,
        quantization_origin=[0, 0, 0],
    )


def without_repeats(faces):
    """The faces that Draco takes, and how many vertices they use."""
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, compact = np.unique(faces, return_inverse=True)
    compact = compact.reshape(-1, 3).astype(np.int64)
    return compact[~repeats_before(compact, len(used))], len(used)


def test_symbols_are_tagged_when_a_context_is_rare(meshes, monkeypatch):
    counts = []

    def count(coded, probabilities, n_tags):
        counts.append(n_tags)
        return sum_of_tags(coded, probabilities, n_tags)

    sum_of_tags = edgebreaker_extent._sum_of_tags
    monkeypatch.setattr(edgebreaker_extent, "_sum_of_tags", count)
    assert encode_surface(*without_repeats(meshes["crowded"][0])) is not None
    assert counts


@pytest.mark.parametrize("name", ["triangle", "octahedron", "grid", "torus"])
def test_stream_is_the_one_draco_writes_when_put_together_again(meshes, name):
    faces, n_verts = meshes[name]
    surface = encode_surface(faces.astype(np.int64), n_verts)
    counts = write_varint(n_verts) + write_varint(len(faces)) + b"\x00"
    stream = HEAD + bytes([surface.coding]) + counts + surface.connectivity + TAIL
    assert stream == zero_stream(faces, n_verts)


@pytest.mark.parametrize(("name", "coding"), [("octahedron", STANDARD), ("torus", VALENCE)])
def test_both_codings_are_met_when_meshes_are_small_and_large(meshes, name, coding):
    faces, n_verts = meshes[name]
    assert encode_surface(faces.astype(np.int64), n_verts).coding == coding


def test_points_name_their_vertices_when_decoded(meshes):
    faces, n_verts = meshes["shuffled torus"]
    surface = encode_surface(faces.astype(np.int64), n_verts)
    found = surface.vertex_of_point[surface.faces]
    assert {tuple(sorted(face)) for face in found.tolist()} == {
        tuple(sorted(face)) for face in faces.tolist()
    }


def test_encode_surface_gives_none_when_there_is_no_face():
    assert encode_surface(np.zeros((0, 3), np.int64), 0) is None


def test_encode_surface_gives_none_when_a_valence_would_take_draco_minutes():
    rim = np.arange(1, 100_000)
    cone = np.stack([np.zeros_like(rim), rim, np.roll(rim, -1)], axis=1)
    assert encode_surface(cone, 100_000) is None
    assert encode_surface(cone[:10_000], 10_002) is not None


def test_encode_surface_gives_none_when_draco_raises(meshes, monkeypatch):
    def fail(*args, **kwargs):
        raise DracoPy.EncodingFailedException("Invalid mesh")

    monkeypatch.setattr(DracoPy, "encode", fail)
    faces, n_verts = meshes["torus"]
    assert encode_surface(faces.astype(np.int64), n_verts) is None


@pytest.mark.parametrize("name", ["bowtie", "grid", "torus", "damaged torus", "crowded"])
def test_connectivity_size_is_exact_when_bytes_follow(meshes, name):
    faces, _ = meshes[name]
    surface = encode_surface(*without_repeats(faces))
    data = surface.connectivity
    assert connectivity_size(data + bytes(50), surface.coding, len(faces)) == len(data)
    for size in range(len(data)):
        with pytest.raises(CorruptStreamError):
            connectivity_size(data[:size], surface.coding, len(faces))


@pytest.mark.parametrize("name", ["octahedron", "torus"])
def test_decode_surface_tells_when_attributes_of_another_follow(meshes, name):
    faces, n_verts = meshes[name]
    surface = encode_surface(faces.astype(np.int64), n_verts)
    # 255 components of each vertex from a few bytes: what the check is there for.
    hostile = surface.connectivity + TAIL.replace(b"\x00\x09\x03", b"\x00\x09\xff")
    with pytest.raises(CorruptStreamError, match="left over"):
        decode_surface(hostile, surface.coding, n_verts, len(faces))


@pytest.mark.parametrize(
    ("n_points", "n_faces"), [(5, 8), (7, 8), (6, 7), (6, 9), (0, 8), (25, 8), (6, 0), (-1, 8)]
)
def test_decode_surface_tells_when_counts_differ(meshes, n_points, n_faces):
    faces, n_verts = meshes["octahedron"]
    surface = encode_surface(faces.astype(np.int64), n_verts)
    with pytest.raises(CorruptStreamError):
        decode_surface(surface.connectivity, surface.coding, n_points, n_faces)


def valence_stream(context=b"\x01\x01\x01\x01\x01\x40\x01\x00"):
    """One face of a boundary; a context has symbols, although the face needs none."""
    return b"\x01\x00\x00\xff\x01\x11" + context + bytes(5)


def test_connectivity_size_takes_the_hand_written_stream_when_it_is_right():
    assert connectivity_size(valence_stream(), VALENCE, 1) == 19


@pytest.mark.parametrize(("n_bits", "n_bytes"), [(1, 2), (2, 3), (4, 5)])
def test_connectivity_size_counts_raw_bits_when_symbols_are_tagged(n_bits, n_bytes):
    # Nine symbols, each of them with the only tag that the table has.
    table = bytes([n_bits + 1, 4 * (n_bits - 1) + 3, 0x01, 0x40])
    tagged = b"\x09\x00\x00\xff\x01\x11\x09\x00" + table + b"\x01\x00" + bytes(n_bytes + 5)
    assert connectivity_size(tagged + b"more", VALENCE, 9) == len(tagged)
    with pytest.raises(TruncatedStreamError):
        connectivity_size(tagged[: -n_bytes - 5] + bytes(n_bytes - 1), VALENCE, 9)


def test_connectivity_size_tells_when_many_symbols_are_tagged():
    many = b"\xac\x02\x00\x00\xff\x01\x11\xac\x02\x00\x02\x03\x01\x40\x01\x00" + bytes(43)
    with pytest.raises(CorruptStreamError, match="300 symbols of scheme 0"):
        connectivity_size(many, VALENCE, 300)


@pytest.mark.parametrize(
    "data",
    [
        valence_stream(b"\x02\x01\x01\x01\x01\x40\x01\x00"),  # more symbols than faces
        valence_stream(b"\x01\x02\x01\x01\x01\x40\x01\x00"),  # of no known scheme
        valence_stream(b"\x01\x00\x02\x03\x01\x40\x01\xc0"),  # tags without a state
        valence_stream(b"\x01\x01\x00\x01\x01\x40\x01\x00"),  # of no bits
        valence_stream(b"\x01\x01\x09\x01\x01\x40\x01\x00"),  # of too many
        valence_stream(b"\x01\x01\x01\x00\x01\x00"),  # an empty alphabet
        valence_stream(b"\x01\x01\x01\x06\x13\x01\x40\x01\x00"),  # a large one
        valence_stream(b"\x01\x01\x01\x81\x00\x01\x40\x01\x00"),  # one, written in two bytes
        valence_stream(b"\x01\x01\x01\x01\x01\x41\x01\x00"),  # probabilities above one
        valence_stream(b"\x01\x01\x01\x01\x07\x01\x00"),  # zeros beyond the alphabet
        valence_stream(b"\x01\x01\x01\x01\x01\x40\x7f\x00"),  # bytes that are not there
        b"\x02" + valence_stream()[1:],
        b"\x01\x02" + valence_stream()[2:],
        b"\x01\x00\x02" + valence_stream()[3:],
        b"\x01\x00\x00\xff\x00" + bytes(6),  # no state
        b"\x01\x00\x00\xff\x01\xc0" + bytes(6),
        b"\x01\x00\x00\xff\x01\x40" + bytes(6),  # a state cut off
        b"\x01\x00\x00\xff\x03\xff\xff\xbf" + bytes(6),  # a state too large
        b"\x81\x80\x80\x80\x80\x00" + valence_stream()[1:],  # a longer number than Draco reads
    ],
)
def test_connectivity_size_tells_when_draco_would_stop_elsewhere(data):
    with pytest.raises(CorruptStreamError):
        connectivity_size(data, VALENCE, 1)
