"""Images of materials: re-encoded, scaled down or kept, and the notes on them."""

import io
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image as Pillow

import meshreel
from meshreel.codec.images import reencode_images
from meshreel.codec.options import config_of
from meshreel.errors import InvalidInputError
from meshreel.model.materials import AlphaMode, Image, Material, Texture
from meshreel.model.notes import Notes
from meshreel.operations.encoding import encode_and_measure
from samples.materials import jpeg, png
from samples.meshes import quad_sheet


def file_of(pixels, name, kind="png", **settings):
    """Return pixels as an image of a material."""
    buffer = io.BytesIO()
    picture = pixels if isinstance(pixels, Pillow.Image) else Pillow.fromarray(pixels)
    picture.save(buffer, kind, **settings)
    return Image(name, f"image/{kind}", buffer.getvalue())


def pixels_of(image):
    with Pillow.open(io.BytesIO(image.data)) as picture:
        return np.asarray(picture)


def painted(side=96):
    """Return a photo-like image with opacity, and a map of normals with coarse noise."""
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(*2 * [np.linspace(0, 1, side)])
    waves = np.stack([np.sin(9 * x), np.cos(7 * y), np.sin(5 * x * y), x > y], axis=-1)
    colors = (127 + 100 * waves + rng.normal(0, 6, waves.shape)).clip(0, 255).astype(np.uint8)
    normals = rng.normal((0, 0, 2), 0.5, (side, side, 3))
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return colors, np.rint(127.5 * (normals + 1)).astype(np.uint8)


COLORS, NORMALS = painted()
TURNED = Pillow.Exif()
TURNED[274] = 6
CHECKS = np.indices((64, 64)).sum(axis=0).astype(np.uint8) % 2 * 255


def sheet(*images, slots=("base_color", "normal")):
    """Return a sheet whose material has an image in each of these slots."""
    textures = {
        slot: Texture(number, "st", "g" if slot == "roughness" else "rgb")
        for number, slot in enumerate(slots[: len(images)])
    }
    look = Material("red", alpha_mode=AlphaMode.BLEND).with_textures(textures)
    base = quad_sheet(4)
    surface = replace(base.surface, materials=(look,), images=images)
    return base.replace(surface=surface)


def painted_sheet():
    return sheet(file_of(COLORS, "skin"), file_of(NORMALS, "bumps"))


def reencoded(sequence, images=None, max_image=None):
    """Return the images of a sequence after re-encoding, and the notes."""
    notes = Notes()
    change = reencode_images([sequence.surface], images, max_image, notes)
    return change(sequence.surface).images, notes


def test_colors_become_lossy_and_opacity_and_data_stay_exact():
    sequence = painted_sheet()
    decoded = meshreel.decode(meshreel.encode(sequence, images="webp:90")).surface
    skin, bumps = decoded.images
    assert [(one.name, one.mime_type) for one in (skin, bumps)] == [
        ("skin", "image/webp"), ("bumps", "image/webp"),
    ]  # fmt: skip
    errors = np.abs(pixels_of(skin).astype(int) - COLORS)
    assert 0 < errors[..., :3].mean() < 6
    assert not errors[..., 3].any()
    assert np.array_equal(pixels_of(bumps), NORMALS)
    assert decoded.materials == sequence.surface.materials


def test_quality_and_size_follow_the_option():
    sizes = []
    for images in ("webp:30", "webp", "webp:80", "webp:95", "webp:lossless"):
        (skin, _), notes = reencoded(painted_sheet(), images)
        sizes.append(len(skin.data))
        assert [note for note in notes if "2 images re-encoded as image/webp, those" in note]
    assert sizes[1] == sizes[2]
    assert sizes == sorted(sizes)
    assert np.array_equal(pixels_of(skin), COLORS)


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (jpeg(), "Pillow cannot read them"),
        (Image("gpu", "image/ktx2", b"KTX 20"), "image/ktx2"),
        (file_of(COLORS[..., 0].astype(np.uint16), "deep"), "16 bits per channel"),
        (file_of(COLORS[..., :3], "old", "webp", quality=80), "would not make them smaller"),
        (file_of(COLORS[..., :3], "turned", exif=TURNED), "turned by EXIF"),
        (file_of(Pillow.fromarray(COLORS[..., :3]).convert("CMYK"), "ink", "jpeg"), "type CMYK"),
    ],
)  # fmt: skip
def test_images_that_cannot_become_smaller_are_kept_with_a_note(image, reason):
    (kept,), notes = reencoded(sheet(image), "webp:95")
    assert kept is image
    assert [note for note in notes if f"kept as they are: {image.name}" in note and reason in note]


def test_a_jpeg_is_kept_where_a_png_is_larger():
    photo = file_of(COLORS[..., :3], "photo", "jpeg", quality=30)
    assert reencoded(sheet(photo), "png")[0] == (photo,)


def test_scaling_averages_light_and_keeps_normals_of_unit_length():
    gray = np.repeat(CHECKS[..., None], 3, axis=2)
    sequence = sheet(file_of(gray, "checks"), file_of(NORMALS, "bumps"))
    (checks, bumps), _ = reencoded(sequence, max_image=16)
    assert pixels_of(checks).shape == pixels_of(bumps).shape == (16, 16, 3)
    assert np.abs(pixels_of(checks)[4:-4, 4:-4].astype(int) - 188).max() < 8  # half the light
    lengths = np.linalg.norm(pixels_of(bumps) / 127.5 - 1, axis=-1)
    assert np.abs(lengths - 1).max() < 0.02
    data = sheet(file_of(gray, "rough"), slots=("roughness",))
    (rough,), _ = reencoded(data, max_image=16)
    assert np.abs(pixels_of(rough)[4:-4, 4:-4].astype(int) - 128).max() < 8


@pytest.mark.parametrize(("kind", "expected"), [("png", "png"), ("jpeg", "jpeg"), ("bmp", "png")])
def test_scaled_images_keep_shape_and_type(kind, expected):
    image = file_of(COLORS[:48, :, :3], "skin", kind)
    (small,), _ = reencoded(sheet(image), max_image=40)
    assert small.mime_type == f"image/{expected}"
    assert pixels_of(small).shape == (20, 40, 3)
    (same,), notes = reencoded(sheet(image), max_image=96)
    assert same is image
    assert "at most 96 pixels wide and high" in notes[0]


def test_png_for_other_programs_is_written_although_it_is_larger():
    webp = file_of(COLORS[..., :3], "skin", "webp", quality=50)
    (skin,), notes = reencoded(sheet(webp), "png")
    assert skin.mime_type == "image/png"
    assert np.array_equal(pixels_of(skin), pixels_of(webp))
    assert "1 image re-encoded as image/png: " in notes[0]


def test_palettes_with_a_transparent_color_keep_it():
    palette = Pillow.fromarray(COLORS[..., :3]).quantize(16)
    buffer = io.BytesIO()
    palette.save(buffer, "png", transparency=3)
    (skin,), _ = reencoded(sheet(Image("p", "image/png", buffer.getvalue())), "webp:1")
    expected = np.asarray(Pillow.open(buffer).convert("RGBA"))
    assert {*np.unique(expected[..., 3])} == {0, 255}
    assert np.array_equal(pixels_of(skin)[..., 3], expected[..., 3])


@pytest.mark.parametrize("images", ["webp:0", "webp:101", "webp:high", "jpeg", "", "webp:", 80])
def test_invalid_formats_are_refused(images):
    with pytest.raises(InvalidInputError, match="images must be webp, webp:QUALITY"):
        config_of(images=images)


def test_options_without_effect_are_errors(tmp_path):
    with pytest.raises(InvalidInputError, match="no images of materials; omit images"):
        meshreel.encode(quad_sheet(4), images="webp")
    with pytest.raises(InvalidInputError, match="no images of materials; omit max_image"):
        meshreel.save(quad_sheet(4), tmp_path / "a.glb", max_image=8)
    with pytest.raises(InvalidInputError, match=r"max_image has no effect on a \.npz file"):
        meshreel.save(painted_sheet(), tmp_path / "a.npz", max_image=8)
    with pytest.raises(InvalidInputError, match="max_image must be a whole number of at least 1"):
        meshreel.save(painted_sheet(), tmp_path / "a.glb", max_image=0)


def test_missing_pillow_is_an_error_before_the_work(monkeypatch, tmp_path):
    sequence = painted_sheet()
    monkeypatch.setitem(sys.modules, "PIL", None)
    for act in (
        lambda: config_of(images="webp"),
        lambda: meshreel.save(sequence, tmp_path / "a.glb", max_image=8),
    ):
        with pytest.raises(InvalidInputError, match=r"pip install 'meshreel\[images\]'"):
            act()


def test_live_frames_and_segments_share_the_options(tmp_path):
    sequence = painted_sheet()
    path = tmp_path / "live.reel"
    with meshreel.Encoder(
        sequence.faces, path, surface=sequence.surface, images="webp", max_image=48
    ) as live:
        for frame in sequence.vertices:
            live.push(frame)
    with meshreel.open(path) as reel:
        skin, _ = reel.surface.images
    assert pixels_of(skin).shape == (48, 48, 4)
    assert skin.mime_type == "image/webp"


@pytest.mark.parametrize("extension", ["glb", "usda", "reel"])
def test_saved_files_have_the_images_and_say_so(tmp_path, extension):
    notes = []
    path = tmp_path / f"a.{extension}"
    meshreel.save(painted_sheet(), path, images="webp", notes=notes)
    read = meshreel.load(path).surface
    assert {image.mime_type for image in read.images} == {"image/webp"}
    text = "\n".join(notes)
    assert "2 images re-encoded as image/webp, those with other values than colors" in text
    assert ("EXT_texture_webp" in text) == (extension == "glb")
    assert ("USD may not show image/webp; for PNG use images" in text) == (extension == "usda")


def test_encoding_says_what_images_cost_and_how_to_shrink_them():
    def notes_of(sequence, **options):
        notes = Notes()
        encode_and_measure(sequence, config_of(**options), None, notes)
        return [note for note in notes if "image" in note]

    [note] = notes_of(painted_sheet())
    assert note.startswith("images are 9")
    assert 'images="webp" compresses them' in note
    [note] = notes_of(painted_sheet(), images="webp")
    assert note.startswith("2 images re-encoded")
    assert notes_of(sheet(png())) == []
