"""A part of a sequence to a mesh of a glTF file: primitives, morph targets and weights."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.buffer_writer import BufferWriter, Json, VertexValues
from meshreel.formats.gltf.material_writer import Materials
from meshreel.formats.gltf.moving_mesh import MovingMesh
from meshreel.formats.gltf.quantized import BYTE, IntegerTargets
from meshreel.formats.gltf.seams import Primitive, SplitVertices

Values = dict[str, VertexValues]


@dataclass(frozen=True, eq=False)
class VertexData:
    """Where the buffer has what is known of the vertices of a mesh.

    Attributes
    ----------
    base : dict of str to VertexValues
    targets : list of dict of str to VertexValues
    """

    base: Values
    targets: list[Values]


def write_mesh(
    name: str, split: SplitVertices, moving: MovingMesh, buffer: BufferWriter, materials: Materials
) -> Json:
    """A mesh as it stands in the JSON; its values are added to the buffer.

    Parameters
    ----------
    split : SplitVertices
        Of the vertices that faces use.
    moving : MovingMesh
        Of the same vertices.
    buffer, materials
        Gain what the mesh needs.
    """
    data = _write_vertices(split, moving, buffer)
    primitives = [_primitive(one, data, buffer, materials) for one in split.primitives]
    mesh: Json = {"name": name, "primitives": primitives}
    if moving.morphs is None:
        return mesh
    names = [f"mode {number + 1}" for number in range(len(data.targets))]
    # Where the animation is not played, the first frame is seen.
    return mesh | {
        "weights": moving.morphs.weights[0].tolist(),
        "extras": {"targetNames": names},
    }


def _write_vertices(split: SplitVertices, moving: MovingMesh, buffer: BufferWriter) -> VertexData:
    base = {"POSITION": _added(moving.base, split, buffer)}
    if moving.normals is not None:
        base["NORMAL"] = buffer.add_vertices([moving.normals.base[split.rows]])[0]
    for name, values in split.attributes.items():
        base[name] = buffer.add_vertices([values])[0]
    if moving.morphs is None:
        return VertexData(base, [])
    targets = [{"POSITION": one} for one in _positions(moving.morphs.targets, split, buffer)]
    if moving.normals is not None:
        # Every target must have the same attributes: those that turn no normals share zeros.
        still = np.zeros((1, *moving.normals.base.shape), np.int8)
        arrays = np.concatenate([moving.normals.targets, still])
        *turned, zeros = buffer.add_vertices([one[split.rows] for one in arrays])
        of_target = dict(zip(moving.normals.numbers.tolist(), turned, strict=True))
        for number, target in enumerate(targets):
            target["NORMAL"] = of_target.get(number, zeros)
    return VertexData(base, targets)


def _added(values: npt.NDArray[Any], split: SplitVertices, buffer: BufferWriter) -> VertexValues:
    return buffer.add_vertices([values[split.sources]])[0]


def _positions(
    targets: IntegerTargets, split: SplitVertices, buffer: BufferWriter
) -> list[VertexValues]:
    """Those of every target; those of one type follow one another in the buffer."""
    found: dict[int, VertexValues] = {}
    are_bytes = targets.levels == BYTE
    for dtype, numbers in (
        (np.int16, np.flatnonzero(~are_bytes)),
        (np.int8, np.flatnonzero(are_bytes)),
    ):
        arrays = [
            targets.integers[number].reshape(-1, 3)[split.sources].astype(dtype)
            for number in numbers
        ]
        if arrays:
            found |= zip(numbers.tolist(), buffer.add_vertices(arrays), strict=True)
    return [found[number] for number in range(len(targets))]


def _primitive(
    one: Primitive, data: VertexData, buffer: BufferWriter, materials: Materials
) -> Json:
    def accessors(values: Values) -> dict[str, int]:
        return {
            name: buffer.vertex_accessor(name, there, one.verts) for name, there in values.items()
        }

    primitive: Json = {
        "attributes": accessors(data.base),
        "indices": buffer.add_indices(one.triangles.ravel()),
        "material": materials.number(one.material),
    }
    if data.targets:
        primitive["targets"] = [accessors(target) for target in data.targets]
    return primitive
