"""Materials and images of glTF files, read and written, and notes on unsupported properties."""

import base64
import contextlib
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.errors import MeshReelError
from meshreel.formats.gltf.write import write_gltf
from meshreel.formats.load import load
from meshreel.formats.options import WriteOptions
from meshreel.model.materials import AlphaMode, Filter, Image, Material, Texture, Wrap
from meshreel.model.surface import Attribute, Domain, Kind, Surface
from meshreel.operations.save import save
from samples.costs import draws
from samples.glb import Glb, stream_of, written
from samples.gltf import SQUARE, SQUARE_FACES, Gltf
from samples.json import DELETED, ODD, changed, places
from samples.materials import dressed_sheet, dressed_sheets, jpeg, look, png

FACTORS = {
    "pbrMetallicRoughness": {
        "baseColorFactor": [0.1, 0.2, 0.3, 0.4],
        "metallicFactor": 0.6,
        "roughnessFactor": 0.7,
        "baseColorTexture": {"index": 0},
        "metallicRoughnessTexture": {"index": 1, "texCoord": 1},
    },
    "normalTexture": {"index": 1, "scale": 0.8},
    "occlusionTexture": {"index": 1, "strength": 0.9},
    "emissiveTexture": {"index": 0},
    "emissiveFactor": [0.3, 0.2, 0.1],
    "alphaMode": "MASK",
    "alphaCutoff": 0.25,
    "doubleSided": True,
}
SAMPLER = {"magFilter": 9728, "minFilter": 9987, "wrapS": 33648, "wrapT": 33071}


def square_with(material, *, images=None, n_uvs=2):
    """Return a square with one material, and two textures of two images."""
    file = Gltf()
    uv = {f"TEXCOORD_{i}": file.accessor(np.array(SQUARE)[:, :2] / (i + 1)) for i in range(n_uvs)}
    mesh = file.mesh(SQUARE, SQUARE_FACES, attributes=uv)
    file.json["meshes"][mesh]["primitives"][0]["material"] = file.add(
        "materials", **deepcopy(material)
    )
    file.node(mesh=mesh, name="square")
    for one in images or (png(), jpeg()):
        file.add("images", bufferView=file.view(one.data), mimeType=one.mime_type, name=one.name)
    file.add("samplers", **SAMPLER)
    file.add("textures", source=0, sampler=0)
    file.add("textures", source=1)
    return file


def read(file, folder, extension="glb"):
    """Return the surface of a file, and the notes of reading it."""
    notes = []
    sequence = load(file.save(folder / f"a.{extension}"), notes=notes)
    return sequence.surface, notes


@pytest.fixture
def surface_of(tmp_path):
    return lambda file: read(file, tmp_path)


def test_material_is_read_with_every_property(surface_of):
    surface, notes = surface_of(square_with({"name": "skin", **FACTORS}))
    expected = Material(
        "skin",
        (0.1, 0.2, 0.3, 0.4),
        0.6,
        0.7,
        (0.3, 0.2, 0.1),
        0.8,
        0.9,
        AlphaMode.MASK,
        0.25,
        True,
        base_color_texture=(
            base_color := Texture(
                0,
                "uv",
                "rgba",
                Wrap.MIRROR,
                Wrap.CLAMP,
                Filter.NEAREST,
                Filter.LINEAR_MIPMAP_LINEAR,
            )
        ),
        metallic_texture=Texture(1, "uv1", "b"),
        roughness_texture=Texture(1, "uv1", "g"),
        normal_texture=Texture(1),
        occlusion_texture=Texture(1, channels="r"),
        emissive_texture=replace(base_color, channels="rgb"),
    )
    assert surface.materials == (expected,)
    assert surface.images == (png(), jpeg())
    assert [group.labels for group in surface.groups] == [("skin",)]
    assert notes == []


def test_material_round_trips_to_the_same_json(tmp_path):
    file = square_with({"name": "skin", **FACTORS})
    sequence = load(file.save(tmp_path / "a.glb"))
    again = written(tmp_path, meshreel.decode(meshreel.encode(sequence)))
    assert again.document["materials"] == file.json["materials"]
    views = [again.document["bufferViews"][one["bufferView"]] for one in again.document["images"]]
    data = [again.buffer[view["byteOffset"] :][: view["byteLength"]] for view in views]
    assert data == [png().data, jpeg().data]
    assert again.document["samplers"] == [SAMPLER]
    assert "extensionsUsed" not in again.document


@pytest.mark.parametrize("extension", ["glb", "gltf"])
@pytest.mark.parametrize("make", [dressed_sheet, dressed_sheets])
def test_materials_round_trip_through_files(tmp_path, make, extension, notes):
    sequence = make()
    save(sequence, tmp_path / f"a.{extension}", notes=notes)
    result = load(tmp_path / f"a.{extension}", merge=True).surface
    # glTF identifies UV sets by index, not by name.
    expected = [as_gltf(material) for material in sequence.surface.materials]
    assert sorted(result.materials, key=str) == sorted(expected, key=str)
    assert sorted(image.data for image in result.images) == sorted(
        image.data for image in sequence.surface.images
    )
    assert not any("material" in note for note in notes)


def as_gltf(material):
    textures = {
        slot: replace(
            texture, uv="uv", channels="rgba" if slot == "base_color" else texture.channels
        )
        for slot, texture in material.textures.items()
    }
    return material.with_textures(textures)


def test_extensions_without_loss_round_trip(tmp_path):
    transform = {"offset": [0.5, 0.25], "rotation": 0.1, "scale": [2.0, 3.0], "texCoord": 1}
    material = {
        "name": "skin",
        "emissiveFactor": [1, 0.5, 0.25],
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0, "extensions": {"KHR_texture_transform": transform}}
        },
        "extensions": {
            "KHR_materials_unlit": {},
            "KHR_materials_emissive_strength": {"emissiveStrength": 4.0},
        },
    }
    sequence = load(square_with(material).save(tmp_path / "a.glb"))
    (result,) = sequence.surface.materials
    assert result.emissive == (4.0, 2.0, 1.0)
    assert result.base_color_texture.uv == "uv1"
    again = written(tmp_path, sequence).document
    material_json = again["materials"][0]
    assert material_json["extensions"] == material["extensions"]
    assert material_json["pbrMetallicRoughness"]["baseColorTexture"] == {
        "index": 0,
        "texCoord": 1,
        "extensions": {
            "KHR_texture_transform": {k: transform[k] for k in ("offset", "rotation", "scale")}
        },
    }
    assert set(again["extensionsUsed"]) == {*material["extensions"], "KHR_texture_transform"}
    assert "extensionsRequired" not in again


def test_unsupported_extensions_of_materials_are_noted_once(surface_of):
    material = {"name": "skin", "extensions": {"KHR_materials_ior": {}, "KHR_materials_unlit": {}}}
    surface, notes = surface_of(square_with(material))
    assert "left out: KHR_materials_ior: skin" in notes
    assert surface.materials == (Material("skin", unlit=True),)


@pytest.mark.parametrize("uri", ["sub/my%20skin.png", "data:image/png;base64,"])
def test_images_are_read_from_other_files_and_data_uris(tmp_path, uri):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "my skin.png").write_bytes(png().data)
    file = square_with({"name": "skin", **FACTORS})
    is_embedded = uri.startswith("data:")
    if is_embedded:
        uri += base64.b64encode(png().data).decode()
    file.json["images"][0] = {"uri": uri}
    surface, notes = read(file, tmp_path, "gltf")
    assert surface.images[0] == Image("" if is_embedded else "my skin", "image/png", png().data)
    assert notes == []


@pytest.mark.parametrize(
    ("image", "message"),
    [
        ({"uri": "gone.png"}, "refers to the file 'gone.png', which does not exist"),
        ({"uri": "../skin.png"}, "outside its folder"),
        ({"uri": "/etc/passwd"}, "outside its folder"),
        ({"uri": "http://example.com/a.png"}, "only files in the folder"),
        ({"uri": "data:image/png;base64,A"}, "not valid base64"),
        ({}, "has no 'uri'"),
        ({"bufferView": 99}, "'bufferView' must be below"),
        ({"uri": 5}, "'uri' must be text"),
    ],
)
def test_unreadable_image_is_left_out_and_noted(tmp_path, image, message):
    (tmp_path / "skin.png").write_bytes(png().data)
    (tmp_path / "in").mkdir()
    file = square_with({"name": "skin", **FACTORS})
    file.json["images"][0] = image
    surface, notes = read(file, tmp_path / "in", "gltf")
    (note,) = notes
    assert note.startswith("left out: texture images: image 0")
    assert message in note
    (result,) = surface.materials
    assert set(result.textures) == {"metallic", "roughness", "normal", "occlusion"}
    assert surface.images == (jpeg(),)
    assert result.metallic_texture.image == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"alphaMode": "CLEAR"}, "'alphaMode' must be OPAQUE, MASK or BLEND"),
        ({"emissiveFactor": [1, 2]}, "a list of 3 finite numbers"),
        ({"pbrMetallicRoughness": {"metallicFactor": "1"}}, "a finite number"),
        ({"normalTexture": {"index": 9}}, "below 2"),
        ({"normalTexture": {}}, "the index of a texture"),
        ({"normalTexture": {"index": 0, "scale": None}}, "a finite number"),
        ({"doubleSided": 1}, "true or false"),
        ({"extensions": 5}, "an object"),
    ],
)
def test_invalid_material_is_left_out_and_noted(surface_of, change, message):
    surface, notes = surface_of(square_with({"name": "skin", **change}))
    note = notes[-1]
    assert note.startswith("left out: appearance of materials: material 0")
    assert message in note
    assert surface.materials == ()
    assert surface.groups[0].labels == ("skin",)


def test_single_mesh_has_only_the_materials_and_images_that_it_uses(tmp_path):
    file = square_with({"name": "skin", **FACTORS})
    mesh = file.mesh(SQUARE, SQUARE_FACES, attributes={"TEXCOORD_0": 0})
    pbr = {"baseColorTexture": {"index": 1}}
    number = file.add("materials", name="cloth", pbrMetallicRoughness=pbr)
    file.json["meshes"][mesh]["primitives"][0]["material"] = number
    file.node(mesh=mesh, name="other")
    surface = load(file.save(tmp_path / "a.glb"), object="other").surface
    assert [material.name for material in surface.materials] == ["cloth"]
    assert surface.images == (jpeg(),)
    both = load(file.save(tmp_path / "a.glb"), merge=True).surface
    assert [material.name for material in both.materials] == ["skin", "cloth"]
    assert both.images == (png(), jpeg())
    assert both.materials[1].base_color_texture.image == 1


def test_different_materials_with_the_same_name_are_renamed(tmp_path):
    file = square_with({"name": "skin"})
    primitives = file.json["meshes"][0]["primitives"]
    other = file.add("materials", name="skin", doubleSided=True)
    primitives.append({**primitives[0], "material": other})
    surface = load(file.save(tmp_path / "a.glb")).surface
    assert surface.materials == (Material("skin"), Material("skin_1", double_sided=True))
    assert surface.groups[0].labels == ("skin", "skin_1")


@pytest.mark.parametrize(
    ("material", "label"),
    [
        ({}, None),
        ({"pbrMetallicRoughness": {"metallicFactor": 0}, "doubleSided": True}, None),
        ({"pbrMetallicRoughness": {"metallicFactor": 0}}, "material_0"),
    ],
)
def test_unnamed_material_is_kept_unless_it_is_the_default(surface_of, material, label):
    surface, _ = surface_of(square_with(material))
    assert [one.name for one in surface.materials] == ([] if label is None else [label])
    assert [group.labels for group in surface.groups] == ([] if label is None else [(label,)])


@pytest.mark.parametrize("has_colors", [False, True])
def test_faces_without_a_material_are_gray_in_stock_viewers_unless_they_have_colors(
    tmp_path, has_colors
):
    colors = Attribute("color", Kind.COLOR, Domain.VERTEX, np.full((4, 3), 90, np.uint8))
    surface = Surface(attributes=(colors,) if has_colors else ())
    sequence = meshreel.MeshSequence(
        np.array(SQUARE, np.float32)[np.newaxis], np.reshape(SQUARE_FACES, (-1, 3)), surface=surface
    )
    file = tmp_path / "a.glb"
    save(sequence, file)
    [material] = Glb.read(file.read_bytes()).document["materials"]
    look = material["pbrMetallicRoughness"]
    gray = {"baseColorFactor": [0.456, 0.456, 0.456, 1.0], "roughnessFactor": 0.4}
    assert look == {"metallicFactor": 0.0} | ({} if has_colors else gray)
    assert load(file).surface.materials == ()


def test_image_types_of_extensions_round_trip(tmp_path):
    webp = Image("w", "image/webp", b"RIFF....WEBPVP8 ")
    pbr = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    file = square_with({"name": "skin", **pbr}, images=(webp, jpeg()))
    extension = {"EXT_texture_webp": {"source": 0}}
    file.json["textures"][0] = {"extensions": extension}
    file.json["extensionsRequired"] = ["EXT_texture_webp"]
    sequence = load(file.save(tmp_path / "a.glb"))
    assert sequence.surface.images == (webp,)
    again = written(tmp_path, sequence).document
    assert again["textures"] == [{"extensions": extension}]
    assert again["extensionsRequired"] == ["EXT_texture_webp"]


def sheet_with_changed_material(**changes):
    """Return a sheet with changes to its material "red"."""
    sheet = dressed_sheet()
    (red, cloth), images = look()
    surface = replace(sheet.surface, materials=(replace(red, **changes), cloth), images=images)
    return sheet.replace(surface=surface)


@pytest.mark.parametrize(
    ("changes", "note"),
    [
        ({"metallic": 2.0}, "metallic or roughness of material 'red' is clipped to 0..1"),
        (
            {"metallic_texture": Texture(0, "st", "r")},
            "left out: the metallic and roughness textures of material 'red': glTF stores them in "
            "the blue and green channels of one image",
        ),
        (
            {"base_color_texture": Texture(0, "st", "rgb")},
            "the base color texture of material 'red' keeps its alpha channel, as glTF requires",
        ),
        (
            {"occlusion_texture": Texture(0, "st", "a")},
            "left out: the occlusion texture of material 'red': glTF uses channel r, not a",
        ),
        (
            {"normal_texture": Texture(0, "st", wrap_u=Wrap.BLACK)},
            "the normal texture of material 'red' wraps by clamp and repeat, not black and repeat, "
            "which glTF does not support",
        ),
        (
            {"normal_texture": Texture(0, "map")},
            "left out: the normal texture of material 'red': there are no UVs 'map'",
        ),
        ({"name": "blue"}, "left out: materials that no face uses: blue"),
    ],
)
def test_unsupported_material_properties_are_noted(tmp_path, changes, note, notes):
    written(tmp_path, sheet_with_changed_material(**changes), notes)
    assert note in notes


def test_image_of_an_unsupported_type_is_left_out_and_noted(tmp_path, notes):
    sheet = dressed_sheet()
    exr = Image("sky", "image/x-exr", b"\x76\x2f\x31\x01")
    surface = replace(sheet.surface, images=(exr, jpeg()))
    again = written(tmp_path, sheet.replace(surface=surface), notes).document
    assert [one["mimeType"] for one in again["images"]] == ["image/jpeg"]
    assert (
        "left out: the base color texture of material 'red': glTF does not support images of type "
        "image/x-exr" in notes
    )


def test_roughness_texture_is_written_alone_without_metalness(tmp_path, notes):
    file = written(
        tmp_path, sheet_with_changed_material(metallic=0.0, metallic_texture=None), notes
    )
    red = next(one for one in file.document["materials"] if one["name"] == "red")
    assert "metallicRoughnessTexture" in red["pbrMetallicRoughness"]
    assert not any("metallic" in note for note in notes)


def test_image_of_several_textures_is_written_once(tmp_path):
    file = written(tmp_path, dressed_sheets())
    assert len(file.document["images"]) == 2
    assert len(file.document["textures"]) < len(look()[0][0].textures)


def test_labels_without_materials_get_a_default_material(tmp_path):
    sheet = dressed_sheet()
    plain = sheet.replace(surface=sheet.surface.without_materials())
    write_gltf(tmp_path / "a.gltf", stream_of(plain), WriteOptions())
    result = load(tmp_path / "a.gltf").surface
    assert {(material.metallic, material.double_sided) for material in result.materials} == {
        (0.0, True)
    }
    assert result.images == ()


def test_buffer_views_after_an_image_of_odd_size_are_aligned(tmp_path):
    file = written(tmp_path, dressed_sheet())
    assert isinstance(file, Glb)
    assert {one["byteOffset"] % 4 for one in file.document["bufferViews"]} == {0}
    assert len(jpeg().data) % 4 != 0


@pytest.mark.damaged
@pytest.mark.slow
def test_load_raises_only_our_errors_for_changed_materials(tmp_path):
    transform = {"KHR_texture_transform": {"offset": [1, 2], "rotation": 1, "scale": [1, 1]}}
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 2}}
    file = square_with({"name": "skin", **FACTORS, "extensions": strength})
    file.json["materials"][0]["normalTexture"]["extensions"] = transform
    looks = {key: file.json[key] for key in ("materials", "textures", "images", "samplers")}
    cases = [(path, value) for path in places(looks) for value in (*ODD, DELETED)]
    rng, n_read, other = np.random.default_rng(2), 0, Gltf()
    other.data = file.data
    n_tried = draws(400)
    for number in rng.choice(len(cases), n_tried, replace=False):
        other.json = {**file.json, **changed(looks, *cases[number])}
        with contextlib.suppress(MeshReelError):
            n_read += load(other.save(tmp_path / "a.glb")).n_faces == 2
    assert n_read > 3 * n_tried // 4


def test_material_with_infinite_emission_is_left_out(surface_of):
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 1e308}}
    material = {"name": "skin", "emissiveFactor": [10, 0, 0], "extensions": strength}
    surface, notes = surface_of(square_with(material))
    note = notes[-1]
    assert surface.materials == ()
    assert "its emissive strength of 1e+308 is too large" in note


def test_images_that_share_too_many_bytes_are_left_out(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.formats.gltf.document.MIN_EXPANDED_BYTES", 300)
    monkeypatch.setattr("meshreel.formats.gltf.document.MAX_EXPANSION", 0)
    surface, notes = read(square_with({"name": "skin", **FACTORS}), tmp_path)
    assert surface.images == (png(),)
    assert notes[0].startswith(
        "left out: texture images: image 1: the arrays of the file would need"
    )


def test_image_bytes_with_several_references_are_read_once(tmp_path):
    file = square_with({"name": "skin", **FACTORS})
    file.json["images"][1]["bufferView"] = file.json["images"][0]["bufferView"]
    assert read(file, tmp_path)[0].images == (png(),)


GLOSSINESS = "KHR_materials_pbrSpecularGlossiness"
CONVERTED = (
    "converted from specular-glossiness to metallic-roughness, without specular colors: skin"
)


def glossy_square(extension, **material):
    file = Gltf()
    uv = file.accessor(np.array(SQUARE)[:, :2])
    mesh = file.mesh(SQUARE, SQUARE_FACES, attributes={"TEXCOORD_0": uv})
    material = {"name": "skin", "extensions": {GLOSSINESS: extension}, **material}
    file.json["meshes"][mesh]["primitives"][0]["material"] = file.add("materials", **material)
    file.node(mesh=mesh)
    file.add("images", bufferView=file.view(png().data), mimeType="image/png")
    file.add("textures", source=0)
    file.json["extensionsRequired"] = [GLOSSINESS]
    return file


def read_square(tmp_path, *extensions, **material):
    notes = []
    loaded = load(glossy_square(*extensions, **material).save(tmp_path / "a.glb"), notes=notes)
    return loaded.surface.materials[0], notes


def test_load_converts_a_material_and_keeps_its_diffuse_texture(tmp_path):
    extension = {
        "diffuseFactor": [0.1, 0.2, 0.3, 1],
        "specularFactor": [1.0, 0.766, 0.336],
        "glossinessFactor": 0.75,
        "diffuseTexture": {"index": 0},
    }
    result, notes = read_square(tmp_path, extension, doubleSided=True)
    assert (result.metallic, result.roughness) == (0, 0.25)
    assert result.base_color == (0.1, 0.2, 0.3, 1)
    assert result.base_color_texture.channels == "rgba"
    assert result.double_sided
    assert notes == [CONVERTED, "left out: specularFactor: skin"]


def test_material_with_a_texture_of_glossiness_is_matte(tmp_path):
    result, notes = read_square(tmp_path, {"specularGlossinessTexture": {"index": 0}})
    assert (result.metallic, result.roughness) == (0, 1)
    assert notes == [
        CONVERTED,
        "left out: other images: image 0",
        "left out: specularGlossinessTexture: skin",
    ]


def test_metallic_roughness_has_precedence_over_the_extension(tmp_path):
    result, notes = read_square(tmp_path, {}, pbrMetallicRoughness={"roughnessFactor": 0.7})
    assert (result.metallic, result.roughness) == (1, 0.7)
    assert f"left out: {GLOSSINESS}: skin" in notes
