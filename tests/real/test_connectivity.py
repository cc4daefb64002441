"""Face lists of real sequences, with the structure that programs give them."""

import pytest

from meshreel.codec.connectivity.coder import encode_connectivity
from samples.coded_meshes import assert_faces_round_trip

pytestmark = pytest.mark.real

# Limits in bits per vertex of faces and order: measured figures plus 2 %.
LIMITS = {
    "balloons": 13.5,
    "bone": 12.8,
    "cesium_man": 15.8,
    "chicken": 28.4,
    "cow": 18.5,
    "dance": 14.7,
    "horse_gallop": 15.6,
    "jumping": 31.1,
    "samba": 29.9,
}

# The same without the order.
SURFACE_LIMITS = {
    "balloons": 0.34,
    "bone": 0.44,
    "cesium_man": 1.19,
    "chicken": 2.46,
    "cow": 1.70,
    "dance": 0.44,
    "horse_gallop": 1.80,
    "jumping": 2.09,
    "samba": 2.00,
}


@pytest.fixture(params=LIMITS)
def name(request):
    return request.param


@pytest.fixture
def mesh(sequence_named, name):
    sequence = sequence_named(name, 1)
    return sequence.faces, sequence.n_verts


@pytest.mark.parametrize("order", ["keep", "vertices", "drop"])
def test_real_faces_round_trip_exactly(mesh, order):
    faces, n_verts = mesh
    assert_faces_round_trip(faces, n_verts, order)


def test_connectivity_of_real_surfaces_stays_below_its_rate(name, mesh):
    coded = encode_connectivity(*mesh, order="drop")
    assert 8 * len(coded.payload) < SURFACE_LIMITS[name] * mesh[1]


def test_original_order_of_real_meshes_stays_below_its_rate(name, mesh):
    coded = encode_connectivity(*mesh)
    assert 8 * (len(coded.payload) + len(coded.order_payload)) < LIMITS[name] * mesh[1]
