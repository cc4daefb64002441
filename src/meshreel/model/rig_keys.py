"""Keyframes of bones as files store them, and poses between them as engines show them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers, Real, Singles

Shorts = npt.NDArray[np.int16]

SHORT = 32767


@dataclass(frozen=True, eq=False)
class BoneTrack:
    """Keys of a bone relative to its parent, of linear and spherical interpolation."""

    frames: Integers
    """int64 array of shape (N,). Frames that have a key, ascending; a single one if the bone rests.
    """
    codes: Shorts
    """int16 array of shape (N, 4). Rotations, as `decode_rotations` takes them."""
    translations: Singles
    """float32 array of shape (N, 3). In model units."""

    @property
    def rotations(self) -> Shorts:
        """Unit quaternions x, y, z, w as normalized integers, of shape (N, 4)."""
        return decode_rotations(self.codes)

    def poses(self, times_s: Floats) -> tuple[Singles, Singles]:
        """Return unit quaternions and translations in all frames, in float32 as in engines."""
        quaternions = unit(self.rotations.astype(np.float32))
        return interpolated(times_s, self.frames, quaternions, self.translations)

    def matrices(self, times_s: Floats) -> Singles:
        """Return the transforms in all frames, of shape (T, 3, 4)."""
        return to_matrices(*self.poses(times_s))


def unit(quaternions: Real) -> Real:
    """Return quaternions with length 1."""
    length: Real = np.linalg.norm(quaternions, axis=1, keepdims=True)
    return quaternions / length


def interpolated(
    times_s: Floats,
    frames: Integers,
    quaternions: npt.NDArray[Any],
    translations: npt.NDArray[Any],
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Return quaternions and translations at all times, given those at the times of some frames."""
    if len(frames) == len(times_s):
        return quaternions, translations
    if len(frames) == 1:
        n_frames = len(times_s)
        return np.repeat(quaternions, n_frames, axis=0), np.repeat(translations, n_frames, axis=0)
    numbers = np.arange(len(times_s))
    index = np.clip(np.searchsorted(frames, numbers, "right") - 1, 0, len(frames) - 2)
    first, second = frames[index], frames[index + 1]
    share = (times_s - times_s[first]) / (times_s[second] - times_s[first])
    share = np.clip(share, 0, 1).astype(quaternions.dtype)[:, np.newaxis]
    a, b = quaternions[index], quaternions[index + 1]
    cosine = (a * b).sum(axis=1, keepdims=True)
    b = np.where(cosine < 0, -b, b)
    angle = 2 * np.arcsin(np.minimum(np.linalg.norm(b - a, axis=1, keepdims=True) / 2, 1))
    is_arc = angle > 1e-6
    sine = np.where(is_arc, np.sin(angle), 1)
    slerp: npt.NDArray[Any] = (
        np.where(is_arc, np.sin((1 - share) * angle) / sine, 1 - share) * a
        + np.where(is_arc, np.sin(share * angle) / sine, share) * b
    )
    moved: npt.NDArray[Any] = (1 - share) * translations[index] + share * translations[index + 1]
    return unit(slerp), moved


def to_matrices(quaternions: Real, translations: Real) -> Real:
    """Return transforms of shape (T, 3, 4) of unit quaternions x, y, z, w and translations."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), translations[:, 0]],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), translations[:, 1]],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), translations[:, 2]],
    ]
    return np.array(rows).transpose(2, 0, 1)


def decode_rotations(codes: Shorts) -> Shorts:
    """Return unit quaternions as normalized integers, as `EXT_meshopt_compression` decodes them.

    The codes may be any integers; components are limited to -32767 to 32767.
    """
    scale = (codes[:, 3:] | 3).astype(np.float64)
    small = codes[:, :3] / scale * np.sqrt(0.5)
    largest = np.sqrt(np.maximum(0, 1 - np.square(small).sum(axis=1, keepdims=True)))
    components = ((codes[:, 3:] & 3) + [1, 2, 3, 0]) % 4
    values = np.concatenate([small, largest], axis=1) * SHORT
    quaternions = np.empty_like(codes)
    rounded = np.trunc(values + np.copysign(0.5, values)).clip(-SHORT, SHORT)
    np.put_along_axis(quaternions, components.astype(np.int64), rounded.astype(np.int16), axis=1)
    return quaternions


def compose(first: npt.NDArray[Any], second: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the transforms that apply `second`, then `first`; both of shape (T, 3, 4)."""
    product: npt.NDArray[Any] = first[:, :, :3] @ second
    product[:, :, 3] += first[:, :, 3]
    return product
