"""Textures of raw frames in images or a video, and the files that baked ones are written to."""

import wave

import numpy as np
import pytest
from PIL import Image as PillowImage

import meshreel
from meshreel import FormatError, InvalidInputError
from meshreel.kernel.mp4 import reel_box
from meshreel.model.notes import Notes
from meshreel.operations.textures import TextureJob, open_textures
from meshreel.registration.options import RegisterOptions
from meshreel.rendering.films import write_mp4
from samples.captures import capture, textured_capture

STREAM = meshreel.encode(meshreel.simulate_flag(3))


@pytest.fixture(scope="module")
def raw():
    return textured_capture(3)


@pytest.fixture(scope="module")
def folder(raw, tmp_path_factory):
    folder = tmp_path_factory.mktemp("textures")
    for number, image in enumerate(raw[1]):
        image.save(folder / f"frame_{number + 8}.png")  # 8, 9, 10: natural order differs
    return folder


def job_of(frames, texture, output, notes=None, **given):
    options = RegisterOptions(texture=texture, texture_output=output, **given)
    return TextureJob.checked(options, frames, Notes() if notes is None else notes)


@pytest.mark.parametrize("as_source", [str, lambda item: f"{item}/*.png", lambda item: item])
def test_images_are_read_in_natural_order(as_source, raw, folder):
    textures = open_textures(as_source(folder))
    assert (textures.n_frames, textures.size) == (3, (128, 128))
    for result, given in zip(textures.images(), raw[1], strict=True):
        assert np.array_equal(result, given)


@pytest.mark.slow
def test_register_writes_images_of_each_frame(raw, folder, tmp_path):
    output = tmp_path / "new" / "baked_%02d.png"
    sequence = meshreel.register(raw[0], tolerance=0.5, texture=folder, texture_output=output)
    assert sequence.n_segments == 1
    files = sorted(path.name for path in output.parent.iterdir())
    assert files == ["baked_00.png", "baked_01.png", "baked_02.png"]
    with pytest.raises(InvalidInputError, match="already exists"):
        meshreel.register(raw[0], tolerance=0.5, texture=folder, texture_output=output)


@pytest.mark.slow
def test_videos_are_read_and_written(raw, folder, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    given, images, written = (tmp_path / name for name in ("raw.mp4", "%d.png", "baked.mp4"))
    write_mp4(raw[1], given, (128, 128), fps=25)
    for texture, output in ((folder, images), (given, written)):
        meshreel.register(raw[0], tolerance=0.5, texture=texture, texture_output=output)
    exact, video = open_textures(f"{tmp_path}/*.png"), open_textures(written)
    assert (video.n_frames, video.size) == (3, (128, 128))
    for result, expected in zip(video.images(), exact.images(), strict=True):
        assert np.abs(np.asarray(result, int) - expected).mean() < 8


@pytest.mark.parametrize(
    ("seconds", "note"),
    [(0.14, None), (0.5, "lasts 0.50 s, and the take 0.12 s: its end is left out"),
     (0.05, "lasts 0.05 s, and the take 0.12 s: the end is silent")],
)  # fmt: skip
def test_sound_is_stored_with_the_video(seconds, note, raw, folder, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    notes, take, first, second = Notes(), *(tmp_path / name for name in ("a.wav", "b.mp4", "c.mp4"))
    with wave.open(str(take), "wb") as file:
        file.setparams((2, 2, 44100, 0, "NONE", ""))
        file.writeframes(np.zeros((round(44100 * seconds), 2), "<i2").tobytes())
    for sound, output, codec in ((take, first, "aac"), (first, second, "copy")):
        job = job_of(raw[0], folder, output, notes, sound=sound)
        assert codec in job.sound
        write_mp4(raw[1], output, (128, 128), 25, sound=job.sound, appended=reel_box(STREAM))
        video, track = meshreel.info(output).media
        assert (video.codec, track.codec) == ("avc1", "mp4a")
        assert track.duration_s == pytest.approx(min(seconds, 0.12), abs=0.05)
    assert [note.split(" ", 1)[1] for note in notes][:1] == ([note] if note else [])


def test_sound_needs_a_video_and_a_file_with_sound(raw, folder, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    take = folder / "frame_8.png"
    with pytest.raises(InvalidInputError, match=r"stored in a video of textures \(\.mp4\)"):
        job_of(raw[0], folder, tmp_path / "%d.png", sound=take)
    with pytest.raises(FormatError, match=r"frame_8\.png: is not a file with sound"):
        job_of(raw[0], folder, tmp_path / "walk.mp4", sound=take)


def test_a_video_of_an_odd_size_becomes_even(raw, tmp_path):
    pytest.importorskip("imageio_ffmpeg")
    images = [tmp_path / f"{number}.png" for number in range(3)]
    for image, path in zip(raw[1], images, strict=True):
        image.resize((63, 65)).save(path)
    job = job_of(raw[0], images, tmp_path / "walk.mp4")
    assert job.size == (64, 66)


@pytest.mark.parametrize(
    ("source", "output", "message"),
    [
        ("frame_8.png", "a_%d.png", "there are 1 texture for 3 frames"),
        ("*.jpg", "a_%d.png", "contains no texture images"),
        ("missing.png", "a_%d.png", "there is no texture"),
        ("*.png", "a.png", "name a video .*, or images by a pattern"),
        ("*.png", "a_%d.mp4", "name a video .*, or images by a pattern"),
        ("*.png", "a_%d.tga", "must end in .mp4, .png"),
    ],
)
def test_textures_that_do_not_fit_are_errors(source, output, message, raw, folder):
    with pytest.raises((InvalidInputError, FormatError), match=message):
        job_of(raw[0], str(folder / source), folder / output)


def test_several_images_per_frame_are_an_error(raw, folder, tmp_path):
    images = [folder / f"frame_{number}.png" for number in (8, 8, 9, 9, 10, 10)]
    with pytest.raises(InvalidInputError, match=r"6 textures for 3 frames; .* combine the"):
        job_of(raw[0], images, tmp_path / "%d.png")


def test_inputs_are_never_replaced(raw, tmp_path):
    raw[1][0].save(tmp_path / "frame_2.png")
    images = [tmp_path / "frame_2.png"] * 3
    with pytest.raises(InvalidInputError, match="is the input"):
        job_of(raw[0], images, tmp_path / "frame_%d.png", overwrite=True)


@pytest.mark.slow
def test_files_that_are_not_images_are_errors(raw, tmp_path):
    for name in ("mesh.obj", "film.mp4"):
        (tmp_path / name).write_text("v 0 0 0")
        with pytest.raises(FormatError, match=r"is (neither an image|not a video)"):
            open_textures(tmp_path / name)


def test_frames_need_texture_coordinates(folder, tmp_path):
    with pytest.raises(InvalidInputError, match="frame 0 has no texture coordinates"):
        meshreel.register(capture(3), texture=folder, texture_output=tmp_path / "%d.png")


def test_textures_need_an_output(raw, folder):
    with pytest.raises(InvalidInputError, match="belong together"):
        meshreel.register(raw[0], texture=folder)


@pytest.mark.slow
def test_grayscale_images_are_baked_as_rgb(raw, tmp_path):
    images = [tmp_path / f"{number}.png" for number in range(3)]
    for path in images:
        PillowImage.new("L", (64, 64), 90).save(path)
    output = tmp_path / "baked_%d.png"
    meshreel.register(raw[0], tolerance=0.5, texture=images, texture_output=output)
    with PillowImage.open(tmp_path / "baked_1.png") as baked:
        assert baked.getcolors() == [(64 * 64, (90, 90, 90))]
