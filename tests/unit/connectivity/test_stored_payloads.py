"""Payloads as they lie in files: whatever coder or Draco is installed, they must decode."""

import numpy as np

from meshreel.connectivity.coder import decode_connectivity, decode_order
from samples.meshes import irregular_sequence, octahedron_faces

LISTED_IRREGULAR = bytes.fromhex(
    "00253538d37736b5d6d7d7670003288504f431858800ecdffffe66676666607006c28b18d2172f92"
    "63e86fce73ff4f319f3365788755da901c3319000be6eb741d08b45aa50df21b7038d03d0f725b50"
    "7e3307a5225094ff69fdbc11f95ddbc3c84d9a98a00d0100009b04"
)
TRAVERSED_OCTAHEDRON = bytes.fromhex("0100000000070000026f15010110")
ORDER_OF_OCTAHEDRON = bytes.fromhex(
    "0100140a73760602066706aa020002e5aeaabe06000000010b0963604001ce0cd400000001117366"
    "182a602f9ce58c4653029c69e052000153aeaa39"
)
TRAVERSED_TORUS = bytes.fromhex(
    "0200000000df121f02f41042269107030101102901020503452d039d0f210308cd4a36e8ff1b4382"
    "280102040335030110cd2c08635cab36380c10821c01020507490203b93d031e7193c4080101040b"
    "01400100ad090101010140010000"
)
ORDER_OF_TORUS = bytes.fromhex(
    "0202390e93726630629062c003f04a6207000a7600f4459de5f69a665bfffc28b20f1ee6aafcea41"
    "6ffccdea57fa159c16f85c0810000e7e4e000015282409636020049c194806000018638c31c61863"
    "8c31c618638c31c618638c31c618638c31c601386360400063060c606c6e6ee56c670f95c5a2003b"
    "b067708631cf62ca9e3d79f2d8de4307a1b2678935f420c35e04c7998106602f758c06000591609f"
    "aec0b694ab3b9d1f269a71fdda8c4d0100beaaaeade8eaa6ec2bad62777ed773fcb66b7ae8417120"
    "048c0128840102"
)


def test_stored_list_decodes_exactly_when_read_again():
    expected = irregular_sequence().faces
    faces = decode_connectivity(LISTED_IRREGULAR, 37, len(expected))
    np.testing.assert_array_equal(faces, expected)


def test_stored_traversal_decodes_exactly_when_symbols_are_plain():
    internal = decode_connectivity(TRAVERSED_OCTAHEDRON, 6, 8)
    _, faces = decode_order(ORDER_OF_OCTAHEDRON, internal, 6)
    np.testing.assert_array_equal(faces, octahedron_faces())


def test_stored_traversal_decodes_exactly_when_symbols_are_in_contexts(meshes):
    internal = decode_connectivity(TRAVERSED_TORUS, 1200, 2400)
    _, faces = decode_order(ORDER_OF_TORUS, internal, 1200)
    np.testing.assert_array_equal(faces, meshes["torus"][0])
