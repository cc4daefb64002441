import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from meshreel.errors import InvalidInputError
from meshreel.kernel.order import opposite_sides
from meshreel.kernel.surface_integers import MAX_COLUMNS, MAX_VALUE, encode_on_surface
from samples.coded_meshes import decode_on_surface
from samples.meshes import grid_faces, octahedron_faces

FACES = {
    "sheet": grid_faces(5, 6),
    "closed": octahedron_faces(),
    "fins and degenerate": np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4], [5, 5, 2], [2, 1, 6]]),
    "isolated rows": np.array([[3, 7, 9]]),
    "none": np.zeros((0, 3), int),
}
SMOOTH = grid_faces(40, 50)


def coded(values, faces):
    """A table, or frames of one, and its stream, decoded."""
    frames = values.reshape(-1, *values.shape[-2:])
    twins = opposite_sides(np.asarray(faces, np.int32), frames.shape[1])
    data = encode_on_surface(frames, faces, twins)
    return data, decode_on_surface(data, frames.shape, faces, twins).reshape(values.shape)


@pytest.mark.slow
@pytest.mark.parametrize("name", FACES)
def test_tables_round_trip_on_any_faces(name):
    shapes = st.tuples(st.integers(1, 4), st.integers(30, 40), st.integers(1, MAX_COLUMNS))

    @given(arrays(np.int32, shapes, elements=st.integers(-MAX_VALUE, MAX_VALUE)))
    def check(values):
        np.testing.assert_array_equal(coded(values, FACES[name])[1], values)

    check()


@pytest.mark.parametrize("rate", [0, 1])
def test_frames_that_rest_or_move_evenly_take_few_bytes(rate):
    first = np.random.default_rng(3).integers(-500, 500, (2000, 3))
    moved = np.repeat(first[None], 12, axis=0)
    moved[:, 1500:] += 7 * rate * np.arange(12)[:, None, None]
    alone = len(coded(first.astype(np.int32), SMOOTH)[0])
    data, decoded = coded(moved.astype(np.int32), SMOOTH)
    np.testing.assert_array_equal(decoded, moved)
    assert len(data) < alone + 200


def test_a_cut_between_frames_is_coded_alone():
    rows, columns = np.divmod(np.arange(2000), 50)
    smooth = np.stack([40 * columns, 40 * rows, rows * columns // 50], axis=1)
    rough = np.random.default_rng(4).integers(-500, 500, (2000, 3))
    sizes = [
        len(coded(np.stack(frames).astype(np.int32), SMOOTH)[0])
        for frames in ([rough], [rough, smooth])
    ]
    assert sizes[1] < 1.3 * sizes[0]


def test_planes_take_few_bytes():
    rows, columns = np.divmod(np.arange(2000), 50)
    values = np.stack([700 * columns + 3 * rows, 11 * rows - columns], axis=1).astype(np.int32)
    assert len(coded(values, SMOOTH)[0]) < 260


def test_smooth_surfaces_take_fewer_bits_than_parallelograms_leave():
    rows, columns = np.divmod(np.arange(2000), 50)
    height = 400 * np.sin(rows / 9) * np.cos(columns / 7) + np.random.default_rng(2).normal(
        0, 3, 2000
    )
    values = np.rint(height)[:, None].astype(np.int32)
    field = values[:, 0].reshape(40, 50)
    parallelogram = field[1:, 1:] - field[1:, :-1] - field[:-1, 1:] + field[:-1, :-1]
    entropy = np.log2(parallelogram.std() * np.sqrt(2 * np.pi * np.e))
    assert 8 * len(coded(values, SMOOTH)[0]) < 0.95 * entropy * 2000


def test_few_steps_do_not_spoil_the_weights_of_flat_parts():
    rows, columns = np.divmod(np.arange(2000), 50)
    across = np.cumsum(np.where(np.arange(50) % 10 == 0, 1000, 90))[columns]
    along = np.cumsum(np.where(np.arange(40) % 10 == 0, 2000, 130))[rows]
    values = np.stack([across, along, along // 3], axis=1).astype(np.int32)
    rng = np.random.default_rng(1)
    moved = rng.choice(2000, 40, replace=False)
    values[moved, 2] += rng.integers(-3000, 3000, 40).astype(np.int32)
    assert len(coded(values, SMOOTH)[0]) < 3300  # least squares alone: 3,657


def test_repeated_parts_are_copied():
    rng = np.random.default_rng(3)
    part, n_parts = rng.integers(-300, 300, (2000, 2)), 5
    values = np.concatenate([part + np.array([7000 * i, 0]) for i in range(n_parts)]).astype(
        np.int32
    )
    faces = np.concatenate([SMOOTH + 2000 * i for i in range(n_parts)])
    data, decoded = coded(values, faces)
    np.testing.assert_array_equal(decoded, values)
    assert len(data) < 1.05 * len(coded(part.astype(np.int32), SMOOTH)[0])


def test_single_parallelograms_predict_extrusions():
    rows, columns = np.divmod(np.arange(2000), 50)
    outline = np.random.default_rng(5).integers(-2000, 2000, (50, 2)).cumsum(axis=0)
    values = np.column_stack([outline[columns], 40 * rows]).astype(np.int32)
    data, decoded = coded(values, SMOOTH)
    np.testing.assert_array_equal(decoded, values)
    assert len(data) < 330


def test_a_triangle_takes_no_weights():
    assert len(coded(np.array([[0, 0], [9, 0], [0, 7]], np.int32), np.array([[0, 1, 2]]))[0]) < 6


@pytest.mark.parametrize("value", [MAX_VALUE + 1, -MAX_VALUE - 1])
def test_values_beyond_the_limit_are_refused(value):
    values = np.full((30, 2), value, np.int32)
    with pytest.raises(InvalidInputError):
        coded(values, FACES["sheet"])
