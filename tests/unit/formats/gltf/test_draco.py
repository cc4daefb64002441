import DracoPy
import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.load import load
from samples.gltf import Gltf

POSITIONS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]])
FACES = np.array([[0, 1, 2], [0, 2, 3], [0, 1, 4], [1, 2, 4]])
UV = np.array([[0, 0], [0.5, 0], [0.5, 0.5], [0, 0.5], [0.25, 0.25]], np.float32)


def packed(**options):
    """Return a glTF file with one Draco-compressed mesh, and its extension for modification."""
    data = DracoPy.encode(
        POSITIONS.astype(np.float32), FACES, quantization_bits=16, generic_attributes={7: UV},
        **options,
    )  # fmt: skip
    decoded = DracoPy.decode(data)
    [position_id] = [
        attribute["unique_id"]
        for attribute in decoded.attributes
        if attribute["attribute_type"] == 0
    ]
    file, n_verts = Gltf(), len(decoded.points)
    attributes = {
        "POSITION": file.add("accessors", componentType=5126, count=n_verts, type="VEC3"),
        "TEXCOORD_0": file.add("accessors", componentType=5126, count=n_verts, type="VEC2"),
    }
    extension = {
        "bufferView": file.view(data),
        "attributes": {"POSITION": position_id, "TEXCOORD_0": 7},
    }
    primitive = {
        "attributes": attributes,
        "indices": file.add("accessors", componentType=5125, count=FACES.size, type="SCALAR"),
        "extensions": {"KHR_draco_mesh_compression": extension},
    }
    file.node(mesh=file.add("meshes", primitives=[primitive]))
    file.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return file, extension


def corner_values(sequence):
    """Return positions and UVs of all corners, independent of the order of faces and corners."""
    [uv] = sequence.surface.attributes
    positions = sequence.vertices[0][sequence.faces]
    values = uv.per_item()
    of_corners = values[sequence.faces] if uv.domain == "vertex" else values.reshape(-1, 3, 2)
    rows = np.concatenate([positions, of_corners], axis=2)
    sorted_corners = [np.roll(row, -np.lexsort(row.T[::-1])[0], axis=0) for row in rows]
    return np.array(sorted(np.round(row, 3).ravel().tolist() for row in sorted_corners))


@pytest.mark.parametrize("options", [{}, {"preserve_order": True}, {"compression_level": 10}])
def test_load_reads_a_draco_mesh(tmp_path, options):
    file, _ = packed(**options)
    loaded = load(file.save(tmp_path / "a.glb"))
    plain = Gltf()
    uv = plain.accessor(UV)
    plain.node(mesh=plain.mesh(POSITIONS, FACES, attributes={"TEXCOORD_0": uv}))
    expected = load(plain.save(tmp_path / "b.glb"))
    assert (loaded.n_verts, loaded.n_faces) == (5, 4)
    np.testing.assert_allclose(corner_values(loaded), corner_values(expected), rtol=0, atol=1e-4)


def announce(key, index, count):
    def change(file, extension):
        file.json["accessors"][index][key] = count

    return change


def cut(file, extension):
    file.json["bufferViews"][0]["byteLength"] = 30


def other_id(file, extension):
    extension["attributes"]["TEXCOORD_0"] = 9


def no_mesh(file, extension):
    file.data[0] ^= 1


def ends_in_head(file, extension):
    file.json["bufferViews"][0]["byteLength"] = 12


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (announce("count", 0, 3), "the file declares 3 and 4"),
        (announce("count", 2, 9), "the file declares .* and 3"),
        (
            announce("type", 1, "VEC3"),
            r"the Draco stream has values of shape \(\d+, 2\) for accessor 1",
        ),
        (cut, "Draco cannot decode it"),
        (other_id, "the Draco stream has no values for accessor 1"),
        (no_mesh, "is not a triangle mesh of Draco"),
        (ends_in_head, "ends within the header of its Draco stream"),
    ],
)
def test_load_describes_what_is_wrong_with_a_draco_stream(tmp_path, change, message):
    file, extension = packed()
    change(file, extension)
    with pytest.raises(FormatError, match=rf"mesh 0, primitive 0, .*{message}"):
        load(file.save(tmp_path / "a.glb"))
