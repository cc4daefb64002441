import numpy as np
import pytest

from meshreel.paper.subspace.rank import modes_for_energy

VALUES = np.array([[80.0, 8.0, 1.0], [8.0, 2.0, 1.0]])  # 88, 10, 2 of 100


@pytest.mark.parametrize(
    ("share", "expected"), [(0.5, 1), (0.88, 1), (0.89, 2), (0.99, 3), (1.0, 3)]
)
def test_modes_contain_the_requested_share_of_energy(share, expected):
    assert modes_for_energy(VALUES, 100.0, 100.0, share) == expected


def test_energy_of_the_path_does_not_count():
    # The shape has 10 of 100: leaving out 2 keeps 0.8 of it.
    assert modes_for_energy(VALUES, 100.0, 10.0, 0.79) == 2
    assert modes_for_energy(VALUES, 100.0, 10.0, 0.81) == 3


def test_one_mode_is_kept_without_energy():
    assert modes_for_energy(np.zeros((3, 5)), 0.0, 0.0, 0.9999) == 1
