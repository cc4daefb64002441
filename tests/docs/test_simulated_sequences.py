"""The simulated sequence of bench/ is as described."""

import numpy as np

import meshreel
from heat_on_a_sphere import simulate


def test_heat_spreads_and_decodes_within_its_bounds():
    sphere = simulate(400, 20)
    decoded = meshreel.decode(meshreel.encode(sphere, tracks={"temperature": "0.1K"}))
    heat, heat_hat = (each.tracks["temperature"].values for each in (sphere, decoded))
    assert np.ptp(heat[0]) > 1.4 * np.ptp(heat[-1])
    assert np.abs(heat_hat - heat).max() <= 0.1
    assert decoded.tracks["heat flow"].shape == (20, len(sphere.faces), 3)
