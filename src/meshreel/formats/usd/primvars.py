"""Primvars of a mesh as attributes: texture coordinates, colours and other numbers."""

import re
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.extras import USD
from meshreel.formats.notes import UNCHANGING, note_kinds
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import MAX_NUMBERS, VALUE_TYPES, Attribute, Domain, Kind

DOMAINS = {
    "vertex": Domain.VERTEX,
    "varying": Domain.VERTEX,
    "uniform": Domain.FACE,
    "faceVarying": Domain.CORNER,
    "constant": Domain.VERTEX,
}
MAIN_NAMES = {Kind.UV: "st", Kind.COLOR: "displayColor"}
"""The names that programs look for first."""

UV_NAME = re.compile(r"(st|uv|map|texcoord)", re.IGNORECASE)
DERIVED = re.compile(r"skel:|normals$|tangents$|bitangents$|binormals$")
"""Primvars that are read as the motion, or follow from the positions."""

TYPES = {
    np.dtype(np.float16): np.float32,
    np.dtype(bool): np.uint8,
    np.dtype(np.uint32): np.int32,
}


@dataclass(frozen=True)
class _Found:
    """A primvar that is an attribute, by its kind."""

    primvar: Any
    name: str
    kind: Kind
    is_constant: bool


def read_attributes(
    prim: Any,
    code: float,
    mesh: PolygonMesh,
    order: npt.NDArray[np.int64] | None,
    notes: list[str],
    moving: Collection[str] = (),
) -> tuple[Attribute, ...]:
    """Attributes of a mesh at a time code: texture coordinates, colours, others.

    Parameters
    ----------
    prim : Usd.Prim
        The mesh; it has what prims above it have for all that is below them, too.
    mesh : PolygonMesh
        The same at that time code.
    order : int64 array, optional
        The corner of the file that each corner of the mesh is.
    notes : list of str
        Gains a sentence for each primvar that does not fit.
    moving : collection of str, optional
        Names of what is passed over, for it is a track.
    """
    n_items = {
        Domain.VERTEX: len(mesh.vertices),
        Domain.FACE: len(mesh.counts),
        Domain.CORNER: len(mesh.corners),
    }
    found, unfit = {}, []
    for one in _candidates(prim, notes, moving):
        attribute = _attribute(one, code, n_items)
        if attribute is None:
            unfit.append(one.name)
        else:
            found[one.name] = _reordered(attribute, order)
    note_kinds(notes, "primvars that do not fit their faces", unfit)
    _join_opacity(found)
    ranks = list(Kind)
    main = MAIN_NAMES.values()
    ordered = sorted(found.values(), key=lambda one: (ranks.index(one.kind), one.name not in main))
    return tuple(ordered)


def _candidates(prim: Any, notes: list[str], moving: Collection[str]) -> list[_Found]:
    chosen, settings = [], []
    for primvar in USD.load("UsdGeom").PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        name = str(primvar.GetPrimvarName())
        interpolation = str(primvar.GetInterpolation())
        kind = primvar_kind(str(primvar.GetTypeName()), name)
        is_constant = interpolation == "constant"
        # Beside a colour, what is the same everywhere is a setting and not of the surface.
        is_setting = is_constant and kind is not Kind.COLOR and name != "displayOpacity"
        if DERIVED.match(name) or name in moving:
            continue
        if is_setting or interpolation not in DOMAINS:
            settings.append(name)
            continue
        chosen.append(_Found(primvar, name, kind, is_constant))
    note_kinds(notes, "primvars for a whole mesh", settings)
    _note_derived(prim, notes, moving)
    return chosen


def _note_derived(prim: Any, notes: list[str], moving: Collection[str]) -> None:
    """Add to the notes velocities that are no tracks."""
    mesh = USD.load("UsdGeom").Mesh(prim)
    rates = (mesh.GetVelocitiesAttr(), mesh.GetAccelerationsAttr())
    still = [str(one.GetName()) for one in rates if one.HasAuthoredValue()]
    note_kinds(notes, UNCHANGING, (name for name in still if name not in moving))


def primvar_kind(type_name: str, name: str) -> Kind:
    """What a primvar of a type and a name means."""
    if type_name.startswith("texCoord2"):
        return Kind.UV
    if re.match(r"(float|double|half)2\[", type_name) and UV_NAME.match(name):
        return Kind.UV
    return Kind.COLOR if re.match(r"color[34]", type_name) else Kind.OTHER


def _attribute(found: _Found, code: float, n_items: dict[Domain, int]) -> Attribute | None:
    """The attribute, or None if its values are not numbers or not as many as there must be."""
    values = _values(found.primvar, code)
    if values is None:
        return None
    domain = DOMAINS[str(found.primvar.GetInterpolation())]
    expected = n_items[domain]
    if found.is_constant:
        indices = np.zeros(expected, np.int32)
        is_fit = len(values) == 1
    elif found.primvar.IsIndexed():
        given = found.primvar.GetIndices(code)
        indices = np.asarray([] if given is None else given, np.int32)
        is_fit = len(indices) == expected
        is_fit = is_fit and indices.min(initial=0) >= 0 and indices.max(initial=0) < len(values)
    else:
        indices = None
        is_fit = len(values) == expected
    return Attribute(found.name, found.kind, domain, values, indices) if is_fit else None


def _values(primvar: Any, code: float) -> npt.NDArray[Any] | None:
    """Of shape (N, C); None if they are not numbers that an attribute can hold."""
    given = primvar.Get(code)
    if given is None:
        return None
    values = np.asarray(given)
    if values.dtype.kind not in "fiub" or values.size == 0:
        return None
    if not primvar.GetTypeName().isArray:
        values = values[np.newaxis]
    width = max(1, int(primvar.GetElementSize())) * int(np.prod(values.shape[1:]))
    values = values.astype(TYPES.get(values.dtype, values.dtype), copy=False)
    is_fit = width <= MAX_NUMBERS and values.size % width == 0 and values.dtype in VALUE_TYPES
    return values.reshape(-1, width) if is_fit else None


def _reordered(attribute: Attribute, order: npt.NDArray[np.int64] | None) -> Attribute:
    """With corners that go around the other way."""
    if order is None or attribute.domain is not Domain.CORNER:
        return attribute
    if attribute.indices is not None:
        return replace(attribute, indices=attribute.indices[order])
    return replace(attribute, values=attribute.values[order])


def _join_opacity(found: dict[str, Attribute]) -> None:
    """Make the opacity the fourth number of the colour, where both are given alike."""
    color, opacity = found.get("displayColor"), found.get("displayOpacity")
    if color is None or opacity is None or opacity.values.shape[1] != 1:
        return
    is_alike = (
        color.domain is opacity.domain
        and len(color.values) == len(opacity.values)
        and np.array_equal(color.indices, opacity.indices)  # type: ignore[arg-type]
    )
    if is_alike:
        joined = np.concatenate([color.values, opacity.values], axis=1)
        found["displayColor"] = replace(color, values=joined)
        del found["displayOpacity"]
