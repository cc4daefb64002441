"""Shading with key, fill and sky lights attached to the camera."""

import numpy as np

from meshreel.arrays import Singles

_GAMMA = 2.2
_SKY, _GROUND = 0.32, 0.10
_KEY, _FILL, _GLOSS = 0.85, 0.16, 0.08
_SHININESS = 24


def _direction(right: float, down: float, into: float) -> Singles:
    vector = np.array([right, down, into])
    return np.asarray(vector / np.sqrt((vector**2).sum()), np.float32)


_TOWARDS_KEY = _direction(-0.50, -0.70, -0.75)
_TOWARDS_FILL = _direction(0.85, -0.10, -0.60)
_HALFWAY = _direction(*(_TOWARDS_KEY + _direction(0, 0, -1)))


def shade(normals: Singles, colors: Singles) -> Singles:
    """Colors of lit surface points.

    Parameters
    ----------
    normals : float32 array of shape (N, 3)
        Unit normals of the visible side in camera axes (right, down, into the scene).
    colors : float32 array of shape (N, 3)
        Surface colors, sRGB in 0..255.

    Returns
    -------
    float32 array of shape (N, 3), sRGB in 0..255
    """
    sky = 0.5 - 0.5 * normals[:, 1]
    light = _GROUND + (_SKY - _GROUND) * sky
    light += _KEY * np.maximum(normals @ _TOWARDS_KEY, 0)
    light += _FILL * np.maximum(normals @ _TOWARDS_FILL, 0)
    gloss = _GLOSS * np.maximum(normals @ _HALFWAY, 0) ** _SHININESS
    linear = (colors / 255) ** _GAMMA * light[:, None] + gloss[:, None]
    lit: Singles = 255 * np.clip(linear, 0, 1) ** (1 / _GAMMA)
    return lit
