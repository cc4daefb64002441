"""Reading primvars of a mesh as attributes: UVs, colors and other numbers."""

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.notes import UNCHANGING, note_kinds
from meshreel.formats.scenes.vector_transforms import Matrix, transform_normals, transform_vectors
from meshreel.formats.surfaces.polygons import PolygonMesh
from meshreel.formats.usd.sampling import Codes, attribute_codes
from meshreel.model.surface import MAX_COMPONENTS, VALUE_TYPES, Attribute, Domain, Kind
from meshreel.model.tracks import NUMBER_TYPES, TrackKind
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


READ_AS = {np.dtype(np.float16): np.float32, np.dtype(bool): np.uint8}
"""Conversions of number types that tracks do not support, without loss."""

TRACK_KIND, TRACK_NAME, UNIT = "meshreel:kind", "meshreel:name", "meshreel:unit"
"""Keys of the custom data that meshreel writes with tracks."""

COMPUTED = "meshreel:computed"
"""Key of the custom data of normals that meshreel computes from hard edges; they are no track."""

IS_ATTRIBUTE = "meshreel:attribute"
"""Key of the custom data of primvars that change only with the faces; they are no track."""


@dataclass(frozen=True, eq=False)
class Quantity:
    """A primvar or attribute with values per vertex, face or corner, at any time code.

    Parameters
    ----------
    name : str
        Name of the primvar or attribute.
    attribute : Usd.Attribute
        Has the time samples and the custom data.
    read : function of a time code
        Returns the stored numbers, of shape (N, C), or None.
    kind, role : str, default ""
        As in a `Field`.
    is_constant : bool, default False
        Whether a single value applies to all items.
    to_world : function of values and a world matrix, optional
        Transforms the values with the mesh.
    """

    name: str
    domain: Domain
    attribute: Any
    read: Callable[[float], Values | None]
    kind: str = ""
    role: str = ""
    is_constant: bool = False
    to_world: Callable[[Values, Matrix], Values] | None = None

    @property
    def codes(self) -> list[float]:
        """Time codes where it has samples."""
        return attribute_codes(self.attribute)

    def custom_data(self, key: str) -> str:
        """Return custom data that meshreel wrote; empty if there is none."""
        return str(self.attribute.GetCustomDataByKey(key) or "")

    def is_animated(self, codes: Codes) -> bool:
        """Return whether it is a track: marked as one, or not constant over these time codes."""
        if self.custom_data(TRACK_KIND):
            return True
        if any(self.attribute.GetCustomDataByKey(key) for key in (COMPUTED, IS_ATTRIBUTE)):
            return False
        if len(codes) < 2 or not self.attribute.ValueMightBeTimeVarying():
            return False
        first = self.read(float(codes[0]))
        return any(not _are_equal(first, self.read(float(code))) for code in codes[1:])

    def values(self, code: float, n_items: int) -> Values | None:
        """Return its values at a time code, of shape (N, C); None if missing or miscounted."""
        values = self.read(code)
        if values is None:
            return None
        if self.is_constant and len(values) == 1:
            values = np.repeat(values, n_items, axis=0)
        return values if len(values) == n_items else None


def _are_equal(first: Values | None, second: Values | None) -> bool:
    if first is None or second is None:
        return first is second
    is_same_type = first.shape == second.shape and first.dtype == second.dtype
    return is_same_type and first.tobytes() == second.tobytes()


def quantities(prim: Any) -> Iterator[Quantity]:
    """Yield the quantities of a mesh: primvars, normals, velocities and accelerations.

    A primvar called normals takes precedence over the attribute.
    """
    api = USD.load("UsdGeom").PrimvarsAPI(prim)
    for primvar in api.FindPrimvarsWithInheritance():
        name, interpolation = str(primvar.GetPrimvarName()), str(primvar.GetInterpolation())
        kind = primvar_kind(str(primvar.GetTypeName()), name)
        is_constant = interpolation == "constant"
        is_setting = is_constant and kind is not Kind.COLOR and name != "displayOpacity"
        is_ours = primvar.GetAttr().GetCustomDataByKey(TRACK_KIND) is not None
        if (DERIVED.match(name) and not is_ours) or is_setting or interpolation not in DOMAINS:
            continue
        yield Quantity(
            name,
            DOMAINS[interpolation],
            primvar.GetAttr(),
            partial(_primvar_values, primvar),
            "" if kind is Kind.OTHER else kind,
            is_constant=is_constant,
        )
    yield from _derived(prim)


def _derived(prim: Any) -> Iterator[Quantity]:
    """Yield normals, velocities and accelerations, which transform with the mesh."""
    geometry = USD.load("UsdGeom")
    if not prim.IsA(geometry.PointBased):
        return
    points = geometry.PointBased(prim)
    primvar = geometry.PrimvarsAPI(prim).FindPrimvarWithInheritance("normals")
    if primvar.HasAuthoredValue():
        interpolation, normals = str(primvar.GetInterpolation()), primvar.GetAttr()
        read = partial(_primvar_values, primvar)
    else:
        interpolation, normals = str(points.GetNormalsInterpolation()), points.GetNormalsAttr()
        read = partial(_attribute_values, normals)
    if normals.HasAuthoredValue() and interpolation in DOMAINS and interpolation != "constant":
        domain = DOMAINS[interpolation]
        yield Quantity("normals", domain, normals, read, "", NORMALS, False, transform_normals)
    velocities, accelerations = points.GetVelocitiesAttr(), points.GetAccelerationsAttr()
    for attribute, kind in ((velocities, TrackKind.VELOCITY), (accelerations, TrackKind.VECTOR)):
        if attribute.HasAuthoredValue():
            yield Quantity(
                str(attribute.GetName()),
                Domain.VERTEX,
                attribute,
                partial(_attribute_values, attribute),
                kind,
                to_world=transform_vectors,
            )


def _attribute_values(attribute: Any, code: float) -> Values | None:
    return _numbers(attribute.Get(code), 1)


def _primvar_values(primvar: Any, code: float) -> Values | None:
    """Return the values, of shape (N, C), with indices applied."""
    stored = primvar.Get(code)
    if stored is not None and not primvar.GetTypeName().isArray:
        stored = np.asarray(stored)[np.newaxis]
    values = _numbers(stored, int(primvar.GetElementSize()))
    if values is None or not primvar.IsIndexed():
        return values
    indices = np.asarray(primvar.GetIndices(code), np.int64)
    if not len(indices) or indices.min() < 0 or indices.max() >= len(values):
        return None
    return values[indices]


def _numbers(stored: Any, element_size: int) -> Values | None:
    """Return values as an array of shape (N, C), or None if tracks do not support the type."""
    if stored is None:
        return None
    values = np.asarray(stored)
    if values.size == 0:
        return None
    values = values.astype(READ_AS.get(values.dtype, values.dtype), copy=False)
    width = max(1, element_size) * int(np.prod(values.shape[1:]))
    if values.dtype not in NUMBER_TYPES or values.size % width:
        return None
    return values.reshape(-1, width)
