"""Reading primvars of a mesh as attributes: UVs, colors and other numbers."""

import re
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.notes import UNCHANGING, note_kinds
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.model.surface import MAX_COMPONENTS, VALUE_TYPES, Attribute, Domain, Kind
from meshreel.runtime.extras import USD

DOMAINS = {
    "vertex": Domain.VERTEX,
    "varying": Domain.VERTEX,
    "uniform": Domain.FACE,
    "faceVarying": Domain.CORNER,
    "constant": Domain.VERTEX,
}
STANDARD_NAMES = {Kind.UV: "st", Kind.COLOR: "displayColor"}
"""Standard names, which programs use by default."""

UV_NAME = re.compile(r"(st|uv|map|texcoord)", re.IGNORECASE)
DERIVED = re.compile(r"skel:|normals$|tangents$|bitangents$|binormals$")
"""Primvars that are read as motion, or follow from positions."""

CONVERTED_TYPES = {
    np.dtype(np.float16): np.float32,
    np.dtype(bool): np.uint8,
    np.dtype(np.uint32): np.int32,
}


@dataclass(frozen=True)
class _Candidate:
    """A primvar that may become an attribute."""

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
    animated: Collection[str] = (),
) -> tuple[Attribute, ...]:
    """Return the attributes of a mesh at a time code: UVs, colors, then others.

    Parameters
    ----------
    prim : Usd.Prim
        Prim of the mesh, which inherits primvars from prims above it.
    mesh : PolygonMesh
        The mesh at that time code.
    order : int64 array, optional
        The file corner of each corner of the mesh.
    notes : list of str
        Gains a sentence for each primvar that does not fit.
    animated : collection of str, optional
        Names of primvars that are read as tracks, and skipped here.
    """
    n_items = {
        Domain.VERTEX: len(mesh.vertices),
        Domain.FACE: len(mesh.counts),
        Domain.CORNER: len(mesh.corners),
    }
    attributes, mismatched = {}, []
    for one in _candidates(prim, notes, animated):
        attribute = _attribute(one, code, n_items)
        if attribute is None:
            mismatched.append(one.name)
        else:
            attributes[one.name] = _reordered(attribute, order)
    note_kinds(notes, "primvars that do not fit their faces", mismatched)
    _join_opacity(attributes)
    ranks = list(Kind)
    standard = STANDARD_NAMES.values()
    ordered = sorted(
        attributes.values(), key=lambda one: (ranks.index(one.kind), one.name not in standard)
    )
    return tuple(ordered)


def _candidates(prim: Any, notes: list[str], animated: Collection[str]) -> list[_Candidate]:
    candidates, settings = [], []
    for primvar in USD.load("UsdGeom").PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        name = str(primvar.GetPrimvarName())
        interpolation = str(primvar.GetInterpolation())
        kind = primvar_kind(str(primvar.GetTypeName()), name)
        is_constant = interpolation == "constant"
        # Constant primvars other than colors are settings of renderers, not attributes.
        is_setting = is_constant and kind is not Kind.COLOR and name != "displayOpacity"
        if DERIVED.match(name) or name in animated:
            continue
        if is_setting or interpolation not in DOMAINS:
            settings.append(name)
            continue
        candidates.append(_Candidate(primvar, name, kind, is_constant))
    note_kinds(notes, "primvars for a whole mesh", settings)
    _note_derived(prim, notes, animated)
    return candidates


def _note_derived(prim: Any, notes: list[str], animated: Collection[str]) -> None:
    """Note velocities and accelerations that are not tracks."""
    mesh = USD.load("UsdGeom").Mesh(prim)
    rates = (mesh.GetVelocitiesAttr(), mesh.GetAccelerationsAttr())
    static = [str(one.GetName()) for one in rates if one.HasAuthoredValue()]
    note_kinds(notes, UNCHANGING, (name for name in static if name not in animated))


def primvar_kind(type_name: str, name: str) -> Kind:
    """Return the kind of attribute for a primvar type and name."""
    if type_name.startswith("texCoord2"):
        return Kind.UV
    if re.match(r"(float|double|half)2\[", type_name) and UV_NAME.match(name):
        return Kind.UV
    return Kind.COLOR if re.match(r"color[34]", type_name) else Kind.OTHER


def _attribute(candidate: _Candidate, code: float, n_items: dict[Domain, int]) -> Attribute | None:
    """Return the attribute, or None if its values are not numeric or their count is wrong."""
    values = _values(candidate.primvar, code)
    if values is None:
        return None
    domain = DOMAINS[str(candidate.primvar.GetInterpolation())]
    expected = n_items[domain]
    if candidate.is_constant:
        indices = np.zeros(expected, np.int32)
        is_match = len(values) == 1
    elif candidate.primvar.IsIndexed():
        stored = candidate.primvar.GetIndices(code)
        indices = np.asarray([] if stored is None else stored, np.int32)
        is_match = len(indices) == expected
        is_match = is_match and indices.min(initial=0) >= 0 and indices.max(initial=0) < len(values)
    else:
        indices = None
        is_match = len(values) == expected
    return Attribute(candidate.name, candidate.kind, domain, values, indices) if is_match else None


def _values(primvar: Any, code: float) -> npt.NDArray[Any] | None:
    """Return the values, of shape (N, C), or None if an attribute cannot store them."""
    stored = primvar.Get(code)
    if stored is None:
        return None
    values = np.asarray(stored)
    if values.dtype.kind not in "fiub" or values.size == 0:
        return None
    if not primvar.GetTypeName().isArray:
        values = values[np.newaxis]
    width = max(1, int(primvar.GetElementSize())) * int(np.prod(values.shape[1:]))
    values = values.astype(CONVERTED_TYPES.get(values.dtype, values.dtype), copy=False)
    is_supported = (
        width <= MAX_COMPONENTS and values.size % width == 0 and values.dtype in VALUE_TYPES
    )
    return values.reshape(-1, width) if is_supported else None


def _reordered(attribute: Attribute, order: npt.NDArray[np.int64] | None) -> Attribute:
    """Return the attribute with corners in the order of the mesh."""
    if order is None or attribute.domain is not Domain.CORNER:
        return attribute
    if attribute.indices is not None:
        return replace(attribute, indices=attribute.indices[order])
    return replace(attribute, values=attribute.values[order])


def _join_opacity(attributes: dict[str, Attribute]) -> None:
    """Append opacity to the color as a fourth component, if both have the same items."""
    color, opacity = attributes.get("displayColor"), attributes.get("displayOpacity")
    if color is None or opacity is None or opacity.values.shape[1] != 1:
        return
    is_same_layout = (
        color.domain is opacity.domain
        and len(color.values) == len(opacity.values)
        and np.array_equal(color.indices, opacity.indices)  # type: ignore[arg-type]
    )
    if is_same_layout:
        joined = np.concatenate([color.values, opacity.values], axis=1)
        attributes["displayColor"] = replace(color, values=joined)
        del attributes["displayOpacity"]
