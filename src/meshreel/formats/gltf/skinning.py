"""Linear blend skinning of glTF meshes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import Accessors
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.formats.gltf.primitives import Block

Matrices = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Skin:
    """The joints to which a mesh is bound.

    Attributes
    ----------
    joints : list of int
        Nodes of the joints.
    inverse_binds : float64 array of shape (J, 4, 4)
        Transforms from the bind pose to each joint.
    """

    joints: list[int]
    inverse_binds: Matrices


@dataclass(frozen=True, eq=False)
class Influences:
    """The joints that move each vertex, and their weights.

    Attributes
    ----------
    joints : int64 array of shape (V, K)
        Indices into the joints of a skin; 0 where the weight is 0.
    weights : float64 array of shape (V, K)
        Nonnegative, with row sums of 1.
    """

    joints: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float64]

    def select(self, rows: npt.NDArray[np.int64]) -> "Influences":
        """Return the influences on some of the vertices."""
        return Influences(self.joints[rows], self.weights[rows])

    def blend(self, matrices: Matrices) -> Matrices:
        """Return the blended transform of each vertex, of shape (V, 3, 4).

        Parameters
        ----------
        matrices : float64 array of shape (J, 3, 4)
            Transforms of the joints from the bind pose to the current pose.
        """
        blended = np.zeros((len(self.joints), 3, 4))
        for joints, weights in zip(self.joints.T, self.weights.T, strict=True):
            blended += weights[:, np.newaxis, np.newaxis] * matrices[joints]
        return blended


def read_skin(skin: JsonObject, accessors: Accessors) -> Skin:
    """Return a skin of the file.

    Raises
    ------
    FormatError
        If it has no joints, or fewer matrices than joints.
    """
    joints = skin.indices("joints", len(accessors.document.lists["nodes"]))
    if not joints:
        raise skin.error("joints", "a list of at least one node")
    if "inverseBindMatrices" not in skin:
        return Skin(joints, np.tile(np.eye(4), (len(joints), 1, 1)))
    columns = accessors.read(skin, "inverseBindMatrices", "MAT4").floats().astype(np.float64)
    if len(columns) < len(joints) or not np.isfinite(columns).all():
        raise FormatError(
            f"{skin.place}: has {len(columns)} inverse bind matrices for {len(joints)} joints; "
            "expected one finite matrix per joint"
        )
    return Skin(joints, columns[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1))


def read_influences(blocks: Sequence[Block], place: str) -> Influences | None:
    """Return the influences on the concatenated vertices of all blocks, or None without joints.

    Weights are normalized; a vertex without weights follows its first joint, as in other programs.

    Raises
    ------
    FormatError
        If only some blocks have joints, or a weight is negative or not finite.
    """
    n_sets = {_count_sets(block) for block in blocks}
    if n_sets == {0}:
        return None
    if 0 in n_sets:
        raise FormatError(f"{place}: only some of its primitives have joints")
    width = 4 * max(n_sets)
    joints = np.concatenate([_joined_sets(block, "JOINTS", width) for block in blocks])
    weights = np.concatenate([_joined_sets(block, "WEIGHTS", width) for block in blocks])
    if not (np.isfinite(weights).all() and (weights >= 0).all()):
        raise FormatError(f"{place}: joint weights must be finite and at least 0")
    weights[weights.max(axis=1) == 0, 0] = 1.0
    weights /= weights.max(axis=1, keepdims=True)  # first, since sums of huge weights overflow
    weights /= weights.sum(axis=1, keepdims=True)
    return Influences(np.where(weights > 0, joints, 0).astype(np.int64), weights)


def transform_points(
    positions: npt.NDArray[np.float64], transforms: Matrices
) -> npt.NDArray[np.float64]:
    """Return positions of shape (V, 3), transformed by (3, 4) or (V, 3, 4) matrices."""
    if transforms.ndim == 2:
        return positions @ transforms[:, :3].T + transforms[:, 3]
    moved: npt.NDArray[np.float64] = np.einsum("vij,vj->vi", transforms[:, :, :3], positions)
    return moved + transforms[:, :, 3]


def _count_sets(block: Block) -> int:
    number = 0
    while {f"JOINTS_{number}", f"WEIGHTS_{number}"} <= block.values.keys():
        number += 1
    return number


def _joined_sets(block: Block, name: str, width: int) -> npt.NDArray[Any]:
    """Return all sets of joints or weights side by side, padded with zeros to `width` columns."""
    joined = np.zeros((block.n_verts, width))
    for number in range(_count_sets(block)):
        values = block.values[f"{name}_{number}"]
        if name == "JOINTS" and values.array.dtype.kind != "u":
            raise FormatError(f"{name}_{number} must be unsigned integers")
        array = values.array if name == "JOINTS" else values.floats()
        joined[:, 4 * number : 4 * number + 4] = array
    return joined
