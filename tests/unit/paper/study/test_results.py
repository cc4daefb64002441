"""Extrapolation of the cost of all graph frequencies."""

import pytest

from meshreel.paper.study.results import extrapolated_basis

MEASURED = {"n_verts": 1000, "seconds": 2.0, "processor_seconds": 3.0, "memory_bytes": 16e6}


def test_basis_is_extrapolated_with_the_powers_of_time_and_memory():
    result = extrapolated_basis(MEASURED, 20_000, 152)
    assert result.seconds_each == pytest.approx(2.0 * 20**3)
    assert result.processor_seconds_each == pytest.approx(3.0 * 20**3)
    assert result.seconds == pytest.approx(152 * 2.0 * 20**3)
    assert result.processor_seconds == pytest.approx(152 * 3.0 * 20**3)
    assert result.memory_bytes == pytest.approx(16e6 * 20**2)


def test_text_names_the_extrapolation_and_its_source():
    assert extrapolated_basis(MEASURED, 20_000, 152).text == (
        "Extrapolated from one decomposition of 1,000 vertices, 2 s, with V^3: 20,000 vertices "
        "take 4 hours and 6.4 GB for one decomposition, 676 hours with one for each of 152 frames."
    )
    assert extrapolated_basis(MEASURED, 1000, 100).text == (
        "Extrapolated from one decomposition of 1,000 vertices, 2 s: 1,000 vertices take 2 s and "
        "16 MB for one decomposition, 3 minutes with one for each of 100 frames."
    )
