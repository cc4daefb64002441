"""Primitives of a glTF file that Draco compressed."""

import DracoPy
import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.gltf.accessors import WIDTHS, Accessors, Values, declared_type
from meshreel.formats.gltf.document import DRACO
from meshreel.formats.gltf.json_object import JsonObject


def decode_draco(primitive: JsonObject, accessors: Accessors) -> dict[str, Values]:
    """What Draco holds of a primitive, by the name of the attribute, and its "indices".

    Empty if it is not compressed.

    Raises
    ------
    FormatError
        If it cannot be decoded, or is not of the shapes that the file announces.
    """
    packed = primitive.extension(DRACO)
    if packed is None:
        return {}
    accessors.document.item(packed, "bufferView", "bufferViews")
    data, _ = accessors.buffers.view(packed.whole("bufferView"))
    try:
        mesh = DracoPy.decode(bytes(data))
        held = {one["unique_id"]: np.asarray(one["data"]) for one in mesh.attributes}
        faces = np.asarray(mesh.faces)
    except Exception as error:  # DracoPy raises TypeError, ValueError and types of its own
        raise FormatError(f"{packed.place}: Draco cannot decode it ({error})") from None
    found = {"indices": Values(faces.reshape(-1, 1))}
    names, ids = primitive.needed("attributes"), packed.needed("attributes")
    for name in ids.values:
        index = accessors.document.index(names, name, "accessors")
        if index is not None:
            accessor = accessors.document.lists["accessors"][index]
            found[name] = _values(held.get(ids.whole(name)), accessor, packed)
    return found


def _values(
    held: np.ndarray[tuple[int, ...], np.dtype[np.generic]] | None,
    accessor: JsonObject,
    packed: JsonObject,
) -> Values:
    dtype, width = declared_type(accessor, tuple(WIDTHS))
    expected = accessor.whole("count"), width
    if held is None or held.shape != expected:
        came = "nothing" if held is None else f"shape {held.shape}"
        raise FormatError(f"{packed.place}: Draco holds {came} of {accessor.place}, not {expected}")
    return Values(held.astype(dtype), accessor.flag("normalized"))
