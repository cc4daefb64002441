"""Transforms of an Alembic hierarchy, and where they put a mesh in the world.

A point is a row, as in the file: it is multiplied by the matrix of its own transform first, and
by those above in order.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.archive import Property
from meshreel.formats.alembic.ogawa import damaged
from meshreel.formats.alembic.time_sampling import Times, between
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.sequence import Vertices

Matrix = npt.NDArray[np.float64]

SCALE, TRANSLATE, ROTATE, MATRIX, ROTATE_X, ROTATE_Y, ROTATE_Z = range(7)
N_CHANNELS = {
    SCALE: 3, TRANSLATE: 3, ROTATE: 4, MATRIX: 16, ROTATE_X: 1, ROTATE_Y: 1, ROTATE_Z: 1,
}  # fmt: skip
"""Numbers that an operation takes; angles are in degrees."""


@dataclass(frozen=True, eq=False)
class Transform:
    """A transform of the hierarchy, which may move.

    Parameters
    ----------
    properties : dict
        Of its compound ``.xform``: operations, their numbers, and whether it inherits.
    """

    properties: dict[str, Property]

    @property
    def times_s(self) -> list[Times]:
        """When it is sampled, for each thing that changes; empty if it does not move."""
        found = (self.properties.get(name) for name in (".vals", ".inherits"))
        return [one.times_s for one in found if one is not None and not one.is_constant]

    def inherits(self, time_s: float) -> bool:
        """Whether those above it apply to it too."""
        found = self.properties.get(".inherits")
        if found is None or found.header.n_samples == 0:
            return True
        before, after, share = between(found.times_s, time_s)
        return bool(found.numbers(after if share > 1 / 2 else before).any())

    def matrix(self, time_s: float) -> Matrix:
        """Its own matrix, of shape (4, 4); between two samples, between those."""
        values = self.properties.get(".vals")
        if values is None or ".ops" not in self.properties or values.header.n_samples == 0:
            return np.eye(4)
        before, after, share = between(values.times_s, time_s)
        if share == 0:
            return self._sample(before)
        return _blend(self._sample(before), self._sample(after), share)

    def _sample(self, index: int) -> Matrix:
        operations = self.properties[".ops"].whole_numbers() >> 4
        values = self.properties[".vals"].numbers(index).ravel().astype(np.float64)
        matrix, start = np.eye(4), 0
        for operation in operations.tolist():
            count = N_CHANNELS.get(operation, 0)
            channels = values[start : start + count]
            if not count or len(channels) < count:
                raise damaged(f"operation {operation} of a transform has {len(channels)} numbers")
            matrix = _operation(operation, channels) @ matrix
            start += count
        return matrix


def world_matrix(chain: Sequence[Transform], time_s: float) -> Matrix:
    """The matrix of a mesh below these transforms, the outermost first, of shape (4, 4)."""
    world = np.eye(4)
    for transform in chain:
        own = transform.matrix(time_s)
        world = own @ world if transform.inherits(time_s) else own
    return world


def placed(points: Vertices, world: Matrix) -> Vertices:
    """Points where a matrix puts them, in their own number type.

    Far from the origin, where float32 would move a point by more than a millionth of the mesh's
    size, float64.
    """
    linear, shift = world[:3, :3], world[3, :3]
    if (world == np.eye(4)).all():
        return points
    with np.errstate(all="ignore"):  # what is not finite is reported when frames are checked
        wide = points.astype(np.float64)
        moved: Vertices = (wide if (linear == np.eye(3)).all() else wide @ linear) + shift
        narrowing = Narrowing()
        narrowing.add(moved)
        is_narrow = points.dtype == np.float32 and narrowing.is_harmless
        return moved.astype(np.float32) if is_narrow else moved


def _operation(operation: int, channels: npt.NDArray[np.float64]) -> Matrix:
    if operation == MATRIX:
        return channels.reshape(4, 4)
    matrix = np.eye(4)
    if operation == SCALE:
        matrix[range(3), range(3)] = channels
    elif operation == TRANSLATE:
        matrix[3, :3] = channels
    elif operation == ROTATE:
        matrix[:3, :3] = _rotation(channels[:3], channels[3])
    else:
        matrix[:3, :3] = _rotation(np.eye(3)[operation - ROTATE_X], channels[0])
    return matrix


def _rotation(axis: npt.NDArray[np.float64], angle_deg: float) -> Matrix:
    """The matrix that turns rows about an axis (formula of Rodrigues)."""
    with np.errstate(all="ignore"):
        x, y, z = axis / (np.linalg.norm(axis) or 1.0)
        angle = np.deg2rad(angle_deg)
        cross = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
        turn: Matrix = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
        return turn


def _blend(first: Matrix, second: Matrix, share: float) -> Matrix:
    """A matrix between two: rotations turn evenly, the rest goes on a straight line."""
    from scipy.spatial.transform import Rotation

    blend = (1 - share) * first + share * second
    if not np.isfinite(blend).all():
        return blend
    turns, stretches = zip(*(_polar(one[:3, :3]) for one in (first, second)), strict=True)
    rotation = Rotation.from_matrix(turns[0].T @ turns[1]).as_rotvec() * share
    turn = turns[0] @ Rotation.from_rotvec(rotation).as_matrix()
    blend[:3, :3] = ((1 - share) * stretches[0] + share * stretches[1]) @ turn
    return blend


def _polar(linear: Matrix) -> tuple[Matrix, Matrix]:
    """A rotation and the stretch before it, whose product stretch @ rotation is `linear`."""
    left, _, right = np.linalg.svd(linear)
    turn = left @ right
    if np.linalg.det(turn) < 0:  # a mirror image: no rotation makes it
        turn = -turn
    return turn, linear @ turn.T
