"""Materials and images of other programs survive streams and other formats."""

import zipfile

import pytest

import meshreel
from meshreel.formats.load import load
from meshreel.operations.save import save
from samples.glb import Glb

pytestmark = pytest.mark.real


@pytest.fixture(scope="module")
def decoded(data):
    """Return the decoded walks by file name."""
    names = ("cesium_man.glb", "cesium_man.usdz")
    return {name: meshreel.decode(meshreel.encode(load(data / "native" / name))) for name in names}


def glb_of(path):
    """Return the JSON of a GLB file and the bytes of its first image."""
    file = Glb.read(path.read_bytes())
    view = file.document["bufferViews"][file.document["images"][0]["bufferView"]]
    start = view.get("byteOffset", 0)
    return file.document, file.buffer[start : start + view["byteLength"]]


def package_images(path):
    with zipfile.ZipFile(path) as package:
        return [package.read(one) for one in package.namelist() if not one.endswith(".usdc")]


def test_glb_from_a_stream_keeps_image_and_material(data, decoded, tmp_path):
    save(decoded["cesium_man.glb"], tmp_path / "a.glb")
    given, image = glb_of(data / "native" / "cesium_man.glb")
    result, found_image = glb_of(tmp_path / "a.glb")
    assert found_image == image
    assert result["samplers"] == [{"magFilter": 9729, "minFilter": 9986}]
    (expected,), (material,) = given["materials"], result["materials"]
    assert material["name"] == expected["name"]
    assert material["pbrMetallicRoughness"] == {
        "metallicFactor": 0.0,
        "baseColorTexture": {"index": 0},
    }
    # Everything else has the defaults of the standard.
    assert set(material) == {"name", "pbrMetallicRoughness"}
    assert expected["pbrMetallicRoughness"]["roughnessFactor"] == 1


def test_usdz_from_a_stream_keeps_image_and_material(data, decoded, tmp_path):
    given = load(data / "native" / "cesium_man.usdz").surface
    save(decoded["cesium_man.usdz"], tmp_path / "a.usdz")
    result = load(tmp_path / "a.usdz").surface
    assert package_images(tmp_path / "a.usdz") == package_images(
        data / "native" / "cesium_man.usdz"
    )
    assert result.materials == given.materials
    assert result.images == given.images


@pytest.mark.parametrize("extension", ["usda", "usdz", "gltf"])
@pytest.mark.parametrize("name", ["cesium_man.glb", "cesium_man.usdz"])
def test_other_formats_keep_image_and_factors(decoded, tmp_path, name, extension):
    save(decoded[name], tmp_path / f"a.{extension}")
    again = meshreel.decode(meshreel.encode(load(tmp_path / f"a.{extension}")))
    save(again, tmp_path / "b.glb")
    result, expected = load(tmp_path / "b.glb").surface, decoded[name].surface
    assert [image.data for image in result.images] == [image.data for image in expected.images]
    (one,), (other,) = result.materials, expected.materials
    assert (one.name, one.base_color, one.metallic, one.roughness, one.emissive) == (
        other.name,
        other.base_color,
        other.metallic,
        other.roughness,
        other.emissive,
    )
    assert (one.alpha_mode, one.double_sided) == (other.alpha_mode, other.double_sided)
    assert one.textures.keys() == {"base_color"}


def test_info_reports_the_bytes_of_the_image(data):
    stream = meshreel.info(meshreel.encode(load(data / "native" / "cesium_man.usdz")))
    assert stream.budget_bytes["image"] == 209908 + len("CesiumMan_img0") + len("image/jpeg") + 10
    assert stream.materials == ("Cesium_Man_effect: base color image 0",)
