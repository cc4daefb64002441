"""Meshes as the core decodes them from a stream, and tables as the plain reader does."""

import numpy as np

from conformance.surface_integers import read_surface_integers
from meshreel.codec.bitstream.container import Header, write_block_counts
from meshreel.codec.bitstream.layout import Laplacian, Order, Section, VertexType
from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.method_names import METHOD_CODES
from meshreel.kernel.connectivity import encode_faces
from meshreel.kernel.files import OpenFile
from meshreel.model.geometry.triangles import lowest_rotation, sorted_order
from samples.streams import raw_stream

ORDERS = {b"": Order.DROP, b"\1": Order.VERTICES}


def decode_connectivity(payload, n_verts, n_faces):
    """Return the internal faces."""
    return _file(payload, b"", n_verts, n_faces).stored_mesh[0]


def decode_order(order_payload, internal_faces, n_verts):
    """Return the given number of each internal vertex, and the faces in given numbers."""
    faces = np.ascontiguousarray(internal_faces, np.int32)
    payload = encode_faces(faces, n_verts, listed=True).data
    file = _file(payload, order_payload, n_verts, len(faces))
    return np.argsort(file.stored_mesh[1]), file.faces


def decode_on_surface(data, shape, faces, twins):
    """Return a table of integers, or frames of one, that the plain reader decodes."""
    n_frames, n_rows, width = (1, *shape)[-3:]
    frames = read_surface_integers(data, n_frames, n_rows, width, faces.tolist(), twins.tolist())
    return np.array(frames, np.int32).reshape(shape)


def sorted_triangles(faces, n_verts):
    """Return the faces in lexicographic order, each from its lowest corner."""
    lowest, _ = lowest_rotation(faces, n_verts)
    return lowest[sorted_order(lowest, n_verts)]


def assert_faces_round_trip(faces, n_verts, order):
    """Encode faces; assert that they and the order of vertices are decoded as `order` promises."""
    coded = encode_connectivity(faces, n_verts, order=order)
    internal = decode_connectivity(coded.payload, n_verts, len(faces))
    np.testing.assert_array_equal(internal, coded.internal_faces)
    vertex_order, decoded = decode_order(coded.order_payload, internal, n_verts)
    if order == "keep":
        np.testing.assert_array_equal(decoded, faces)
    if order != "drop":
        np.testing.assert_array_equal(vertex_order, coded.internal_to_given)
    expected = sorted_triangles(faces, n_verts)
    given = coded.internal_to_given[decoded] if order == "drop" else decoded
    for found in (coded.internal_to_given[internal], given):
        np.testing.assert_array_equal(sorted_triangles(found, n_verts), expected)


def _file(payload, order_payload, n_verts, n_faces):
    order = ORDERS.get(order_payload[:1], Order.KEEP)
    number_type, method = VertexType.FLOAT32, METHOD_CODES["lossless"]
    header = Header(
        1, n_verts, n_faces, 0.0, number_type, method, Laplacian.NORMALIZED, order, (0.0,) * 3, 1.0,
        "",
    )  # fmt: skip
    sections = [
        (Section.CONNECTIVITY, payload),
        *([] if order is Order.DROP else [(Section.ORDER, order_payload)]),
        (Section.BLOCK, write_block_counts(1, 0)),
        (Section.VALUES, b""),
    ]
    return OpenFile(raw_stream(header, sections), float("inf"))
