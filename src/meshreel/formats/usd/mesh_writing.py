"""Writing a mesh of a stage: faces and attributes once per segment, points frame by frame."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.frames.shared_data import Key
from meshreel.formats.scenes.parts import PartMesh
from meshreel.formats.usd.material_reading import MATERIALS
from meshreel.formats.usd.material_writing import Materials, set_display_name
from meshreel.formats.usd.prim_names import prim_name, unique_name
from meshreel.formats.usd.primvars import STANDARD_NAMES
from meshreel.formats.usd.quantities import COMPUTED, IS_ATTRIBUTE
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Surface
from meshreel.runtime.extras import USD

INTERPOLATIONS = {
    Domain.VERTEX: "vertex",
    Domain.FACE: "uniform",
    Domain.CORNER: "faceVarying",
}
BYTE_COLORS = "colors are written as float32, not bytes, since USD has no byte colors"
NARROW_COLORS = "colors are rounded to float32"


class MeshWriter:
    """Writes a mesh at a path of a stage: faces at once, points frame by frame.

    Parameters
    ----------
    stage : Usd.Stage
    part : PartMesh
        The mesh in the first segment.
    has_normals : bool
        Whether to write normals computed from hard edges.

    Attributes
    ----------
    prim : Usd.Prim
    part : PartMesh
        The mesh in the current segment.
    """

    def __init__(self, stage: Any, path: str, part: PartMesh, *, has_normals: bool) -> None:
        geometry = USD.load("UsdGeom")
        _define_ancestors(stage, path)
        self._mesh = geometry.Mesh.Define(stage, path)
        self._mesh.CreateSubdivisionSchemeAttr(geometry.Tokens.none)
        self.prim, self.part = self._mesh.GetPrim(), part
        self._points, self._extent = self._mesh.CreatePointsAttr(), self._mesh.CreateExtentAttr()
        self._array = USD.load("Vt").Vec3fArray
        self._shading: RowNormals | None = None
        self._normals = _normals_primvar(self.prim) if has_normals else None

    def begin(self, part: PartMesh, code: float | None) -> None:
        """Write the faces of a segment.

        Parameters
        ----------
        code : float or None
            The time code; None writes the default value, of the only segment.
        """
        self.part, when = part, _time_code(code)
        integers = USD.load("Vt").IntArray
        self._mesh.CreateFaceVertexCountsAttr().Set(integers.FromNumpy(part.counts), when)
        self._mesh.CreateFaceVertexIndicesAttr().Set(integers.FromNumpy(part.corners), when)
        if self._normals is not None:
            n_verts = part.verts.stop - part.verts.start
            hard_edges = part.surface.hard_edges
            self._shading = RowNormals(part.counts, part.corners, hard_edges, n_verts)
            self._normals.SetIndices(integers.FromNumpy(self._shading.rows.of_corner), when)

    def write_points(self, frame: npt.NDArray[np.float32], code: float | None) -> None:
        """Write points of a frame, their extent, and normals if the mesh has them.

        Parameters
        ----------
        frame : float32 array of shape (V, 3)
            Positions of all vertices of the sequence.
        code : float or None
            The time code; None writes the default value.
        """
        points = np.ascontiguousarray(frame[self.part.verts])
        extent = np.stack([points.min(axis=0), points.max(axis=0)])
        when = _time_code(code)
        self._points.Set(self._array.FromNumpy(points), when)
        self._extent.Set(self._array.FromNumpy(extent), when)
        if self._normals is not None and self._shading is not None:
            normals = self._shading.of_frames(points[np.newaxis])[0].astype(np.float32)
            self._normals.Set(self._array.FromNumpy(np.ascontiguousarray(normals)), when)


def _time_code(code: float | None) -> Any:
    """Return a time code of USD; None is that of the default value."""
    return USD.load("Usd").TimeCode.Default() if code is None else code


def _normals_primvar(prim: Any) -> Any:
    """Return a primvar of corner normals, marked as computed."""
    api, sdf = USD.load("UsdGeom").PrimvarsAPI(prim), USD.load("Sdf")
    normals = api.CreatePrimvar("normals", sdf.ValueTypeNames.Normal3fArray, "faceVarying")
    normals.GetAttr().SetCustomDataByKey(COMPUTED, True)
    return normals


def _define_ancestors(stage: Any, path: str) -> None:
    """Define missing prims above a path as transforms."""
    elements = path.split("/")[1:-1]
    for n_elements in range(1, len(elements) + 1):
        above = "/" + "/".join(elements[:n_elements])
        if not stage.GetPrimAtPath(above):
            USD.load("UsdGeom").Xform.Define(stage, above)


def write_surface(
    prim: Any,
    surface: Surface,
    n_faces: int,
    materials: Materials,
    notes: list[str],
    codes: Sequence[float | None] = (None,),
    all_labels: Mapping[Key, tuple[str, ...]] | None = None,
) -> None:
    """Write the attributes and groups of a mesh to its prim.

    The first UVs are called ``st`` and the first colors ``displayColor``, unless other attributes
    have these names.

    Parameters
    ----------
    prim : Usd.Prim
    surface : Surface
        Without parts.
    notes : list of str
        Gains a sentence where USD stores another number type.
    codes : sequence of float or None
        Time codes of the samples; None writes the default value. Floats need a sample at the first
        and the last frame of a segment, since USD interpolates them.
    all_labels : dict, optional
        Labels of the groups in all segments, if there are several.
    """
    api = USD.load("UsdGeom").PrimvarsAPI(prim)
    for attribute, name in primvar_names(surface):
        _write_attribute(api, attribute, name, notes, codes)
    subsets: set[str] = set()
    for groups in surface.groups:
        one = groups if all_labels is None else _with_labels(groups, all_labels[(groups.name,)])
        is_single = len(one.labels) == 1 and (one.numbers == 0).all() and all_labels is None
        if one.name == "material":
            materials.write_double_sided(prim, one)
        if one.name == "material" and is_single:
            materials.bind(prim, one.labels[0])
        else:
            _write_groups(prim, one, materials, subsets, codes[0])


def _with_labels(groups: FaceGroups, labels: tuple[str, ...]) -> FaceGroups:
    """Return groups with further labels, in the order of all of them."""
    new = [*map(labels.index, groups.labels), -1]
    return FaceGroups(groups.name, labels, np.array(new, np.int32)[groups.numbers])


def uv_primvars(surface: Surface) -> dict[str, str]:
    """Return the primvar of each UV set, by name of its attribute."""
    names = [(one.name, name) for one, name in primvar_names(surface) if one.kind is Kind.UV]
    return dict(reversed(names))


def primvar_names(surface: Surface) -> list[tuple[Attribute, str]]:
    """Return attributes with their unique primvar names."""
    names = {id(one): prim_name(one.name) for one in surface.attributes}
    for kind, standard in STANDARD_NAMES.items():
        own = surface.of_kind(kind)
        if own and standard not in names.values():
            names[id(own[0])] = standard
    used: set[str] = set()
    return [(one, unique_name(names[id(one)], used)) for one in surface.attributes]


def _write_attribute(
    api: Any,
    attribute: Attribute,
    name: str,
    notes: list[str],
    codes: Sequence[float | None],
) -> None:
    values = attribute.values
    if attribute.kind is Kind.COLOR and values.dtype != np.float32:
        note = BYTE_COLORS if values.dtype == np.uint8 else NARROW_COLORS
        if note not in notes:
            notes.append(note)
        scale = 255 if values.dtype == np.uint8 else 1
        values = (values / scale).astype(np.float32)
    if name == "displayColor" and values.shape[1] == 4:
        _write_primvar(api, attribute, "displayOpacity", "float", values[:, 3:], codes)
        values = values[:, :3]
    _write_primvar(api, attribute, name, _type_name(attribute.kind, values), values, codes)


def _type_name(kind: Kind, values: npt.NDArray[Any]) -> str:
    """Return USD's name of the element type."""
    letter = {"u1": "uchar", "i4": "int", "f4": "float", "f8": "double"}[values.dtype.str[1:]]
    if kind is Kind.UV and values.shape[1] == 2 and values.dtype.kind == "f":
        return f"texCoord2{letter[0]}"
    if kind is Kind.COLOR and values.shape[1] in (3, 4):
        return f"color{values.shape[1]}f"
    return letter


def _write_primvar(
    api: Any,
    attribute: Attribute,
    name: str,
    type_name: str,
    values: npt.NDArray[Any],
    codes: Sequence[float | None],
) -> None:
    sdf, arrays = USD.load("Sdf"), USD.load("Vt")
    declared = sdf.ValueTypeNames.Find(f"{type_name}[]")
    is_flat = type_name in ("uchar", "int", "float", "double")
    width = values.shape[1] if is_flat else 1
    indices = attribute.indices
    is_constant = (
        attribute.kind is Kind.COLOR
        and attribute.domain is Domain.VERTEX
        and indices is not None
        and len(values) == 1
        and codes[0] is None  # other segments may have several colors
    )
    interpolation = "constant" if is_constant else INTERPOLATIONS[attribute.domain]
    primvar = api.CreatePrimvar(name, declared, interpolation, width)
    array_class = getattr(arrays, declared.type.pythonClass.__name__)
    data = np.ascontiguousarray(values.ravel() if is_flat else values)
    if codes[0] is not None:
        primvar.GetAttr().SetCustomDataByKey(IS_ATTRIBUTE, True)
    for code in codes:
        primvar.Set(array_class.FromNumpy(data), _time_code(code))
    if indices is not None and not is_constant:
        primvar.SetIndices(arrays.IntArray.FromNumpy(indices), _time_code(codes[0]))


def _write_groups(
    prim: Any, groups: FaceGroups, materials: Materials, used: set[str], code: float | None
) -> None:
    geometry, arrays = USD.load("UsdGeom"), USD.load("Vt")
    is_material = groups.name == "material"
    family = MATERIALS if is_material else prim_name(groups.name)
    mesh = geometry.Imageable(prim)
    for number, label in enumerate(groups.labels):
        faces = np.flatnonzero(groups.numbers == number).astype(np.int32)
        name = unique_name(prim_name(label), used)
        indices = arrays.IntArray.FromNumpy(faces)
        default = indices if code is None else arrays.IntArray()
        subset = geometry.Subset.CreateGeomSubset(mesh, name, geometry.Tokens.face, default, family)
        if code is not None:
            subset.GetIndicesAttr().Set(indices, code)
        set_display_name(subset.GetPrim(), label)
        if is_material:
            materials.bind(subset.GetPrim(), label)
    is_complete = code is None and (groups.numbers >= 0).all()
    tokens = geometry.Tokens
    geometry.Subset.SetFamilyType(
        mesh, family, tokens.partition if is_complete else tokens.nonOverlapping
    )
