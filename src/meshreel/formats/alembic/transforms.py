"""Transforms of an Alembic hierarchy, and world matrices of meshes.

Points are row vectors, as in the file: a point is multiplied by the matrix of the innermost
transform first.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.archive import Property
from meshreel.formats.alembic.ogawa import damage_error
from meshreel.formats.alembic.time_sampling import Times, bracketing_samples
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.model.sequence import Vertices

Matrix = npt.NDArray[np.float64]

SCALE, TRANSLATE, ROTATE, MATRIX, ROTATE_X, ROTATE_Y, ROTATE_Z = range(7)
N_CHANNELS = {
    SCALE: 3, TRANSLATE: 3, ROTATE: 4, MATRIX: 16, ROTATE_X: 1, ROTATE_Y: 1, ROTATE_Z: 1,
}  # fmt: skip
"""Number of channels of each operation; angles are in degrees."""


@dataclass(frozen=True, eq=False)
class Transform:
    """A transform of the hierarchy, possibly animated.

    Parameters
    ----------
    properties : dict
        Contents of its compound ``.xform``: operations, channels, and the inheritance flag.
    """

    properties: dict[str, Property]

    @property
    def times_s(self) -> list[Times]:
        """Sample times of each animated property; empty if the transform is static."""
        properties = (self.properties.get(name) for name in (".vals", ".inherits"))
        return [one.times_s for one in properties if one is not None and not one.is_constant]

    def inherits(self, time_s: float) -> bool:
        """Return whether the parent transforms apply."""
        inherits = self.properties.get(".inherits")
        if inherits is None or inherits.header.n_samples == 0:
            return True
        before, after, weight = bracketing_samples(inherits.times_s, time_s)
        return bool(inherits.numbers(after if weight > 1 / 2 else before).any())

    def matrix(self, time_s: float) -> Matrix:
        """Return the local matrix at a time, interpolated between samples, of shape (4, 4)."""
        values = self.properties.get(".vals")
        if values is None or ".ops" not in self.properties or values.header.n_samples == 0:
            return np.eye(4)
        before, after, weight = bracketing_samples(values.times_s, time_s)
        if weight == 0:
            return self._sample(before)
        return _interpolate(self._sample(before), self._sample(after), weight)

    def _sample(self, index: int) -> Matrix:
        operations = self.properties[".ops"].integers() >> 4
        values = self.properties[".vals"].numbers(index).ravel().astype(np.float64)
        matrix, start = np.eye(4), 0
        for operation in operations.tolist():
            count = N_CHANNELS.get(operation, 0)
            channels = values[start : start + count]
            if not count or len(channels) < count:
                raise damage_error(
                    f"operation {operation} of a transform has {len(channels)} channels"
                )
            matrix = _operation(operation, channels) @ matrix
            start += count
        return matrix


def world_matrix(chain: Sequence[Transform], time_s: float) -> Matrix:
    """Return the world matrix below a chain of transforms, outermost first, of shape (4, 4)."""
    world = np.eye(4)
    for transform in chain:
        own = transform.matrix(time_s)
        world = own @ world if transform.inherits(time_s) else own
    return world


def transform_points(points: Vertices, world: Matrix) -> Vertices:
    """Return transformed points, in their own float type.

    The result is float64 if it is so far from the origin that float32 would move a point by more
    than a millionth of the mesh size.
    """
    linear, shift = world[:3, :3], world[3, :3]
    if (world == np.eye(4)).all():
        return points
    with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
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
    """Return the rotation about an axis for row vectors (Rodrigues' formula)."""
    with np.errstate(all="ignore"):
        x, y, z = axis / (np.linalg.norm(axis) or 1.0)
        angle = np.deg2rad(angle_deg)
        cross = np.array([[0, z, -y], [-z, 0, x], [y, -x, 0]])
        turn: Matrix = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)
        return turn


def _axis_and_angle(rotation: Matrix) -> tuple[npt.NDArray[np.float64], float]:
    """Return the axis, of any length, and the angle of a rotation for row vectors, in degrees."""
    products = np.empty((4, 4))  # of the quaternion with itself, times 4; its scalar comes first
    products[1:, 1:] = rotation + rotation.T + (1 - np.trace(rotation)) * np.eye(3)
    products[0, 0] = 1 + np.trace(rotation)
    products[0, 1:] = products[1:, 0] = [
        rotation[row, column] - rotation[column, row] for row, column in ((1, 2), (2, 0), (0, 1))
    ]
    quaternion = products[products.diagonal().argmax()]  # the largest one loses no digits
    quaternion = quaternion * np.copysign(1.0, quaternion[0])
    angle = 2 * np.arctan2(np.linalg.norm(quaternion[1:]), quaternion[0])
    return quaternion[1:], float(np.rad2deg(angle))


def _interpolate(first: Matrix, second: Matrix, weight: float) -> Matrix:
    """Return a matrix between two: rotations are interpolated spherically, the rest linearly."""
    blend = (1 - weight) * first + weight * second
    if not np.isfinite(blend).all():
        return blend
    rotations, stretches = zip(*(_polar(one[:3, :3]) for one in (first, second)), strict=True)
    axis, angle_deg = _axis_and_angle(rotations[0].T @ rotations[1])
    rotation = rotations[0] @ _rotation(axis, weight * angle_deg)
    blend[:3, :3] = ((1 - weight) * stretches[0] + weight * stretches[1]) @ rotation
    return blend


def _polar(linear: Matrix) -> tuple[Matrix, Matrix]:
    """Return the polar decomposition, stretch and rotation with stretch @ rotation == linear."""
    left, _, right = np.linalg.svd(linear)
    rotation = left @ right
    if np.linalg.det(rotation) < 0:  # a reflection goes into the stretch
        rotation = -rotation
    return rotation, linear @ rotation.T
