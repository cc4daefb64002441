"""Textures come back bit for bit, stand for the numbers that shaders see, and refuse all else."""

import struct
import zlib

import numpy as np
import pytest

from meshreel.errors import FormatError, InvalidInputError
from meshreel.formats.vat.textures import TexelType, read_texture, texel_type_of, write_texture

TYPES = list(TexelType)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.mark.parametrize("n_channels", [3, 4])
@pytest.mark.parametrize("found", TYPES)
def test_texture_is_read_as_written_when_of_any_type(tmp_path, rng, found, n_channels):
    texels = found.texels(rng.random((5, 7, n_channels)))
    path = tmp_path / f"a{found.ending}"
    size_bytes = write_texture(path, texels)
    back = read_texture(path)
    assert texel_type_of(back) is found
    np.testing.assert_array_equal(back, texels)
    assert size_bytes == path.stat().st_size


def test_png_has_the_top_row_first_and_its_bits_in_the_header(tmp_path):
    """Read without the library: a header, and rows of big-endian numbers behind a filter byte."""
    texels = np.array([[[1, 2, 3]], [[65535, 256, 0]]], np.uint16)
    write_texture(tmp_path / "a.png", texels)
    data = (tmp_path / "a.png").read_bytes()
    assert struct.unpack(">II5B", data[16:29]) == (1, 2, 16, 2, 0, 0, 0)
    start = data.index(b"IDAT") + 4
    rows = np.frombuffer(zlib.decompress(data[start:]), np.uint8).reshape(2, 7)
    assert rows[0, 0] in (0, 1, 2, 3, 4)
    first = rows[0, 1:]  # the first pixel of the first row is the same for all filters but Paeth
    np.testing.assert_array_equal(first.view(">u2"), texels[0, 0])


@pytest.mark.parametrize("found", [TexelType.BITS_8, TexelType.BITS_16])
def test_integer_texels_are_within_half_a_step(rng, found):
    values = np.append(rng.random(1000), [0.0, 1.0])
    steps = 255 if found is TexelType.BITS_8 else 65535
    off = np.abs(found.values(found.texels(values)) - values)
    assert off.max() <= 0.5 / steps + 1e-12
    assert off[-2:].max() == 0.0


def test_half_texels_are_within_half_a_unit_in_the_last_place(rng):
    values = rng.standard_normal(1000) * 1000
    off = np.abs(TexelType.HALF.values(TexelType.HALF.texels(values)) - values)
    assert np.all(off <= np.spacing(np.abs(values).astype(np.float16)).astype(float) / 2 + 1e-9)


@pytest.mark.parametrize(
    ("found", "values", "said"),
    [
        (TexelType.BITS_8, [0.5, 1.1], "from 0 to 1"),
        (TexelType.BITS_16, [-0.1], "from 0 to 1"),
        (TexelType.HALF, [70000.0], "65504"),
        (TexelType.FLOAT, [1e39], "float EXR"),
        (TexelType.FLOAT, [np.nan], "finite"),
        (TexelType.HALF, [np.inf], "finite"),
    ],
)
def test_numbers_that_a_type_cannot_hold_are_refused(found, values, said):
    with pytest.raises(InvalidInputError, match=said):
        found.texels(np.array(values))


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 2), (0, 4, 3), (4, 0, 3)])
def test_arrays_that_are_no_texture_are_refused(tmp_path, shape):
    with pytest.raises(InvalidInputError, match="a texture has shape"):
        write_texture(tmp_path / "a.png", np.zeros(shape, np.uint8))
    with pytest.raises(InvalidInputError, match="textures hold uint8"):
        write_texture(tmp_path / "a.png", np.zeros((2, 2, 3), np.int32))
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize("found", [TexelType.BITS_16, TexelType.HALF])
def test_damaged_files_are_refused_with_their_name(tmp_path, rng, found):
    path = tmp_path / "broken"
    write_texture(path, found.texels(rng.random((64, 64, 3))))
    data = path.read_bytes()
    for kept in (0, 3, 20, len(data) // 2):
        path.write_bytes(data[:kept])
        with pytest.raises(FormatError, match="broken"):
            read_texture(path)


@pytest.mark.parametrize("found", TYPES)
def test_file_that_cannot_be_written_is_an_error_of_the_system_that_names_it(tmp_path, found):
    path = tmp_path / "missing" / "a"
    with pytest.raises(OSError, match="No such file or directory") as raised:
        write_texture(path, found.texels(np.zeros((4, 4, 3))))
    assert raised.value.filename == str(path)


def test_video_memory_has_four_channels_when_the_file_has_three():
    assert TexelType.BITS_8.video_bytes(10, 20) == 800
    assert TexelType.HALF.video_bytes(10, 20) == TexelType.BITS_16.video_bytes(10, 20) == 1600
    assert TexelType.FLOAT.video_bytes(10, 20) == 3200
