"""Keyframes of bones: quantized, relative to parents, and removed where interpolation suffices."""

from dataclasses import dataclass

import numpy as np

from meshreel.arrays import Floats, Integers
from meshreel.model.rig import Skeleton
from meshreel.model.rig_keys import (
    BoneTrack,
    Shorts,
    compose,
    decode_rotations,
    interpolated,
    unit,
)

MIN_BITS, MAX_BITS = 6, 16
"""Bits of a component of a quaternion."""

MAX_KEY_SHARE = 0.4
"""Bones whose reduced keys are at most this share of the frames have key times of their own; with
more, the times and larger differences take more bytes than the keys save."""


@dataclass(frozen=True)
class Steps:
    """Quantization of keys."""

    bits: int
    """Of each of the three smaller components of a quaternion, `MIN_BITS` to `MAX_BITS`."""
    exponent: int
    """Translations are multiples of 2 to this power, in model units."""


def to_quaternions(rotations: Floats) -> Floats:
    """Return unit quaternions x, y, z, w of rotations of shape (T, 3, 3).

    Each is computed from its largest component, which is positive.
    """
    xx, yy, zz = (rotations[:, axis, axis] for axis in range(3))
    ws = rotations[:, [2, 0, 1], [1, 2, 0]] - rotations[:, [1, 2, 0], [2, 0, 1]]
    squares = np.stack([1 + xx - yy - zz, 1 + yy - xx - zz, 1 + zz - xx - yy, 1 + xx + yy + zz], 1)
    products = np.empty((len(rotations), 4, 4))  # row k: four times the quaternion, times q_k
    products[:, :3, :3] = rotations + rotations.transpose(0, 2, 1)
    products[:, 3, :3] = products[:, :3, 3] = ws
    np.einsum("tkk->tk", products)[:] = squares
    largest = squares.argmax(axis=1)
    return np.asarray(unit(products[np.arange(len(rotations)), largest]))


def encode_rotations(quaternions: Floats, bits: int) -> Shorts:
    """Return the three smaller components of quaternions in a number of bits, and the scale.

    They are the input of the quaternion filter of `EXT_meshopt_compression`: the last component is
    the value that stands for the square root of 1/2, with the number of the largest component in
    its two lowest bits.
    """
    scale = (1 << (bits - 1)) - 1
    rows = np.arange(len(quaternions))
    largest = np.abs(quaternions).argmax(axis=1)
    others = (largest[:, np.newaxis] + [1, 2, 3]) % 4
    small = np.take_along_axis(quaternions, others, axis=1)
    small = small * np.where(quaternions[rows, largest] < 0, -1, 1)[:, np.newaxis]
    codes = np.empty((len(quaternions), 4), np.int16)
    codes[:, :3] = np.clip(np.rint(small * np.sqrt(2) * scale), -scale, scale)
    codes[:, 3] = (scale & ~3) | largest
    return codes


def fit_tracks(
    transforms: Floats,
    skeleton: Skeleton,
    radii: Floats,
    times_s: Floats,
    steps: Steps,
    tolerance: float,
) -> tuple[BoneTrack, ...]:
    """Return the keys of all bones.

    Each bone is relative to its parent as decoded from the parent's keys, so that rounding errors
    do not add up along the hierarchy.

    Parameters
    ----------
    transforms : float64 array of shape (T, B, 3, 4)
        From the rest pose, in model units.
    radii : float64 array of shape (B,)
        Typical distance of the vertices of a bone from its joint.
    tolerance : float
        Largest error from removed keys, at that distance.
    """
    poses_hat: list[Floats] = []
    tracks = []
    for bone, parent in enumerate(skeleton.parents.tolist()):
        matrices = at_joint(transforms[:, bone], skeleton.joints[bone])
        parent_pose = poses_hat[parent] if parent >= 0 else None
        local = matrices if parent_pose is None else relative_to(parent_pose, matrices)
        # The keys of the root tell readers the times of all frames.
        bone_tolerance = tolerance if parent_pose is not None else -1.0
        track = _fit_track(local, float(radii[bone]), times_s, steps, bone_tolerance)
        tracks.append(track)
        local_hat = track.matrices(times_s).astype(np.float64)
        poses_hat.append(local_hat if parent_pose is None else compose(parent_pose, local_hat))
    return tuple(tracks)


def at_joint(transforms: Floats, joint: Floats) -> Floats:
    """Return the transforms of a bone whose origin is its joint."""
    moved = transforms.copy()
    moved[:, :, 3] += transforms[:, :, :3] @ joint
    return moved


def relative_to(parent_pose: Floats, transforms: Floats) -> Floats:
    """Return rigid transforms of shape (T, 3, 4) in the space of others."""
    inverse = parent_pose[:, :, :3].transpose(0, 2, 1)
    offset = transforms.copy()
    offset[:, :, 3] -= parent_pose[:, :, 3]
    return inverse @ offset


def _fit_track(
    local: Floats, radius: float, times_s: Floats, steps: Steps, tolerance: float
) -> BoneTrack:
    quaternions = to_quaternions(local[:, :, :3])
    codes = encode_rotations(quaternions, steps.bits)
    # Adding 0 replaces -0, which takes more bytes.
    translations = np.ldexp(np.rint(np.ldexp(local[:, :, 3], -steps.exponent)), steps.exponent) + 0
    keys = np.arange(len(times_s))
    if tolerance >= 0 and len(keys) > 1:
        exact = unit(decode_rotations(codes).astype(np.float64))
        keys = _reduce_keys(exact, translations, quaternions, local, radius, times_s, tolerance)
    return BoneTrack(keys, codes[keys], translations[keys].astype(np.float32))


def _reduce_keys(
    rounded: Floats,
    translations: Floats,
    quaternions: Floats,
    local: Floats,
    radius: float,
    times_s: Floats,
    tolerance: float,
) -> Integers:
    """Return the frames whose keys suffice, or all if those are many.

    The frame with the largest error becomes a key, until all errors are below the tolerance
    (Ramer 1972, Douglas and Peucker 1973), in all intervals at once.
    """
    n_frames = len(times_s)
    keys = np.array([0])
    while len(keys) <= MAX_KEY_SHARE * n_frames:
        rotations_hat, moved = interpolated(times_s, keys, rounded[keys], translations[keys])
        cosine = np.abs((rotations_hat * quaternions).sum(axis=1)).clip(0, 1)
        angles = 2 * np.sqrt(2 * (1 - cosine))
        errors = radius * angles + np.linalg.norm(moved - local[:, :, 3], axis=1)
        errors[keys] = 0
        if errors.max() <= tolerance:
            return keys
        if len(keys) == 1:
            keys = np.array([0, n_frames - 1])
            continue
        intervals = np.searchsorted(keys, np.arange(n_frames), "right")
        worst = np.zeros(len(keys) + 1)
        np.maximum.at(worst, intervals, errors)
        is_worst = (errors == worst[intervals]) & (errors > tolerance)
        _, first = np.unique(np.where(is_worst, intervals, 0), return_index=True)
        keys = np.union1d(keys, first[is_worst[first]])
    return np.arange(n_frames)
