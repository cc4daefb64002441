import tracemalloc
from dataclasses import astuple

import numpy as np
import pytest

from meshreel.errors import InvalidInputError
from meshreel.formats.save import save
from meshreel.metrics.displacement import displacement_errors_percent
from meshreel.metrics.kg import kg_error_percent
from meshreel.metrics.streamed import ErrorSums, StreamedErrors, streamed_errors
from meshreel.model.extent import Extent, extent_of
from meshreel.model.sequence import MeshSequence
from samples.opening import open_source

FACES = np.array([[0, 1, 2]])


def whole_errors(original, decoded):
    displacement = displacement_errors_percent(original, decoded)
    return StreamedErrors(
        kg_error_percent(original, decoded), displacement.max_percent, displacement.rms_percent
    )


def blocks_of(decoded, *cuts):
    starts = [0, *cuts]
    return list(zip(starts, np.split(decoded, cuts), strict=True))


@pytest.mark.parametrize("cuts", [[], [1], [5, 5, 6, 13]])
@pytest.mark.parametrize(
    ("scale", "offset", "dtype"),
    [
        (1, 0, np.float64),
        (1, 0, np.float32),
        (1e-6, 1e3, np.float64),
        (1, 2.0**30, np.float64),
        (2.0**-900, 0, np.float64),
        (2.0**900, 0, np.float64),
        (1e-30, 0, np.float32),
    ],
)
def test_streamed_errors_equal_those_of_the_whole(soup, cuts, scale, offset, dtype):
    original, decoded = ((part * scale + offset).astype(dtype) for part in soup[:2])
    found = streamed_errors(MeshSequence(original, FACES), blocks_of(decoded, *cuts))
    assert found == whole_errors(original, decoded)
    assert found.kg_error_percent > 0


def test_streamed_errors_do_not_depend_on_the_order_of_blocks(soup):
    original, decoded, _ = soup
    found = streamed_errors(MeshSequence(original, FACES), blocks_of(decoded, 3, 9)[::-1])
    assert astuple(found) == pytest.approx(astuple(whole_errors(original, decoded)), rel=1e-12)


def test_streamed_errors_of_equal_sequences_are_exactly_zero(soup):
    found = streamed_errors(MeshSequence(soup[0], FACES), blocks_of(soup[0].copy(), 4))
    assert found == StreamedErrors(0, 0, 0)


@pytest.mark.parametrize(("moved_x", "expected"), [(0.0, 0.0), (1.0, np.inf)])
def test_streamed_errors_of_a_single_point_are_zero_or_infinite(moved_x, expected):
    decoded = np.full((3, 4, 3), 0.1)
    original = decoded.copy()
    decoded[2, 1, 0] += moved_x
    found = streamed_errors(MeshSequence(original, FACES), blocks_of(decoded, 1))
    assert found == StreamedErrors(expected, expected, expected)


def test_streamed_errors_beyond_float64_are_infinite(soup):
    decoded = soup[1].copy()
    decoded[5, 0, 0] = 1e300
    found = streamed_errors(MeshSequence(soup[0], FACES), blocks_of(decoded, 5))
    assert found == StreamedErrors(np.inf, np.inf, np.inf)


def test_streamed_errors_of_an_original_in_files_equal_those_of_the_whole(tmp_path, soup):
    original, decoded, faces = soup
    sequence = MeshSequence(original + 1e6, faces)
    save(sequence, tmp_path / "f_%d.ply")
    found = streamed_errors(open_source(tmp_path), blocks_of(decoded + 1e6, 4))
    assert found == whole_errors(sequence.vertices, decoded + 1e6)


def test_error_sums_use_the_diagonal_of_the_whole(soup):
    original, decoded, _ = soup
    sums = ErrorSums(extent_of(original))
    sums.add(original[:1], decoded[:1])
    own = displacement_errors_percent(original[:1], decoded[:1]).max_percent
    sides = [np.linalg.norm(np.ptp(part, axis=(0, 1))) for part in (original[:1], original)]
    assert sums.errors.max_error_percent == pytest.approx(own * sides[0] / sides[1], rel=1e-12)


def test_blocks_of_another_shape_are_rejected(soup):
    sums = ErrorSums(extent_of(soup[0]))
    with pytest.raises(InvalidInputError, match=r"\(14, 12, 3\) and \(14, 11, 3\)"):
        sums.add(soup[0], soup[1][:, :11])


def test_error_sums_without_frames_are_rejected(soup):
    with pytest.raises(InvalidInputError, match="needs at least one frame"):
        _ = ErrorSums(extent_of(soup[0])).errors


@pytest.mark.parametrize(
    ("ranges", "message"),
    [
        ([(0, 5), (6, 14)], "frame 5 of the original was not decoded"),
        ([], "frame 0 of the original was not decoded"),
        ([(0, 5), (4, 14)], "a frame from 4 to 13 was decoded twice"),
    ],
)
def test_missing_and_repeated_frames_are_rejected(soup, ranges, message):
    original, decoded, _ = soup
    with pytest.raises(InvalidInputError, match=message):
        streamed_errors(MeshSequence(original, FACES), [(a, decoded[a:b]) for a, b in ranges])


@pytest.mark.parametrize("start", [-1, 1])
def test_original_with_fewer_frames_is_rejected(soup, start):
    with pytest.raises(InvalidInputError, match="the original has frames 0 to 13"):
        streamed_errors(MeshSequence(soup[0], FACES), [(start, soup[1])])


class Turning:
    """A source that generates its frames when they are read."""

    n_frames, n_verts, faces, fps, name = 300, 2000, FACES, 0.0, ""
    dtype = np.dtype(np.float32)
    extent = Extent(np.zeros(3), np.full(3, 299.0), 0.0)

    def read(self, start, stop):
        frames = np.arange(start, stop, dtype=np.float32)[:, None, None]
        return frames * np.linspace(0, 1, 6000, dtype=np.float32).reshape(1, 2000, 3)


def test_small_blocks_need_a_tenth_of_the_memory():
    source = Turning()
    tracemalloc.start()
    try:
        streamed_errors(
            source, ((start, source.read(start, start + 5)) for start in range(0, 300, 5))
        )
        assert tracemalloc.get_traced_memory()[1] < 300 * 2000 * 12 / 10
    finally:
        tracemalloc.stop()
