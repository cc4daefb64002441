from dataclasses import replace
from io import BytesIO
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import meshreel
from conformance.surface import CornerReferences, Polygons, read_references
from meshreel.codec import encoder
from meshreel.codec.bitstream.container import write_text, write_varint
from meshreel.codec.bitstream.layout import SURFACE_SECTIONS, Order, Section
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.joining import join_streams
from meshreel.codec.surface.payloads import (
    order_loss_note,
    order_notes,
    surface_sections,
    write_material,
)
from meshreel.codec.surface.rows import encode_corner_references, encode_references
from meshreel.errors import CorruptStreamError, InvalidInputError
from meshreel.kernel.files import OpenFile
from meshreel.kernel.integers import encode_integers
from meshreel.kernel.polygons import triangle_corners, triangulate
from meshreel.model.cells import Cells
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.materials import Image, Material, Texture
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import PLAIN, Attribute, Domain, Kind, Surface
from meshreel.model.tracks import Track
from samples.materials import dressed_sheet, dressed_sheets
from samples.meshes import (
    assert_same_surface,
    hard_box,
    hard_sheet,
    quad_sheet,
    two_sheets,
    waving_grid,
)
from samples.orders import shuffled
from samples.streams import Stream, parts_of, raw_stream, recorded


@pytest.mark.parametrize("method", ["reel", "pca-qp", "lossless"])
@pytest.mark.parametrize(
    "make", [quad_sheet, hard_sheet, two_sheets, dressed_sheet, dressed_sheets]
)
def test_surface_is_lossless(make, method):
    sequence = make()
    decoded = meshreel.decode(meshreel.encode(sequence, method))
    assert_same_surface(decoded.surface, sequence.surface)
    np.testing.assert_array_equal(decoded.faces, sequence.faces)
    assert (decoded.fps, decoded.start_s) == (24.0, 1001 / 24)


def rough_sheet(height=1.0):
    """Return an irregular sheet whose texture coordinates are a projection of its first frame."""
    sheet = waving_grid(2, 20, 21)
    jitter = np.random.default_rng(3).uniform(-0.04, 0.04, (420, 3))
    vertices = ((sheet.vertices + jitter) * [1.0, 1.0, height]).astype(np.float32)
    x, y, z = vertices[0].T
    uvs = np.rint(4096 * np.stack([x + z, y - 0.5 * z], axis=1)).astype(np.float32) / 4096
    surface = Surface(attributes=(Attribute("uv", "uv", "vertex", uvs),))
    return sheet.replace(vertices=vertices, surface=surface)


def ids_of(data, segment=0):
    return [section.id for section in OpenFile(data, float("inf")).segment(segment).leading]


@pytest.mark.parametrize("order", ["keep", "drop"])
@pytest.mark.parametrize("method", ["reel", "lossless", "grid"])
def test_uvs_are_predicted_from_positions(method, order):
    options = {"order": order} | ({"max_error": "0.1%"} if method == "grid" else {})
    data = meshreel.encode(rough_sheet(), method, **options)
    with patch.object(encoder, "predict_from_positions", lambda streams, meshes: streams):
        plain = meshreel.encode(rough_sheet(), method, **options)
    stored, stored_plain = (meshreel.info(stream).part_bytes["surface"] for stream in (data, plain))
    assert stored < 0.8 * stored_plain
    decoded = meshreel.decode(data)
    assert_same_surface(decoded.surface, meshreel.decode(plain).surface)
    assert_same_surface(decode_all(data)[0], decoded.surface)


def decode_all(data):
    """Return the surface of each segment of a file that is decoded segment by segment."""
    with meshreel.open(BytesIO(data)) as reel:
        return [segment.surface for segment in reel.segments]


def test_methods_of_the_paper_do_not_predict_from_positions():
    assert Section.ATTRIBUTE_FROM_POINTS not in ids_of(meshreel.encode(rough_sheet(), "pca-qp"))
    stream = Stream(meshreel.encode(waving_grid(5), "pca-qp"))
    placed = Section.ATTRIBUTE_FROM_POINTS, bytes([2, 0, 1, 1, 0, 0, 99, 0, 255, 4])
    with pytest.raises(CorruptStreamError, match="method does not define"):
        meshreel.decode(raw_stream(stream.header, [placed, *parts_of(stream)]))


def test_segments_of_one_mesh_keep_the_uvs_of_their_own_positions():
    segments = [rough_sheet(), rough_sheet(height=2.0), rough_sheet()]
    data = meshreel.encode(meshreel.MeshSequence.of_segments(segments[:2]))
    assert Section.ATTRIBUTE_FROM_POINTS in ids_of(data)
    decoded = [segment.surface for segment in meshreel.decode(data).segments]
    for number, surface in enumerate([*decoded, *decode_all(data)]):
        assert_same_surface(surface, segments[number % 2].surface)
    shared = meshreel.encode(meshreel.MeshSequence.of_segments(segments))
    assert Section.ATTRIBUTE in ids_of(shared)  # the third segment refers to it
    joined = join_streams(2 * [meshreel.encode(segments[0])])
    for number, surface in enumerate(decode_all(joined)):
        assert_same_surface(surface, segments[0].surface)
        assert Section.ATTRIBUTE_FROM_POINTS in ids_of(joined, number)


@pytest.mark.parametrize("dtype", ["u1", "i4", "f4", "f8"])
@pytest.mark.parametrize("domain", list(Domain))
@pytest.mark.parametrize("is_indexed", [False, True])
def test_values_of_any_type_and_domain_are_lossless(dtype, domain, is_indexed):
    sequence, rng = quad_sheet(2), np.random.default_rng(5)
    if domain is Domain.CELL:
        sequence = MeshSequence(sequence.vertices, cells=Cells([9], [0, 1, 5, 4]))
    n_items = sequence.surface.n_items(domain, sequence.n_verts, sequence.n_faces)
    n_rows = 7 if is_indexed else n_items
    values = rng.integers(0, 256, (n_rows, 16 * np.dtype(dtype).itemsize), np.uint8).view(dtype)
    indices = rng.integers(0, 7, n_items) if is_indexed else None
    attribute = Attribute("odd \u00e9", Kind.OTHER, domain, values, indices)
    surface = replace(sequence.surface, attributes=(attribute,))
    given = sequence.replace(surface=surface)
    assert_same_surface(meshreel.decode(meshreel.encode(given)).surface, given.surface)


@pytest.mark.parametrize(
    ("make", "absent"),
    [
        (waving_grid, {*SURFACE_SECTIONS, Section.START}),
        (quad_sheet, {Section.MATERIAL, Section.IMAGE}),
    ],
)
def test_streams_have_no_sections_of_missing_data(make, absent):
    sections = {section for section, _ in parts_of(Stream(meshreel.encode(make())))}
    assert not sections & absent


def test_default_material_takes_few_bytes():
    assert len(write_material(Material("skin", roughness=0.5))) == len("skin") + 1 + 1 + 1 + 8 + 1


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
@pytest.mark.parametrize("uv_bits", [None, 9])
def test_values_along_the_faces_are_lossless_in_every_order(order, uv_bits):
    u, v = np.divmod(np.arange(14 * 15), 15)
    values = np.stack([u / 14 + 0.01 * np.sin(v), v / 15], axis=1).astype(np.float32)
    uv = Attribute("uv", Kind.UV, Domain.VERTEX, values)
    given = shuffled(waving_grid(4, 14, 15).replace(surface=Surface(attributes=(uv,))), 2)
    values = given.surface.attributes[0].values
    decoded = meshreel.decode(meshreel.encode(given, order=order, uv_bits=uv_bits))
    expected = values if uv_bits is None else np.rint(values * 512) / 512
    if order == "drop":
        coded = encode_connectivity(given.faces, given.n_verts, order="drop")
        expected = expected[coded.internal_to_given]
    np.testing.assert_array_equal(decoded.surface.attributes[0].values, expected)


@pytest.mark.parametrize("order", ["vertices", "drop"])
def test_attributes_and_groups_follow_triangles_when_the_order_of_faces_is_dropped(order):
    given = dressed_sheets()
    decoded = meshreel.decode(meshreel.encode(given, order=order, lossless=True))

    def contents(sequence):
        """Corner positions, attribute values and labels of each triangle, in any order."""
        surface, sizes = sequence.surface, sequence.surface.sizes(len(sequence.faces))
        polygons = np.repeat(np.arange(len(sizes)), sizes - 2)
        items = {
            Domain.VERTEX: sequence.faces,
            Domain.FACE: np.repeat(polygons[:, None], 3, axis=1),
            Domain.CORNER: triangle_corners(sizes, sequence.faces),
        }
        columns = [sequence.vertices[0][sequence.faces]]
        columns += [
            attribute.per_item()[items[attribute.domain]] for attribute in surface.attributes
        ]
        labels = [group.numbers[polygons] for group in surface.groups]
        rows = np.concatenate([column.astype(float) for column in columns], axis=2)
        return sorted(
            (sorted(triangle.tolist()), [int(label[number]) for label in labels])
            for number, triangle in enumerate(rows)
        )

    assert contents(decoded) == contents(given)
    assert [material.name for material in decoded.surface.materials] == ["red", "gr\u00fcn"]
    assert order_loss_note(given.surface, Order[order.upper()]).endswith(": polygons and parts")
    assert order_loss_note(decoded.surface, Order[order.upper()]) == ""
    assert order_loss_note(given.surface, Order.KEEP) == ""


def test_live_encoder_stores_surface_and_start():
    sequence = two_sheets()
    decoded = meshreel.decode(recorded(sequence, start_s=2.5))
    assert_same_surface(decoded.surface, sequence.surface)
    assert decoded.start_s == 2.5


def test_info_lists_the_parts_of_the_surface():
    info = meshreel.info(meshreel.encode(two_sheets()))
    assert info.parts == ("/root/a", "/root/b")
    assert info.n_polygons == len(two_sheets().surface.face_sizes)
    assert info.attributes[:2] == ("uv 'st' of corners", "color 'color' of vertices")
    assert info.start_s == 1001 / 24


def damaged_material(payload):
    """A stream with an image, and a material of these bytes."""
    stream = Stream(meshreel.encode(waving_grid()))
    sections = [(Section.MATERIAL, payload), (Section.IMAGE, b"\x00\x09image/png...")]
    return raw_stream(stream.header, [*sections, *parts_of(stream)])


def test_texture_of_the_format_is_read():
    data = damaged_material(b"\x01a\x00\x00\x01\x00\x00\x07\x00\x00\x00")
    surface = meshreel.decode(data).surface
    assert surface.materials == (Material("a", base_color_texture=Texture(0, "")),)
    assert surface.images == (Image("", "image/png", b"..."),)


@pytest.mark.parametrize(
    ("numbers", "is_read"), [([-1, 0, 1], True), ([0, 1, 2], False), ([0, -2, 0], False)]
)
def test_groups_without_the_group_of_a_face_are_refused(numbers, is_read):
    labels = write_varint(2) + write_text("a") + write_text("b")
    payload = write_text("material") + labels + encode_integers([np.diff(numbers, prepend=0)])
    fan = meshreel.MeshSequence(np.eye(5, 3)[None], [[0, 1, 2], [0, 2, 3], [0, 3, 4]])
    stream = Stream(meshreel.encode(fan))
    data = raw_stream(stream.header, [(Section.GROUPS, payload), *parts_of(stream)])
    if is_read:
        assert meshreel.decode(data).surface.groups[0].numbers.tolist() == numbers
        return
    with pytest.raises(CorruptStreamError, match="group"):
        meshreel.decode(data)


@pytest.mark.parametrize("order", ["vertices", "drop"])
def test_hard_edges_are_lossless_when_the_order_of_faces_is_dropped(order):
    given = hard_sheet()
    data = meshreel.encode(given, order=order)
    decoded = meshreel.decode(data)
    coded = encode_connectivity(given.faces, given.n_verts, order=order)
    names = coded.internal_to_given if order == "drop" else np.arange(given.n_verts)
    results = {frozenset(names[edge].tolist()) for edge in decoded.surface.hard_edges}
    assert results == {frozenset(edge.tolist()) for edge in given.surface.hard_edges}
    assert "hard" not in order_loss_note(given.surface, Order[order.upper()])


def hard_section(surface, faces):
    wanted = [
        section for section in surface_sections(surface, faces) if section[0] is Section.HARD_EDGES
    ]
    return wanted[0][1] if wanted else b""


def test_no_hard_edges_take_no_bytes_and_all_hard_edges_few():
    grid = waving_grid(2, 60, 60)
    assert hard_section(grid.surface, grid.faces) == b""
    edges = shared_edges(np.full(len(grid.faces), 3), grid.faces.ravel()).ends
    assert len(hard_section(Surface(hard_edges=edges), grid.faces)) <= 10
    assert len(hard_section(hard_box().surface, hard_box().faces)) <= 4


@pytest.mark.parametrize("edge", [[0, 98], [0, 1]], ids=["no edge", "boundary"])
def test_hard_edge_without_two_faces_is_refused(edge):
    given = waving_grid(2).replace(surface=Surface(hard_edges=np.array([edge])))
    words = f"hard edge {edge[0]}, {edge[1]} must have two or more faces"
    with pytest.raises(InvalidInputError, match=words):
        meshreel.encode(given)


def unordered(sequence):
    return sequence.replace(surface=replace(sequence.surface, is_ordered=False))


@pytest.mark.parametrize(
    ("sequence", "order"),
    [
        (waving_grid(3), "keep"),
        (unordered(waving_grid(3)), "drop"),
        (unordered(quad_sheet(3)), "keep"),
        (unordered(two_sheets()), "keep"),
    ],
)
def test_default_order_is_kept_if_it_has_a_meaning_or_polygons_need_it(sequence, order):
    assert meshreel.info(meshreel.encode(sequence)).order == order
    assert meshreel.info(meshreel.encode(sequence, order="vertices")).order == "vertices"


def test_order_that_tracks_of_corners_need_is_kept():
    sheet = unordered(waving_grid(3))
    heat = Track(np.zeros((3, 3 * len(sheet.faces)), np.float32), domain=Domain.CORNER)
    data = meshreel.encode(sheet.replace(tracks={"heat": heat}), tracks={"heat": "1%"})
    assert meshreel.info(data).order == "keep"


def test_note_on_an_order_that_the_user_has_not_chosen():
    (note,) = order_notes([unordered(waving_grid(2)).surface], "drop", is_chosen=False)
    assert "which has no meaning" in note
    assert order_notes([PLAIN], "keep", is_chosen=False) == []
    assert order_notes([PLAIN] * 2, "keep, drop", is_chosen=False) == [note]
    assert len(order_notes([two_sheets().surface] * 2, "drop", is_chosen=True)) == 1


ROWS = st.integers(0, 80).flatmap(lambda size: arrays(np.int32, size, elements=st.integers(0, 20)))


@given(ROWS)
def test_references_of_vertices_round_trip(rows):
    assert read_references(encode_references(rows), len(rows)) == rows.tolist()


@st.composite
def polygon_rows(draw):
    """Sizes and corners of polygons on a few vertices, and a row of each corner."""
    sizes = np.array(draw(st.lists(st.integers(3, 6), min_size=1, max_size=12)))
    n_corners = int(sizes.sum())
    corners = draw(arrays(np.int64, n_corners, elements=st.integers(0, 6)))
    return sizes, corners, draw(arrays(np.int32, n_corners, elements=st.integers(0, 9)))


@given(polygon_rows())
def test_references_of_corners_of_any_polygons_round_trip(case):
    sizes, corners, rows = case
    faces, _ = triangulate(sizes, corners, np.random.default_rng(0).random((7, 3)))
    surface = Surface(face_sizes=sizes.astype(np.int32))
    polygons = Polygons(None, [tuple(face) for face in faces.tolist()])
    polygons.sizes = sizes.tolist()
    coded = encode_corner_references(rows, surface, faces)
    assert CornerReferences(coded, polygons).read() == rows.tolist()


def test_negative_rows_are_refused():
    with pytest.raises(InvalidInputError, match="rows of corners"):
        encode_corner_references(np.array([0, -1, 2]), PLAIN, np.array([[0, 1, 2]], np.int32))
