"""Primvars, normals and velocities of a mesh of a stage, which become attributes or tracks."""

import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from meshreel.arrays import Floats, Values
from meshreel.formats.frames.field_tracks import NORMALS
from meshreel.formats.scenes.quantities import Quantity
from meshreel.formats.scenes.transforms import transform_normals, transform_vectors
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.formats.usd.unread import StageContents
from meshreel.model.colors import colors_of_linear
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
COLOR, OPACITY, UVS = "displayColor", "displayOpacity", "st"
STANDARD_NAMES = {Kind.UV: UVS, Kind.COLOR: COLOR}
"""Standard names, which programs use by default."""

UV_TYPE, UV_NAME = re.compile(r"(float|double|half)2\["), re.compile(r"(?i:st|uv|map|texcoord)")
COLOR_TYPE = re.compile("color[34]")
DERIVED = re.compile(r"skel:|normals$|tangents$|bitangents$|binormals$")
"""Primvars that are read as motion, or follow from positions."""

READ_AS: dict[np.dtype[Any], Any] = {np.dtype(np.float16): np.float32, np.dtype(bool): np.uint8}
"""Conversions of number types that tracks do not support, without loss."""

SRGB_SPACES = ("srgb_rec709_scene", "sRGB", "srgb_texture")
LINEAR_SPACES = ("lin_rec709_scene", "", "auto", "lin_rec709", "lin_srgb", "linear")
"""Names of sRGB, and of linear Rec. 709, the default."""

TRACK_KIND, TRACK_NAME, UNIT = "meshreel:kind", "meshreel:name", "meshreel:unit"
"""Keys of the custom data that meshreel writes with tracks."""

COMPUTED, IS_ATTRIBUTE = "meshreel:computed", "meshreel:attribute"
"""Keys of the custom data of normals that meshreel computes from hard edges, and of primvars that
change only with the faces; they are no tracks."""


@dataclass(frozen=True, eq=False)
class StageQuantity(Quantity):
    """A quantity of a stage, whose attribute has the time samples and the custom data."""

    domain: Domain
    attribute: Any = None

    def custom_data(self, key: str) -> str:
        """Return custom data that meshreel wrote; empty if there is none."""
        return str(self.attribute.GetCustomDataByKey(key) or "")

    def is_animated(self, codes: Floats) -> bool:
        """Return whether it is a track: marked as one, or not constant over these time codes."""
        if self.custom_data(TRACK_KIND):
            return True
        if any(self.attribute.GetCustomDataByKey(key) for key in (COMPUTED, IS_ATTRIBUTE)):
            return False
        if len(codes) < 2 or not self.attribute.ValueMightBeTimeVarying():
            return False
        frames = (self.values(code) for code in codes.tolist())
        keys = (
            each if each is None else (each.shape, each.dtype, each.tobytes()) for each in frames
        )
        first = next(keys)
        return any(key != first for key in keys)


def _primvars(prim: Any) -> Iterator[tuple[Any, str, Kind, Domain | None]]:
    """Yield the primvars of a mesh, inherited ones included, with names, kinds and domains.

    The domain is None for settings of renderers, which constant primvars other than colors are.
    """
    for primvar in USD.load("UsdGeom").PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        name, type_name = str(primvar.GetPrimvarName()), str(primvar.GetTypeName())
        kind = Kind.COLOR if COLOR_TYPE.match(type_name) else Kind.OTHER
        if type_name.startswith("texCoord2") or (UV_TYPE.match(type_name) and UV_NAME.match(name)):
            kind = Kind.UV
        interpolation = str(primvar.GetInterpolation())
        is_shown = interpolation != "constant" or kind is Kind.COLOR or name == OPACITY
        yield primvar, name, kind, DOMAINS.get(interpolation) if is_shown else None


def read_attributes(
    prim: Any,
    code: float,
    n_items: Mapping[Domain, int],
    rows: Mapping[Domain, Any],
    contents: StageContents,
    animated: Collection[str] = (),
) -> tuple[Attribute, ...]:
    """Return the attributes of a mesh at a time code: UVs, colors, then others.

    Parameters
    ----------
    prim : Usd.Prim
        Prim of the mesh, which inherits primvars from prims above it.
    n_items : mapping of Domain to int
        Number of vertices, faces and corners in the file.
    rows : mapping of Domain to slice or array
        The items of the mesh among these.
    contents : StageContents
        Records the primvars that fit.
    animated : collection of str, optional
        Names of primvars that are read as tracks, and skipped here.
    """
    attributes: dict[str, Attribute] = {}
    for primvar, name, kind, domain in _primvars(prim):
        space = _color_space(primvar) if kind is Kind.COLOR else ""
        if space not in (*LINEAR_SPACES, *SRGB_SPACES):
            text = f"color space {space!r} of {name} is not supported; read as linear Rec. 709"
            contents.notes.unknown(text)
        if DERIVED.match(name) or name in animated:
            continue
        if domain and (attribute := _attribute(primvar, code, n_items[domain])):
            contents.add(primvar.GetAttr().GetPrim(), primvar.GetName())
            values, indices = attribute
            if indices is None:
                values = values[rows[domain]]
            else:
                indices = indices[rows[domain]]
            attributes[name] = Attribute(name, kind, domain, values, indices)
    _join_opacity(attributes)
    ranks, standard = list(Kind), STANDARD_NAMES.values()
    return tuple(
        sorted(
            attributes.values(),
            key=lambda attribute: (ranks.index(attribute.kind), attribute.name not in standard),
        )
    )


def _attribute(primvar: Any, code: float, n_items: int) -> tuple[Values, Any] | None:
    """Return values and indices, or None if they are not numeric or their count is wrong."""
    if (table := _table(primvar, code)) is None:
        return None
    values, indices = table
    if values.dtype == np.uint32:
        values = values.astype(np.int32)
    if values.dtype not in VALUE_TYPES or values.shape[1] > MAX_COMPONENTS:
        return None
    if primvar.GetInterpolation() == "constant":
        return (values, np.zeros(n_items, np.int32)) if len(values) == 1 else None
    return (values, indices) if len(values if indices is None else indices) == n_items else None


def _join_opacity(attributes: dict[str, Attribute]) -> None:
    """Append opacity to the color as a fourth component, if both have the same items."""
    color, opacity = attributes.get(COLOR), attributes.get(OPACITY)
    if color is None or opacity is None or opacity.values.shape[1] != 1:
        return
    if (
        color.domain is opacity.domain
        and len(color.values) == len(opacity.values)
        and np.array_equal(color.indices, opacity.indices)  # type: ignore[arg-type]
    ):
        rgba = np.concatenate([color.values, opacity.values], axis=1)
        attributes[COLOR] = replace(color, values=rgba)
        del attributes[OPACITY]


def _color_space(primvar: Any) -> str:
    return str(USD.load("Usd").ColorSpaceAPI.ComputeColorSpaceName(primvar.GetAttr(), None))


def quantities(prim: Any) -> Iterator[StageQuantity]:
    """Yield the quantities of a mesh: primvars, normals, velocities and accelerations.

    A primvar called normals takes precedence over the attribute.
    """
    for primvar, name, kind, domain in _primvars(prim):
        is_meshreel_track = primvar.GetAttr().GetCustomDataByKey(TRACK_KIND) is not None
        if domain is not None and (is_meshreel_track or not DERIVED.match(name)):
            yield _quantity(name, domain, primvar.GetAttr(), primvar, kind)
    geometry = USD.load("UsdGeom")
    points = geometry.PointBased(prim)
    primvar = geometry.PrimvarsAPI(prim).FindPrimvarWithInheritance("normals")
    interpolation, normals = str(points.GetNormalsInterpolation()), points.GetNormalsAttr()
    if primvar.HasAuthoredValue():
        interpolation, normals = str(primvar.GetInterpolation()), primvar.GetAttr()
    else:
        primvar = None
    if normals.HasAuthoredValue() and interpolation in DOMAINS and interpolation != "constant":
        normal = _quantity("normals", DOMAINS[interpolation], normals, primvar)
        yield replace(normal, role=NORMALS, to_world=transform_normals)
    rates = (
        (points.GetVelocitiesAttr(), TrackKind.VELOCITY),
        (points.GetAccelerationsAttr(), TrackKind.VECTOR),
    )
    for attribute, rate_kind in rates:
        if attribute.HasAuthoredValue():
            rate = _quantity(str(attribute.GetName()), Domain.VERTEX, attribute, None, rate_kind)
            yield replace(rate, to_world=transform_vectors)


def _quantity(
    name: str, domain: Domain, attribute: Any, primvar: Any, kind: str = ""
) -> StageQuantity:
    """Return the quantity of an attribute, which may be that of a primvar."""

    def values(code: float) -> Values | None:
        if primvar is None:
            return _numbers(attribute.Get(code), 1)
        rows, indices = _table(primvar, code) or (None, None)
        if rows is None or indices is None:
            return rows
        return rows[indices] if len(indices) else None

    return StageQuantity(
        name,
        domain,
        values,
        lambda: np.asarray(attribute_codes(attribute)),
        str(attribute.GetCustomDataByKey(TRACK_KIND) or ("" if kind is Kind.OTHER else kind)),
        unit=str(attribute.GetCustomDataByKey(UNIT) or ""),
        is_constant=primvar is not None and primvar.GetInterpolation() == "constant",
        attribute=attribute,
    )


def _table(primvar: Any, code: float) -> tuple[Values, Any] | None:
    """Return the values of a primvar, of shape (N, C), and its indices; None if it is invalid.

    Colors are in sRGB.
    """
    vt_array = primvar.Get(code)
    if vt_array is not None and not primvar.GetTypeName().isArray:
        vt_array = np.asarray(vt_array)[np.newaxis]
    values = _numbers(vt_array, int(primvar.GetElementSize()))
    if values is None:
        return None
    is_color = COLOR_TYPE.match(str(primvar.GetTypeName()))
    if is_color and _color_space(primvar) not in SRGB_SPACES:
        values = colors_of_linear(values)
    if not primvar.IsIndexed():
        return values, None
    vt_array = primvar.GetIndices(code)
    indices = np.asarray([] if vt_array is None else vt_array, np.int32)
    is_valid = indices.min(initial=0) >= 0 and indices.max(initial=0) < len(values)
    return (values, indices) if is_valid else None


def _numbers(vt_array: Any, element_size: int) -> Values | None:
    """Return values as an array of shape (N, C), or None if tracks do not support the type."""
    values = np.asarray([] if vt_array is None else vt_array)
    if values.size == 0:
        return None
    values = values.astype(READ_AS.get(values.dtype, values.dtype), copy=False)
    width = max(1, element_size) * math.prod(values.shape[1:])
    if values.dtype not in NUMBER_TYPES or values.size % width:
        return None
    return values.reshape(-1, width)


def by_track_name(animated: Mapping[str, StageQuantity]) -> dict[str, StageQuantity]:
    """Return animated quantities by track name: as written by meshreel, or else as in the file.

    A color and its opacity become one quantity if they have the same items.
    """
    by_name = dict(animated)
    color, opacity = by_name.get(COLOR), by_name.get(OPACITY)
    if color is not None and opacity is not None and _layout(color) == _layout(opacity):
        by_name[COLOR] = replace(color, values=partial(_read_rgba, color, opacity))
        del by_name[OPACITY]
    names = {name: quantity.custom_data(TRACK_NAME) or name for name, quantity in by_name.items()}
    track_names = list(names.values())
    return {
        names[name] if track_names.count(names[name]) == 1 else name: by_name[name]
        for name in by_name
    }


def _layout(quantity: StageQuantity) -> tuple[Any, ...]:
    codes = quantity.times().tolist()
    return quantity.domain, quantity.is_constant, quantity.custom_data(TRACK_NAME), codes


def _read_rgba(color: Quantity, opacity: Quantity, code: float) -> Values | None:
    """Return color and opacity as four components, or None if their counts differ."""
    first, second = color.values(code), opacity.values(code)
    if first is None or second is None or len(first) != len(second) or second.shape[1] != 1:
        return None
    return np.concatenate([first, second], axis=1)
