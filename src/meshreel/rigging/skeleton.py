"""A hierarchy of bones whose joints hardly move, and the keyframes of the bones.

Keys are quantized, relative to the parents, and removed where interpolation suffices.
"""

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
from meshreel.rigging.decomposition import Skin

PIVOT_DAMPING = 1e-3
"""Weight of the distance between a joint and the vertices that both of its bones move, relative to
the distance between the positions of the joint by the two bones."""

UNRELATED_FACTOR = 4.0
"""Factor of the distance between bones that share no vertex."""

MIN_BITS, MAX_BITS = 6, 16
"""Bits of a component of a quaternion."""

MAX_KEY_SHARE = 0.4
"""Bones whose reduced keys are at most this share of the frames have key times of their own; with
more, the times and larger differences take more bytes than the keys save."""


def build_skeleton(skin: Skin) -> tuple[Skin, Skeleton]:
    """Return the skin with its bones in an order with parents first, and their skeleton.

    The tree of bones is the spanning tree whose joints move least. A joint is the point that two
    bones move alike, near the vertices that they share. The root is the bone with the largest
    weights.
    """
    n_frames, n_bones = skin.transforms.shape[:2]
    dense = skin.dense_weights()
    total_weights = dense.sum(axis=0)
    points = np.column_stack([skin.rest, np.ones(len(skin.rest))])
    centers = (dense.T @ skin.rest) / np.maximum(total_weights, 1e-12)[:, np.newaxis]
    matrices = skin.transforms.transpose(0, 2, 1, 3).reshape(-1, 4 * n_bones)
    squares = (matrices.T @ matrices).reshape(n_bones, 4, n_bones, 4) / n_frames
    diagonal = squares[np.arange(n_bones), :, np.arange(n_bones)]
    cross = squares.transpose(0, 2, 1, 3)
    differences = diagonal[:, np.newaxis] + diagonal - cross - cross.transpose(0, 1, 3, 2)
    shared = np.einsum("vj,vk,va->jka", dense, dense, points, optimize=True)
    mass = shared[:, :, 3:]
    middle = (centers[:, np.newaxis] + centers) / 2
    is_shared = mass > 1e-9
    anchors = np.where(is_shared, shared[:, :, :3] / np.where(is_shared, mass, 1), middle)
    gram, motion = differences[:, :, :3, :3], differences[:, :, :3, 3]
    damping = PIVOT_DAMPING * np.eye(3)
    pivots = np.linalg.solve(gram + damping, (PIVOT_DAMPING * anchors - motion)[..., np.newaxis])[
        ..., 0
    ]
    homogeneous = np.concatenate([pivots, np.ones((n_bones, n_bones, 1))], axis=2)
    gaps = np.einsum("jka,jkab,jkb->jk", homogeneous, differences, homogeneous)
    gaps += PIVOT_DAMPING * np.square(pivots - anchors).sum(axis=2)
    distances = np.sqrt(np.maximum(gaps, 0)) * np.where(is_shared[:, :, 0], 1, UNRELATED_FACTOR)
    order, parents = _spanning_tree(distances, int(total_weights.argmax()))
    joints = np.array(
        [
            centers[bone] if parent < 0 else pivots[bone, order[parent]]
            for bone, parent in zip(order, parents, strict=True)
        ]
    )
    numbers = np.empty(n_bones, np.int64)
    numbers[order] = np.arange(n_bones)
    ordered = Skin(skin.rest, numbers[skin.bones], skin.weights, skin.transforms[:, order])
    return ordered, Skeleton(parents, joints)


def _spanning_tree(distances: Floats, root: int) -> tuple[Integers, Integers]:
    """Return the nodes of the minimum spanning tree, and the position of each one's parent."""
    order, parents = [root], [-1]
    nearest, links = distances[root].copy(), np.zeros(len(distances), np.int64)
    is_free = np.ones(len(distances), bool)
    is_free[root] = False
    while is_free.any():
        node = int(np.where(is_free, nearest, np.inf).argmin())
        order.append(node)
        parents.append(int(links[node]))
        is_free[node] = False
        is_closer = distances[node] < nearest
        nearest[is_closer], links[is_closer] = distances[node][is_closer], len(order) - 1
    return np.array(order), np.array(parents)


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
        matrices = transforms[:, bone].copy()  # from the joint of the bone
        matrices[:, :, 3] += matrices[:, :, :3] @ skeleton.joints[bone]
        parent_pose = poses_hat[parent] if parent >= 0 else None
        local = matrices if parent_pose is None else relative_to(parent_pose, matrices)
        quaternions = to_quaternions(local[:, :, :3])
        codes = encode_rotations(quaternions, steps.bits)
        translations = round_to(local[:, :, 3], steps.exponent)
        keys = np.arange(len(times_s))
        # The keys of the root tell readers the times of all frames.
        if parent_pose is not None and len(keys) > 1:
            exact, radius = unit(decode_rotations(codes).astype(np.float64)), float(radii[bone])
            keys = _reduce_keys(exact, translations, quaternions, local, radius, times_s, tolerance)
        track = BoneTrack(keys, codes[keys], translations[keys].astype(np.float32))
        tracks.append(track)
        local_hat = track.matrices(times_s).astype(np.float64)
        poses_hat.append(local_hat if parent_pose is None else compose(parent_pose, local_hat))
    return tuple(tracks)


def round_to(values: Floats, exponent: int) -> Floats:
    """Return values rounded to multiples of 2 to the power of an exponent."""
    # Adding 0 replaces -0, which takes more bytes.
    return np.asarray(np.ldexp(np.rint(np.ldexp(values, -exponent)), exponent) + 0.0)


def relative_to(parent_pose: Floats, transforms: Floats) -> Floats:
    """Return rigid transforms of shape (T, 3, 4) in the space of others."""
    inverse = parent_pose[:, :, :3].transpose(0, 2, 1)
    offset = transforms.copy()
    offset[:, :, 3] -= parent_pose[:, :, 3]
    return inverse @ offset


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
