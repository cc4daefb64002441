"""Vertices that follow joints: linear blend skinning."""

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
    """The joints that a mesh is bound to.

    Attributes
    ----------
    joints : list of int
        Nodes.
    inverse_binds : float64 array of shape (J, 4, 4)
        From where the mesh was bound to each joint.
    """

    joints: list[int]
    inverse_binds: Matrices


@dataclass(frozen=True, eq=False)
class Influences:
    """Which joints move each vertex, and how much.

    Attributes
    ----------
    joints : int64 array of shape (V, K)
        Numbers within a skin; 0 where the weight is 0.
    weights : float64 array of shape (V, K)
        At least 0; the sum of each row is 1.
    """

    joints: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float64]

    def of(self, rows: npt.NDArray[np.int64]) -> "Influences":
        """The influences on some of the vertices."""
        return Influences(self.joints[rows], self.weights[rows])

    def blend(self, matrices: Matrices) -> Matrices:
        """The transform of each vertex, of shape (V, 3, 4).

        Parameters
        ----------
        matrices : float64 array of shape (J, 3, 4)
            From where the mesh was bound to where each joint takes it.
        """
        blended = np.zeros((len(self.joints), 3, 4))
        for joints, weights in zip(self.joints.T, self.weights.T, strict=True):
            blended += weights[:, np.newaxis, np.newaxis] * matrices[joints]
        return blended


def read_skin(skin: JsonObject, accessors: Accessors) -> Skin:
    """A skin of the file.

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
            "it needs one each, of finite numbers"
        )
    return Skin(joints, columns[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1))


def read_influences(blocks: Sequence[Block], place: str) -> Influences | None:
    """The influences on the vertices of all blocks, one after the other; None if there are none.

    Weights are scaled so that those of a vertex have the sum 1; a vertex without any follows the
    first joint that it names, as in other programs.

    Raises
    ------
    FormatError
        If only some blocks have joints, or a weight is negative or not finite.
    """
    n_sets = {_count_sets(block) for block in blocks}
    if n_sets == {0}:
        return None
    if 0 in n_sets:
        raise FormatError(f"{place}: some of its primitives have joints, others have none")
    width = 4 * max(n_sets)
    joints = np.concatenate([_padded(block, "JOINTS", width) for block in blocks])
    weights = np.concatenate([_padded(block, "WEIGHTS", width) for block in blocks])
    if not (np.isfinite(weights).all() and (weights >= 0).all()):
        raise FormatError(f"{place}: weights of joints must be finite and at least 0")
    weights[weights.max(axis=1) == 0, 0] = 1.0
    weights /= weights.max(axis=1, keepdims=True)  # or the sum of the largest would be infinite
    weights /= weights.sum(axis=1, keepdims=True)
    return Influences(np.where(weights > 0, joints, 0).astype(np.int64), weights)


def move(positions: npt.NDArray[np.float64], transforms: Matrices) -> npt.NDArray[np.float64]:
    """Positions of shape (V, 3) where transforms of shape (3, 4) or (V, 3, 4) take them."""
    if transforms.ndim == 2:
        return positions @ transforms[:, :3].T + transforms[:, 3]
    moved: npt.NDArray[np.float64] = np.einsum("vij,vj->vi", transforms[:, :, :3], positions)
    return moved + transforms[:, :, 3]


def _count_sets(block: Block) -> int:
    number = 0
    while {f"JOINTS_{number}", f"WEIGHTS_{number}"} <= block.values.keys():
        number += 1
    return number


def _padded(block: Block, name: str, width: int) -> npt.NDArray[Any]:
    """All sets of a block beside each other, zeros behind them."""
    padded = np.zeros((block.n_verts, width))
    for number in range(_count_sets(block)):
        values = block.values[f"{name}_{number}"]
        if name == "JOINTS" and values.array.dtype.kind != "u":
            raise FormatError(f"{name}_{number} must be unsigned whole numbers")
        found = values.array if name == "JOINTS" else values.floats()
        padded[:, 4 * number : 4 * number + 4] = found
    return padded
