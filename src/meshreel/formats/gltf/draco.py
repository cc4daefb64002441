"""Primitives of a glTF file that Draco compressed."""

from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.entropy.varint import read_varint
from meshreel.errors import FormatError, MeshReelError
from meshreel.formats.extras import DRACO as LIBRARY
from meshreel.formats.gltf.accessors import WIDTHS, Accessors, Values, declared_type
from meshreel.formats.gltf.document import DRACO
from meshreel.formats.gltf.json_object import JsonObject
from meshreel.runtime.counting import counted

HEAD = b"DRACO\x02\x02\x01"
"""Of a triangle mesh in the bitstream 2.2, the only one that glTF allows."""
HEAD_BYTES = 11
SEQUENTIAL = 0


def decode_draco(primitive: JsonObject, accessors: Accessors) -> dict[str, Values]:
    """The arrays that Draco holds of a primitive, by the name of the attribute, and its "indices".

    Empty if it is not compressed.

    Raises
    ------
    FormatError
        If it cannot be decoded, or is not of the shapes that the file announces.
    """
    packed = primitive.extension(DRACO)
    if packed is None:
        return {}
    names, ids = primitive.needed("attributes"), packed.needed("attributes")
    accessors.document.item(packed, "bufferView", "bufferViews")
    data = bytes(accessors.buffers.view(packed.whole("bufferView"))[0])
    n_corners = accessors.count(primitive, "indices")
    _check_counts(data, accessors.count(names, "POSITION"), n_corners, packed.place)
    accessors.reserve(4 * n_corners, packed.place)
    library = LIBRARY.load()
    try:
        mesh = library.decode(data)
        held = {one["unique_id"]: np.asarray(one["data"]) for one in mesh.attributes}
        corners = np.asarray(mesh.faces).reshape(-1, 1)
    except Exception as error:  # DracoPy raises TypeError, ValueError and types of its own
        raise FormatError(f"{packed.place}: Draco cannot decode it ({error})") from None
    found = {"indices": Values(corners)}
    for name in ids.values:
        accessor = accessors.document.item(names, name, "accessors")
        found[name] = _values(held.get(ids.whole(name)), accessor, packed)
    return found


def _check_counts(data: bytes, n_verts: int, n_corners: int, place: str) -> None:
    """Refuse a stream that announces more than the file does: Draco takes memory for it."""
    if not data.startswith(HEAD) or data[8:9] not in (b"\x00", b"\x01"):
        raise FormatError(f"{place}: is no triangle mesh of Draco 2.2")
    is_sequential = data[8] == SEQUENTIAL
    try:
        first, position = read_varint(data, HEAD_BYTES + (0 if is_sequential else 1))
        second, _ = read_varint(data, position)
    except MeshReelError:
        raise FormatError(f"{place}: ends within the head of its Draco stream") from None
    announced_faces, announced_verts = (first, second) if is_sequential else (second, first)
    if announced_verts > n_verts or announced_faces * 3 > n_corners:
        raise FormatError(
            f"{place}: Draco holds {counted(announced_verts, 'vertex')} and "
            f"{counted(announced_faces, 'face')}; "
            f"the file announces {n_verts} and {n_corners // 3}"
        )


def _values(held: npt.NDArray[Any] | None, accessor: JsonObject, packed: JsonObject) -> Values:
    dtype, width = declared_type(accessor, tuple(WIDTHS))
    expected = accessor.whole("count"), width
    if held is None or held.shape != expected:
        came = "nothing" if held is None else f"values of shape {held.shape}"
        raise FormatError(
            f"{packed.place}: Draco holds {came} for {accessor.place}; expected {expected}"
        )
    return Values(held.astype(dtype), accessor.flag("normalized"))
