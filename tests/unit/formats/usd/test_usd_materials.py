"""Materials of USD files, read and written, and notes on unsupported properties."""

import contextlib
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdShade

import meshreel
from meshreel.errors import InvalidInputError, MeshReelError
from meshreel.formats.load import load
from meshreel.model.materials import AlphaMode, Image, Material, Texture, Wrap
from meshreel.operations.save import save
from samples.costs import draws
from samples.materials import dressed_sheet, dressed_sheets, jpeg, look, png
from samples.usd import assert_is_valid

EXTENSIONS = ["usd", "usda", "usdc", "usdz"]


def as_usd(material):
    """Return a material of the samples with the properties that USD can store."""
    textures = {
        slot: replace(texture, magnified=None, shrunk=None)
        for slot, texture in material.textures.items()
    }
    if material.alpha_mode is AlphaMode.OPAQUE and "base_color" in textures:
        textures["base_color"] = replace(textures["base_color"], channels="rgb")
    return replace(material.with_textures(textures), unlit=False, double_sided=True)


def assert_same_look(found, expected):
    """Images are equal, and materials are equal except for rounding to float32."""
    assert found.images == expected.images
    assert [material.name for material in found.materials] == [
        material.name for material in expected.materials
    ]
    for one, other in zip(found.materials, map(as_usd, expected.materials), strict=True):
        assert rounded(one) == rounded(other)


def rounded(value):
    """Return a value with its numbers rounded to 6 digits, for comparison."""
    if isinstance(value, float):
        return float(np.round(value, 6)) + 0.0
    if isinstance(value, tuple):
        return tuple(map(rounded, value))
    if isinstance(value, Material | Texture):
        return type(value), {name: rounded(var) for name, var in vars(value).items()}
    return value


def without_mipmaps():
    """A sheet whose texture has a filter only where it is magnified."""
    sheet, (red, cloth) = dressed_sheet(), look()[0]
    cloth = replace(cloth, base_color_texture=replace(cloth.base_color_texture, shrunk=None))
    return sheet.replace(surface=replace(sheet.surface, materials=(red, cloth)))


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("make", [dressed_sheet, dressed_sheets, without_mipmaps])
def test_materials_round_trip(tmp_path, make, extension, notes):
    sequence = make()
    save(sequence, tmp_path / f"x.{extension}", notes=notes)
    loaded = load(tmp_path / f"x.{extension}", merge=True)
    assert_same_look(loaded.surface, sequence.surface)
    left_out = [note for note in notes if note.startswith("left out")]
    assert left_out == [
        "left out: single-sidedness of materials on meshes with double-sided ones: gr\u00fcn",
        "left out: texture filters, which USD cannot store: gr\u00fcn",
        "left out: unlit shading of materials, which USD cannot store: gr\u00fcn",
    ]


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_materials_pass_every_validator_of_usd(tmp_path, extension):
    sequence = dressed_sheets()
    red, cloth = look()[0]
    # A validator rejects scaled normals.
    materials, images = (replace(red, normal_scale=1.0), cloth), (png(), png(64, "dark"))
    surface = replace(sequence.surface, materials=materials, images=images)
    save(sequence.replace(surface=surface), tmp_path / f"x.{extension}")
    assert_is_valid(tmp_path / f"x.{extension}")


def test_package_contains_unchanged_images(tmp_path):
    save(dressed_sheet(), tmp_path / "x.usdz")
    with zipfile.ZipFile(tmp_path / "x.usdz") as package:
        infos = package.infolist()
        data = {info.filename: package.read(info) for info in infos}
    assert {info.compress_type for info in infos} == {zipfile.ZIP_STORED}
    assert data["textures/shade.png"] == png().data
    assert data["textures/photo.jpg"] == jpeg().data
    assert [path.name for path in tmp_path.iterdir()] == ["x.usdz"]


@pytest.mark.parametrize("extension", ["usd", "usda", "usdc"])
def test_images_are_next_to_a_file_that_cannot_contain_them(tmp_path, extension):
    paths = save(dressed_sheet(), tmp_path / f"x.{extension}")
    folder = tmp_path / "x_textures"
    assert paths == [tmp_path / f"x.{extension}", folder / "shade.png", folder / "photo.jpg"]
    assert (folder / "shade.png").read_bytes() == png().data
    assert sorted(tmp_path.iterdir()) == [tmp_path / f"x.{extension}", folder]
    assert sorted(folder.iterdir()) == sorted(paths[1:])


def test_existing_images_are_not_replaced_without_overwrite(tmp_path):
    (tmp_path / "x_textures").mkdir()
    kept = tmp_path / "x_textures" / "photo.jpg"
    kept.write_bytes(b"mine")
    with pytest.raises(InvalidInputError, match=r"photo\.jpg already exists; use overwrite=True"):
        save(dressed_sheet(), tmp_path / "x.usda")
    assert kept.read_bytes() == b"mine"
    assert sorted(tmp_path.rglob("*")) == [tmp_path / "x_textures", kept]
    save(dressed_sheet(), tmp_path / "x.usda", overwrite=True)
    assert kept.read_bytes() == jpeg().data


def test_failed_save_leaves_no_folder(tmp_path, monkeypatch):
    def fail(*_, **__):
        raise OSError("no space")

    monkeypatch.setattr("meshreel.formats.usd.rigged.write_frames", fail)
    with pytest.raises(OSError, match="no space"):
        save(dressed_sheet(), tmp_path / "x.usdc")
    assert list(tmp_path.iterdir()) == []


def test_no_image_folder_without_images(tmp_path):
    sheet = dressed_sheet()
    save(sheet.replace(surface=sheet.surface.without_materials()), tmp_path / "x.usda")
    assert [path.name for path in tmp_path.iterdir()] == ["x.usda"]


def test_images_get_valid_unique_file_names(tmp_path):
    sheet = dressed_sheet()
    images = (replace(png(), name="a/../b c"), replace(png(9), name="a/../B C"))
    surface = replace(sheet.surface, images=images)
    paths = save(sheet.replace(surface=surface), tmp_path / "x.usda")
    assert [path.name for path in paths[1:]] == ["a_b_c.png", "a_B_C_2.png"]
    assert [image.data for image in load(paths[0]).surface.images] == [
        image.data for image in images
    ]


def test_shading_network_is_what_viewers_expect(tmp_path):
    save(dressed_sheet(), tmp_path / "x.usda")
    stage = Usd.Stage.Open(str(tmp_path / "x.usda"))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/sheet/sheet"))
    assert mesh.GetDoubleSidedAttr().Get() is True
    subset = UsdGeom.Subset.GetAllGeomSubsets(mesh)[0].GetPrim()
    material, _ = UsdShade.MaterialBindingAPI(subset).ComputeBoundMaterial()
    shader, _, _ = material.ComputeSurfaceSource()
    color, opacity = (
        shader.GetInput(name).GetValueProducingAttributes()[0]
        for name in ("diffuseColor", "opacity")
    )
    assert (color.GetName(), opacity.GetName()) == ("outputs:rgb", "outputs:a")
    texture = UsdShade.Shader(color.GetPrim())
    values = {GetInput.GetBaseName(): GetInput.Get() for GetInput in texture.GetInputs()}
    assert values["file"].path == "./x_textures/shade.png"
    assert values["sourceColorSpace"] == "sRGB"
    assert (values["wrapS"], values["wrapT"]) == ("clamp", "mirror")
    assert tuple(values["scale"]) == (1.0, 0.5, 0.25, 0.75)
    assert shader.GetInput("opacityThreshold").Get() == 0.25


def test_transformed_uvs_of_usd_match_those_of_gltf(tmp_path):
    """The formula of glTF, with v downward, and the transform of USD, with v upward, agree."""
    save(dressed_sheet(), tmp_path / "x.usda")
    stage = Usd.Stage.Open(str(tmp_path / "x.usda"))
    (prim,) = [one for one in stage.Traverse() if one.GetName() == "base_color_texture_transform"]
    inputs = {
        GetInput.GetBaseName(): GetInput.Get() for GetInput in UsdShade.Shader(prim).GetInputs()
    }
    angle = np.radians(inputs["rotation"])
    texture = look()[0][1].base_color_texture
    for u, v in ((0.25, 0.75), (0.0, 0.0), (1.0, 0.5)):
        x, y = np.multiply((u, v), inputs["scale"])
        moved = np.array(
            [np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y]
        )
        moved = moved + inputs["translation"]
        x, y = np.multiply((u, 1 - v), texture.scale)
        sine, cosine = np.sin(texture.rotation), np.cos(texture.rotation)
        expected = np.array([cosine * x + sine * y, -sine * x + cosine * y]) + texture.offset
        np.testing.assert_allclose(moved, [expected[0], 1 - expected[1]], atol=1e-6)


@pytest.mark.parametrize("extension", ["usda", "usdz"])
def test_packages_leave_out_unsupported_image_types(tmp_path, extension, notes):
    sheet = dressed_sheet()
    tga = Image("old", "image/x-tga", b"\x00\x00\x02")
    changed = sheet.replace(surface=replace(sheet.surface, images=(tga, jpeg())))
    save(changed, tmp_path / f"x.{extension}", notes=notes)
    result = load(tmp_path / f"x.{extension}").surface
    assert (tga in result.images) == (extension == "usda")
    note = "left out: textures that USD cannot store (packages do not support image/x-tga): red"
    assert (note in notes) == (extension == "usdz")
    if extension == "usdz":
        with zipfile.ZipFile(tmp_path / "x.usdz") as package:
            assert not any(name.endswith(".tga") for name in package.namelist())


NETWORK = """#usda 1.0
(
    defaultPrim = "a"
)
def Xform "a"
{{
    def Mesh "m" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {{
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (0, 1)] ( interpolation = "vertex" )
        rel material:binding = </a/skin>
        {mesh}
    }}
    def Material "skin"
    {{
        token inputs:uv = "st"
        token outputs:surface.connect = </a/skin/surface.outputs:surface>
        def Shader "surface"
        {{
            uniform token info:id = "UsdPreviewSurface"
            {surface}
            token outputs:surface
        }}
        def Shader "reader"
        {{
            uniform token info:id = "UsdPrimvarReader_float2"
            token inputs:varname.connect = </a/skin.inputs:uv>
            float2 outputs:result
        }}
        def Shader "image"
        {{
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @{file}@
            float2 inputs:st.connect = </a/skin/reader.outputs:result>
            {texture}
            float outputs:r
            float outputs:a
            float3 outputs:rgb
        }}
    }}
}}
"""
COLOR = "color3f inputs:diffuseColor.connect = </a/skin/image.outputs:rgb>"


@pytest.fixture
def read(tmp_path):
    """A function that returns surface and notes of a stage of one triangle with a material."""

    def get(surface="", *, texture="", mesh="", file="./skin.png"):
        folder = tmp_path / "in"
        folder.mkdir(exist_ok=True)
        (folder / "skin.png").write_bytes(png().data)
        (tmp_path / "out.png").write_bytes(png().data)
        text = NETWORK.format(surface=surface, texture=texture, mesh=mesh, file=file)
        (folder / "x.usda").write_text(text)
        notes = []
        return load(folder / "x.usda", notes=notes).surface, notes

    return get


def test_missing_inputs_have_the_defaults_of_the_standard(read):
    surface, notes = read()
    assert [rounded(material) for material in surface.materials] == [
        rounded(Material("skin", (0.18, 0.18, 0.18, 1.0), 0.0, 0.5))
    ]
    assert notes == [
        "left out: Shader prims: /a/skin/image, /a/skin/reader",
        "left out: inputs of materials: uv",
    ]


def test_texture_is_found_through_the_interface_of_its_material(read):
    surface, notes = read(COLOR)
    texture = Texture(0, "st", "rgb", Wrap.METADATA, Wrap.METADATA)
    assert surface.materials[0].base_color_texture == texture
    assert surface.materials[0].base_color == (1.0, 1.0, 1.0, 1.0)
    assert surface.images == (Image("skin", "image/png", png().data),)
    assert notes == []


def test_material_is_double_sided_like_its_mesh(read):
    assert read(mesh="uniform bool doubleSided = 1")[0].materials[0].double_sided


@pytest.mark.parametrize(
    ("opacity", "mode"),
    [
        ("float inputs:opacity = 1", AlphaMode.OPAQUE),
        ("float inputs:opacity = 0.5", AlphaMode.BLEND),
        ("float inputs:opacityThreshold = 0.25", AlphaMode.MASK),
        ("float inputs:opacity.connect = </a/skin/image.outputs:a>", AlphaMode.BLEND),
    ],
)
def test_alpha_mode_follows_from_opacity(read, opacity, mode):
    surface, notes = read(f"{COLOR}\n{opacity}")
    (result,) = surface.materials
    assert result.alpha_mode is mode
    assert result.base_color_texture.channels == ("rgba" if "connect" in opacity else "rgb")
    assert notes == []


@pytest.mark.parametrize(
    ("surface", "options", "note"),
    [
        (
            f"{COLOR}\nfloat inputs:clearcoat = 1\nfloat inputs:ior = 1.5",
            {},
            "inputs of materials: clearcoat",
        ),
        (
            COLOR,
            {"texture": "float4 inputs:fallback = (1, 0, 0, 1)"},
            "inputs of materials: fallback",
        ),
        ("float inputs:occlusion = 0.5", {}, "constant occlusion: skin"),
        ("normal3f inputs:normal = (1, 0, 0)", {}, "constant normal: skin"),
        (
            "float inputs:opacity.connect = </a/skin/image.outputs:r>",
            {},
            "opacity that is not the alpha of the color texture: skin",
        ),
        (
            f"{COLOR}\nfloat inputs:roughness.timeSamples = {{ 0: 0.5, 1: 0.75 }}",
            {},
            "changes over time, kept as in the first frame: /a/skin/surface.inputs:roughness",
        ),
        ('string inputs:roughness = "rough"', {}, "roughness must be 1 finite numbers"),
        ("float inputs:roughness = inf", {}, "roughness must be 1 finite numbers"),
        (COLOR, {"file": "./gone.png"}, "'./gone.png' does not exist"),
        (COLOR, {"file": "../out.png"}, "refers to the file '../out.png' outside its folder"),
        (COLOR, {"file": "./skin.<UDIM>.png"}, "consists of many tiles"),
        (COLOR, {"texture": 'token inputs:wrapS = "twist"'}, "wrapS is 'twist'"),
        (COLOR, {"texture": "float4 inputs:bias = (1, 0, 0, 0)"}, "bias of the texture of diff"),
        (COLOR, {"texture": 'token inputs:sourceColorSpace = "raw"'}, "color space 'raw' of"),
        (
            "float inputs:metallic.connect = </a/skin/image.outputs:rgb>",
            {},
            "the texture of metallic (it has the channels rgb): skin",
        ),
        (
            "color3f inputs:diffuseColor.connect = </a/skin/reader.outputs:result>",
            {},
            "UsdPrimvarReader_float2 is not supported",
        ),
    ],
)
def test_unsupported_material_properties_are_noted(read, surface, options, note):
    result, notes = read(surface, **options)
    assert len(result.materials) == 1
    [found] = [text for text in notes if note in text]
    assert found.startswith("left out: ")
    assert found == notes[0]


def test_material_without_preview_surface_is_only_a_label(tmp_path, notes):
    text = NETWORK.format(surface="", texture="", mesh="", file="").replace(
        '"UsdPreviewSurface"', '"ND_standard_surface"'
    )
    (tmp_path / "x.usda").write_text(text)
    surface = load(tmp_path / "x.usda", notes=notes).surface
    assert (surface.materials, surface.groups[0].labels) == ((), ("skin",))
    assert notes[0] == "left out: appearance of materials without UsdPreviewSurface: skin"


def test_load_raises_only_our_errors_for_changed_networks(tmp_path):
    (tmp_path / "skin.png").write_bytes(png().data)
    opacity = "float inputs:opacity.connect = </a/skin/image.outputs:a>"
    surface = f"{COLOR}\nfloat inputs:roughness = 0.5\n{opacity}"
    texture = 'token inputs:wrapS = "clamp"\nfloat4 inputs:scale = (1, 1, 1, 1)'
    text = NETWORK.format(surface=surface, texture=texture, mesh="", file="./skin.png").encode()
    rng, n_read = np.random.default_rng(5), 0
    start = text.index(b"def Material")
    n_tried = draws(300)
    for _ in range(n_tried):
        data = bytearray(text)
        for offset in rng.integers(start, len(data), rng.choice([1, 3])):
            data[offset] = rng.choice(np.frombuffer(b' 0-:"<>{}@.xr\xff', np.uint8))
        (tmp_path / "x.usda").write_bytes(data)
        with contextlib.suppress(MeshReelError):
            n_read += load(tmp_path / "x.usda").n_faces == 1
    assert n_read > n_tried // 15


def test_cyclic_shader_connections_are_noted(read):
    cycle = COLOR.replace("image.outputs:rgb", "reader.outputs:result")
    surface, notes = read(
        cycle, texture="float4 inputs:scale.connect = </a/skin/image.outputs:rgb>"
    )
    assert len(surface.materials) == 1
    assert "UsdPrimvarReader_float2 is not supported" in notes[0]


def test_materials_round_trip_from_glb_through_stream_and_package(tmp_path):
    sheet = dressed_sheet()
    save(sheet, tmp_path / "a.glb")
    original = load(tmp_path / "a.glb")
    save(meshreel.decode(meshreel.encode(original)), tmp_path / "b.usdz")
    packed = load(tmp_path / "b.usdz")
    save(meshreel.decode(meshreel.encode(packed)), tmp_path / "c.glb")
    result, expected = load(tmp_path / "c.glb").surface, original.surface
    assert {image.data for image in result.images} == {image.data for image in expected.images}
    by_name = {material.name: material for material in result.materials}
    for material in expected.materials:
        other = by_name[material.name]
        numbers = ("base_color", "metallic", "roughness", "emissive", "normal_scale")
        for name in (*numbers, "occlusion_strength", "alpha_cutoff"):
            np.testing.assert_allclose(getattr(other, name), getattr(material, name), rtol=1e-6)
        assert other.alpha_mode is material.alpha_mode
        assert other.textures.keys() == material.textures.keys()
        for slot, texture in material.textures.items():
            data = result.images[other.textures[slot].image].data
            assert data == expected.images[texture.image].data
