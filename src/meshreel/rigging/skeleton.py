"""A hierarchy of bones whose joints hardly move, and transforms relative to the parents."""

import numpy as np

from meshreel.arrays import Floats, Integers
from meshreel.model.rig import Skeleton
from meshreel.rigging.decomposition import Skin

PIVOT_DAMPING = 1e-3
"""Weight of the distance between a joint and the vertices that both of its bones move, relative to
the distance between the positions of the joint by the two bones."""

UNRELATED_FACTOR = 4.0
"""Factor of the distance between bones that share no vertex."""


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
