"""Textures round-trip bit for bit, decode to shader values, and reject everything else."""

import struct
import zlib

import numpy as np
import pytest

from meshreel.errors import FormatError
from meshreel.formats.vat.textures import TexelType, read_texture, write_texture

TYPES = list(TexelType)


@pytest.fixture
def rng():
    return np.random.default_rng(5)


@pytest.mark.parametrize("n_channels", [3, 4])
@pytest.mark.parametrize("texel_type", TYPES)
def test_texels_of_every_type_round_trip(tmp_path, rng, texel_type, n_channels):
    texels = texel_type.texels(rng.random((5, 7, n_channels)))
    path = tmp_path / f"a{texel_type.extension}"
    write_texture(path, texels)
    back = read_texture(path)
    assert back.dtype == texel_type.dtype
    np.testing.assert_array_equal(back, texels)


def test_png_stores_the_top_row_first_and_its_bit_depth(tmp_path):
    """Parsed without the library: a header, and rows of big-endian numbers after a filter byte."""
    texels = np.array([[[1, 2, 3]], [[65535, 256, 0]]], np.uint16)
    write_texture(tmp_path / "a.png", texels)
    data = (tmp_path / "a.png").read_bytes()
    assert struct.unpack(">II5B", data[16:29]) == (1, 2, 16, 2, 0, 0, 0)
    start = data.index(b"IDAT") + 4
    rows = np.frombuffer(zlib.decompress(data[start:]), np.uint8).reshape(2, 7)
    assert rows[0, 0] in (0, 1, 2, 3, 4)
    first = rows[0, 1:]  # all filters leave the first pixel of the first row unchanged
    np.testing.assert_array_equal(first.view(">u2"), texels[0, 0])


@pytest.mark.parametrize("texel_type", [TexelType.BITS_8, TexelType.BITS_16])
def test_integer_texels_round_to_half_a_step(rng, texel_type):
    values = np.append(rng.random(1000), [0.0, 1.0])
    steps = 255 if texel_type is TexelType.BITS_8 else 65535
    errors = np.abs(texel_type.values(texel_type.texels(values)) - values)
    assert errors.max() <= 0.5 / steps + 1e-12
    assert errors[-2:].max() == 0.0


def test_half_float_texels_round_to_half_a_unit_in_the_last_place(rng):
    values = rng.random(1000)
    errors = np.abs(TexelType.HALF.values(TexelType.HALF.texels(values)) - values)
    assert np.all(errors <= np.spacing(values.astype(np.float16)).astype(float) / 2 + 1e-9)


@pytest.mark.parametrize("texel_type", [TexelType.BITS_16, TexelType.HALF])
def test_errors_of_damaged_files_name_the_file(tmp_path, rng, texel_type):
    path = tmp_path / "broken"
    write_texture(path, texel_type.texels(rng.random((64, 64, 3))))
    data = path.read_bytes()
    for kept in (0, 3, 20, len(data) // 2):
        path.write_bytes(data[:kept])
        with pytest.raises(FormatError, match="broken"):
            read_texture(path)


@pytest.mark.parametrize("texel_type", TYPES)
def test_error_of_an_unwritable_file_names_it(tmp_path, texel_type):
    path = tmp_path / "missing" / "a"
    with pytest.raises(OSError, match="No such file or directory") as raised:
        write_texture(path, texel_type.texels(np.zeros((4, 4, 3))))
    assert raised.value.filename == str(path)


def test_video_memory_always_has_four_channels():
    assert TexelType.BITS_8.video_bytes(10, 20) == 800
    assert TexelType.HALF.video_bytes(10, 20) == TexelType.BITS_16.video_bytes(10, 20) == 1600
    assert TexelType.FLOAT.video_bytes(10, 20) == 3200
