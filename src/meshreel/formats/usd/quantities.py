"""What a mesh of a stage carries and may change over time: primvars, normals, velocities."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from meshreel.arrays import Values
from meshreel.formats.extras import USD
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.scenes.turned_values import Matrix, turned_normals, turned_vectors
from meshreel.formats.usd.primvars import DERIVED, DOMAINS, primvar_kind
from meshreel.formats.usd.sampling import Codes, attribute_codes
from meshreel.model.surface import Domain, Kind
from meshreel.model.tracks import NUMBER_TYPES, TrackKind

READ_AS = {np.dtype(np.float16): np.float32, np.dtype(bool): np.uint8}
"""Types of files that tracks do not have, and those that hold the same numbers."""

TRACK_KIND, TRACK_NAME, UNIT = "meshreel:kind", "meshreel:name", "meshreel:unit"
"""Custom data of an attribute that we write as a track."""

COMPUTED = "meshreel:computed"
"""Custom data of normals that we compute from faces and hard edges: they are no track."""


@dataclass(frozen=True, eq=False)
class Quantity:
    """Values of each vertex, face or corner of a mesh, at any time code.

    Parameters
    ----------
    name : str
        Of the primvar or attribute.
    attribute : Usd.Attribute
        Says where it has samples, and what we wrote of it.
    given : function of a time code
        Gives the numbers of the file, of shape (N, C), or None if there are none.
    kind, role : str, default ""
        As of a `Field`.
    is_constant : bool, default False
        Whether one value is that of all.
    to_world : function of values and the transform of the mesh to the world, optional
        Turns them as the mesh is turned.
    """

    name: str
    domain: Domain
    attribute: Any
    given: Callable[[float], Values | None]
    kind: str = ""
    role: str = ""
    is_constant: bool = False
    to_world: Callable[[Values, Matrix], Values] | None = None

    @property
    def codes(self) -> list[float]:
        """Where it has samples."""
        return attribute_codes(self.attribute)

    def said(self, what: str) -> str:
        """What we wrote of it as a track; empty if we did not."""
        return str(self.attribute.GetCustomDataByKey(what) or "")

    def is_moving(self, codes: Codes) -> bool:
        """Whether it is a track: its values are not the same at all of these codes."""
        if self.said(TRACK_KIND):
            return True
        if self.attribute.GetCustomDataByKey(COMPUTED):
            return False
        if len(codes) < 2 or not self.attribute.ValueMightBeTimeVarying():
            return False
        first = self.given(float(codes[0]))
        return any(not _are_same(first, self.given(float(code))) for code in codes[1:])

    def values(self, code: float, n_items: int) -> Values | None:
        """Its values at a time code, of shape (N, C); None if there are none, or not as many."""
        values = self.given(code)
        if values is None:
            return None
        if self.is_constant and len(values) == 1:
            values = np.repeat(values, n_items, axis=0)
        return values if len(values) == n_items else None


def _are_same(first: Values | None, second: Values | None) -> bool:
    if first is None or second is None:
        return first is second
    is_alike = first.shape == second.shape and first.dtype == second.dtype
    return is_alike and first.tobytes() == second.tobytes()


def quantities(prim: Any) -> Iterator[Quantity]:
    """All that a mesh carries for vertices, faces or corners: primvars, and what depends on them.

    Of normals those that are drawn: the primvar of that name stands before the attribute.
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
    """Normals, velocities and accelerations, which are turned as the mesh is."""
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
        yield Quantity("normals", domain, normals, read, "", NORMALS, False, turned_normals)
    velocities, accelerations = points.GetVelocitiesAttr(), points.GetAccelerationsAttr()
    for attribute, kind in ((velocities, TrackKind.VELOCITY), (accelerations, TrackKind.VECTOR)):
        if attribute.HasAuthoredValue():
            yield Quantity(
                str(attribute.GetName()),
                Domain.VERTEX,
                attribute,
                partial(_attribute_values, attribute),
                kind,
                to_world=turned_vectors,
            )


def _attribute_values(attribute: Any, code: float) -> Values | None:
    return _numbers(attribute.Get(code), 1)


def _primvar_values(primvar: Any, code: float) -> Values | None:
    """Of shape (N, C), with one row for each item if there are indices."""
    given = primvar.Get(code)
    if given is not None and not primvar.GetTypeName().isArray:
        given = np.asarray(given)[np.newaxis]
    values = _numbers(given, int(primvar.GetElementSize()))
    if values is None or not primvar.IsIndexed():
        return values
    indices = np.asarray(primvar.GetIndices(code), np.int64)
    if not len(indices) or indices.min() < 0 or indices.max() >= len(values):
        return None
    return values[indices]


def _numbers(given: Any, element_size: int) -> Values | None:
    """Of shape (N, C); None if they are none that tracks can have."""
    if given is None:
        return None
    values = np.asarray(given)
    if values.size == 0:
        return None
    values = values.astype(READ_AS.get(values.dtype, values.dtype), copy=False)
    width = max(1, element_size) * int(np.prod(values.shape[1:]))
    if values.dtype not in NUMBER_TYPES or values.size % width:
        return None
    return values.reshape(-1, width)
