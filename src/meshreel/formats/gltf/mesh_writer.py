"""Writing a part of a sequence as a glTF mesh: primitives, morph targets and weights."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.gltf.buffer_writer import BufferWriter, Json, VertexValues
from meshreel.formats.gltf.material_writer import Materials
from meshreel.formats.gltf.morph_mesh import MorphMesh
from meshreel.formats.gltf.quantized import BYTE, IntegerTargets
from meshreel.formats.gltf.seams import Primitive, SplitVertices

Values = dict[str, VertexValues]


@dataclass(frozen=True, eq=False)
class VertexData:
    """Buffer locations of the vertex attributes of a mesh and its morph targets.

    Attributes
    ----------
    base : dict of str to VertexValues
    targets : list of dict of str to VertexValues
    """

    base: Values
    targets: list[Values]


def write_mesh(
    name: str,
    split: SplitVertices,
    morph_mesh: MorphMesh,
    buffer: BufferWriter,
    materials: Materials,
) -> Json:
    """Return the JSON of a mesh, whose values are added to the buffer.

    Parameters
    ----------
    name : str
    split : SplitVertices
        Vertices that faces use, split at seams.
    morph_mesh : MorphMesh
        Motion of the vertices before the split.
    buffer, materials
        Receive the values and the materials of the mesh.
    """
    data = _write_vertices(split, morph_mesh, buffer)
    primitives = [_primitive(one, data, buffer, materials) for one in split.primitives]
    mesh: Json = {"name": name, "primitives": primitives}
    if morph_mesh.morphs is None:
        return mesh
    names = [f"mode {number + 1}" for number in range(len(data.targets))]
    # Viewers show the first frame when the animation is not played.
    return mesh | {
        "weights": morph_mesh.morphs.weights[0].tolist(),
        "extras": {"targetNames": names},
    }


def _write_vertices(
    split: SplitVertices, morph_mesh: MorphMesh, buffer: BufferWriter
) -> VertexData:
    base = {"POSITION": _add_vertices(morph_mesh.base, split, buffer)}
    if morph_mesh.normals is not None:
        base["NORMAL"] = buffer.add_vertices([morph_mesh.normals.base[split.rows]])[0]
    for name, values in split.attributes.items():
        base[name] = buffer.add_vertices([values])[0]
    if morph_mesh.morphs is None:
        return VertexData(base, [])
    targets = [{"POSITION": one} for one in _positions(morph_mesh.morphs.targets, split, buffer)]
    if morph_mesh.normals is not None:
        # All targets must have the same attributes, so those without normals share zeros.
        zeros = np.zeros((1, *morph_mesh.normals.base.shape), np.int8)
        arrays = np.concatenate([morph_mesh.normals.targets, zeros])
        *displacements, zero_values = buffer.add_vertices([one[split.rows] for one in arrays])
        of_target = dict(zip(morph_mesh.normals.numbers.tolist(), displacements, strict=True))
        for number, target in enumerate(targets):
            target["NORMAL"] = of_target.get(number, zero_values)
    return VertexData(base, targets)


def _add_vertices(
    values: npt.NDArray[Any], split: SplitVertices, buffer: BufferWriter
) -> VertexValues:
    return buffer.add_vertices([values[split.sources]])[0]


def _positions(
    targets: IntegerTargets, split: SplitVertices, buffer: BufferWriter
) -> list[VertexValues]:
    """Add the positions of every target, those of the same type in one buffer view."""
    stored_values: dict[int, VertexValues] = {}
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
            stored_values |= zip(numbers.tolist(), buffer.add_vertices(arrays), strict=True)
    return [stored_values[number] for number in range(len(targets))]


def _primitive(
    one: Primitive, data: VertexData, buffer: BufferWriter, materials: Materials
) -> Json:
    def accessors(values: Values) -> dict[str, int]:
        return {
            name: buffer.vertex_accessor(name, stored, one.verts) for name, stored in values.items()
        }

    primitive: Json = {
        "attributes": accessors(data.base),
        "indices": buffer.add_indices(one.triangles.ravel()),
        "material": materials.index(one.material),
    }
    if data.targets:
        primitive["targets"] = [accessors(target) for target in data.targets]
    return primitive
