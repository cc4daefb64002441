"""Primvars, normals and velocities of a mesh of a stage, which may change over time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.scenes.vector_transforms import Matrix, transform_normals, transform_vectors
from meshreel.formats.usd.primvars import DERIVED, DOMAINS, primvar_kind
from meshreel.formats.usd.sampling import Codes, attribute_codes
from meshreel.model.surface import Domain, Kind
from meshreel.model.tracks import NUMBER_TYPES, TrackKind
from meshreel.runtime.extras import USD

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
