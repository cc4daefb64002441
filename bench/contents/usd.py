"""Contents of USD files: the authored properties of the composed stage, by pxr's traversal."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Ar, Sdf, Sdr, Usd, UsdGeom, UsdShade, UsdSkel

from contents.items import DEFAULTS, Item, Sort

EXTENSIONS = (".usd", ".usda", ".usdc", ".usdz")

LINKS = re.compile("outputs:|info:|ui:|material:binding|xformOp|subsetFamily:|proxyPrim|extent")
"""Connections, bindings, transforms, bounds and labels."""
STORAGE = re.compile(
    rf"{LINKS.pattern}|primvars:|skel:|joint|blendShape|(doubleSided|points|velocities|normals|"
    "accelerations|faceVertex.*|subdivisionScheme|holeIndices|orientation|visibility|purpose|"
    "elementType|familyName|indices|(bind|rest)Transforms|scales|rotations|translations|offsets|"
    "inbetweens:[^:]*|pointIndices)$"
)
"""Properties of meshes and what belongs to them that are other items, or tell how to read them."""
SETTINGS = re.compile("interpolateBoundary|faceVaryingLinear|triangleSub")
CAGE = re.compile(f"crease|corner|{SETTINGS.pattern}")
"""Properties of a subdivision; without one, settings tell nothing."""
METADATA = ("assetInfo", "customData", "customLayerData")
"""Metadata with contents; other keys tell how values are composed, read or listed."""
SURFACE = {
    "diffuseColor": "base_color", "opacity": "base_color", "metallic": "metallic",
    "roughness": "roughness", "emissiveColor": "emissive", "opacityThreshold": "alpha_cutoff",
    "normal": "normal", "occlusion": "occlusion",
}  # fmt: skip
"""Properties of `Material` by input of UsdPreviewSurface."""
INPUTS = {
    "UsdPreviewSurface": tuple(SURFACE),
    "UsdUVTexture": ("file", "st", "wrapS", "wrapT", "scale", "bias", "sourceColorSpace"),
    "UsdTransform2d": ("in", "rotation", "scale", "translation"),
    "UsdPrimvarReader_float2": ("varname",),
}
"""Inputs that a `Material` keeps, by shader."""
UVS = re.compile("(texCoord|float|double|half)2")
START = Usd.TimeCode.EarliestTime()


def walk(path: Path) -> Iterator[Item]:
    """Yield what a stage holds: rendered meshes with all they use, and all other prims."""
    stage = Usd.Stage.Open(str(path))
    prims = [*Usd.PrimRange.Stage(stage, Usd.TraverseInstanceProxies(~Usd.PrimIsAbstract))]
    closed = {prim.GetPath() for prim in prims if _is_off(prim) or prim.IsA(UsdGeom.PointInstancer)}
    prims = [prim for prim in prims if not closed & {*prim.GetPath().GetPrefixes()[:-1]}]
    meshes = [prim for prim in prims if _is_mesh(prim)]
    shown = [prim for prim in meshes if _is_shown(prim)] or meshes
    parts = {prim.GetPath() for prim in shown}
    carriers = {above for part in parts for above in part.GetPrefixes()}
    carriers |= {each for prim in shown for each in _skeleton(prim)}
    for prim in shown:
        yield from _mesh(prim, is_alone=len(shown) == 1)
        if len(shown) > 1:
            yield Item(Sort.GROUP, str(prim.GetPath()))
    bound = {look.GetPath(): look for prim in shown for look in _materials(prim)}
    used: set[Sdf.Path] = set()
    for material in bound.values():
        yield Item(Sort.GROUP, _label(material.GetPrim()))
        yield from _look(material, used)
    carriers |= {input_path.GetPrimPath() for input_path in used} | {*bound}
    yield from _metadata(stage.GetPseudoRoot())
    for prim in prims:
        prim_path, parent = prim.GetPath(), prim.GetPath().GetParentPath()
        yield from _metadata(prim)
        for name in prim.GetVariantSets().GetNames():
            variants = prim.GetVariantSet(name)
            others = {*variants.GetVariantNames()} - {variants.GetVariantSelection()}
            yield from (Item(Sort.OTHER, f"{prim_path}{{{name}={other}}}") for other in others)
        if _is_off(prim) or (prim.IsA(UsdGeom.Mesh) and prim_path not in parts):
            yield Item(Sort.OTHER, str(prim_path))
        elif prim.IsA(UsdGeom.Subset) and parent in parts:
            subset, look = UsdGeom.Subset(prim), _materials(prim)
            is_face = subset.GetElementTypeAttr().Get() == "face"
            is_look = look and subset.GetFamilyNameAttr().Get() == "materialBind"
            yield Item(Sort.GROUP if is_face else Sort.OTHER, _label(look[0] if is_look else prim))
            if subset.GetIndicesAttr().ValueMightBeTimeVarying():
                yield Item(Sort.VISIBILITY, str(prim_path))
        elif prim_path in carriers or parent in parts:
            is_flat = prim.IsA(UsdGeom.Mesh) and _scheme(prim) == "none"
            for prop in _contents(prim):
                is_structure = STORAGE.match(prop.GetName()) or prop.GetPath() in used
                if not (is_structure or (is_flat and SETTINGS.match(prop.GetName()))):
                    is_named = CAGE.match(prop.GetName()) and not is_flat
                    words = ("subdivision",) if is_named else ()
                    yield Item(Sort.OTHER, prop.GetName().removeprefix("inputs:"), words=words)
        else:
            above = [stage.GetPrimAtPath(each) for each in prim_path.GetPrefixes()[:-1]]
            words = (prim_path, *(each.GetPath() for each in above if each.IsA(UsdShade.Material)))
            for prop in _contents(prim):
                if not LINKS.match(prop.GetName()):
                    yield Item(Sort.OTHER, str(prop.GetPath()), words=tuple(map(str, words)))


def _scheme(prim: Usd.Prim) -> str:
    return str(UsdGeom.Mesh(prim).GetSubdivisionSchemeAttr().Get())


def _is_off(prim: Usd.Prim) -> bool:
    return not (prim.IsActive() and prim.IsDefined())


def _is_mesh(prim: Usd.Prim) -> bool:
    """Return whether a prim is a mesh with points and valid faces."""
    mesh = UsdGeom.Mesh(prim)
    if _is_off(prim) or not mesh:
        return False
    attributes = (mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr())
    points, counts = (attribute.Get(START) for attribute in attributes)
    indices = mesh.GetFaceVertexIndicesAttr().Get(START)
    has_all = bool(points and counts and indices)
    return has_all and mesh.ValidateTopology(indices, counts, len(points))[0]


def _is_shown(prim: Usd.Prim) -> bool:
    is_rendered = UsdGeom.Imageable(prim).ComputePurpose() in ("default", "render")
    return is_rendered and "inherited" in _visibility(prim)


def _visibility(prim: Usd.Prim) -> set[str]:
    codes = _samples(prim, "visibility")
    return {UsdGeom.Imageable(prim).ComputeVisibility(code) for code in codes}


def _samples(prim: Usd.Prim, *starts: str) -> list[Any]:
    """Return the time codes where properties of a prim, or above it, have samples."""
    attributes = [attr for attr in _attributes(prim) if attr.GetName().startswith(starts)]
    resets = [attr.GetPrim() for attr in attributes if _resets(attr.GetPrim())]
    above = resets[-1].GetPath().GetParentPath().GetPrefixes() if resets else []
    attributes = [
        attr for attr in attributes
        if not (attr.GetName().startswith("xformOp") and attr.GetPrim().GetPath() in above)
    ]  # fmt: skip
    return sorted({code for attr in attributes for code in attr.GetTimeSamples()}) or [START]


def _resets(prim: Usd.Prim) -> bool:
    return bool(UsdGeom.Xformable(prim)) and UsdGeom.Xformable(prim).GetResetXformStack()


def _attributes(prim: Usd.Prim) -> list[Usd.Attribute]:
    """Return the attributes of a prim and those above it."""
    above = [prim.GetStage().GetPrimAtPath(path) for path in prim.GetPath().GetPrefixes()]
    return [attr for one in above for attr in one.GetAuthoredAttributes()]


def _label(prim: Any) -> Any:
    return prim.GetPrim().GetDisplayName() or prim.GetPrim().GetName()


def _materials(prim: Usd.Prim) -> list[UsdShade.Material]:
    """Return the materials of a mesh and its subsets."""
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    owners = [prim, *(subset.GetPrim() for subset in subsets)]
    return [look for look in UsdShade.MaterialBindingAPI.ComputeBoundMaterials(owners)[0] if look]


def _surface(material: UsdShade.Material) -> Any:
    shader = material.ComputeSurfaceSource()[0]
    return shader if shader and shader.GetShaderId() == "UsdPreviewSurface" else None


def _skeleton(prim: Usd.Prim) -> Iterator[Sdf.Path]:
    """Yield the paths of the skeleton of a mesh, its animation and its blend shapes."""
    if skeleton := UsdSkel.BindingAPI(prim).GetInheritedSkeleton():
        animation = UsdSkel.BindingAPI(skeleton.GetPrim()).GetInheritedAnimationSource()
        for one in filter(None, (skeleton.GetPrim(), animation)):
            yield from one.GetPath().GetPrefixes()
        yield from UsdSkel.BindingAPI(prim).GetBlendShapeTargetsRel().GetTargets()


def _contents(prim: Usd.Prim) -> Iterator[Usd.Property]:
    """Yield the properties with values, connections or targets, except those with defaults."""
    kind = UsdShade.Shader(prim).GetShaderId() if prim.IsA(UsdShade.Shader) else ""
    node = Sdr.Registry().GetShaderNodeByIdentifier(kind or "")
    for prop in prim.GetAuthoredProperties():
        name = prop.GetName()
        if isinstance(prop, Usd.Relationship):
            yield from [prop] if prop.GetTargets() else []
            continue
        default = prim.GetPrimDefinition().GetAttributeFallbackValue(name)
        if node and (shader_input := node.GetShaderInput(name.removeprefix("inputs:"))):
            default = shader_input.GetDefaultValue()
        is_default = prop.Get() == default and not prop.GetTimeSamples()
        if (prop.HasAuthoredValue() and not is_default) or prop.GetConnections():
            yield prop


def _metadata(item: Any) -> Iterator[Item]:
    authored = item.GetAllAuthoredMetadata()
    for key in METADATA:
        if {*authored.get(key, ())} - {"meshreel"}:
            yield Item(Sort.OTHER, key)


def _mesh(prim: Usd.Prim, *, is_alone: bool) -> Iterator[Item]:
    """Yield what a rendered mesh holds, with values if it is the only one."""
    path, mesh, codes = str(prim.GetPath()), UsdGeom.Mesh(prim), _samples(prim, "points", "xformOp")
    is_moved = any(re.match("xformOp|primvars:skel|skel", a.GetName()) for a in _attributes(prim))
    points = [np.asarray(mesh.GetPointsAttr().Get(code)) for code in codes]
    values = np.concatenate(points) if is_alone and not is_moved else None
    yield Item(Sort.POSITIONS, path, values, (f"{path} (",))
    holes, counts = mesh.GetHoleIndicesAttr().HasAuthoredValue(), mesh.GetFaceVertexCountsAttr()
    is_whole = is_alone and not holes
    is_fixed = is_whole and not counts.ValueMightBeTimeVarying()
    yield Item(Sort.FACES, "faces", len(counts.Get(START)) if is_fixed else None)
    if holes:
        yield Item(Sort.OTHER, "holeIndices", words=("holes",))
    if len(codes) > 1:
        yield Item(Sort.TIMES, "times")
    if len(_visibility(prim)) > 1:
        yield Item(Sort.VISIBILITY, path)
    if mesh.GetDoubleSidedAttr().Get():
        names = [f"{_label(look)}.double_sided" for look in _materials(prim) if _surface(look)]
        yield Item(Sort.MATERIAL if names else Sort.OTHER, [*names, "doubleSided"][0])
    if mesh.GetNormalsAttr().HasAuthoredValue():
        yield from _normals(mesh.GetNormalsAttr())
    for primvar in UsdGeom.PrimvarsAPI(prim).FindPrimvarsWithInheritance():
        name, kind = primvar.GetPrimvarName(), str(primvar.GetTypeName())
        if name == "normals":
            yield from _normals(primvar.GetAttr())
        elif not name.startswith("skel:"):
            is_color, is_uv = kind.startswith("color") or name == "displayOpacity", UVS.match(kind)
            sort = Sort.COLOR if is_color else Sort.UV if is_uv else Sort.DATA
            times = primvar.GetTimeSamples() or [START]
            flat = [np.atleast_1d(primvar.ComputeFlattened(code)) for code in times]
            is_plain = is_whole and sort is Sort.DATA and flat[0].dtype.kind in "fiu"
            yield from _values(primvar.GetAttr(), name, sort, flat if is_plain else None)
    for attr in (mesh.GetVelocitiesAttr(), mesh.GetAccelerationsAttr()):
        if attr.HasAuthoredValue():
            yield from _values(attr, attr.GetName(), Sort.DATA)


def _normals(attr: Usd.Attribute) -> Iterator[Item]:
    """Yield normals: hard edges follow from them unless they change and are not computed."""
    is_track = attr.ValueMightBeTimeVarying() and not attr.GetCustomDataByKey("meshreel:computed")
    yield from _values(attr, "normals", Sort.DATA if is_track else Sort.EDGES)


def _values(attr: Usd.Attribute, name: str, sort: Sort, values: Any = None) -> Iterator[Item]:
    """Yield values with the name and the unit that meshreel wrote, if any."""
    name = attr.GetCustomDataByKey("meshreel:name") or name
    yield Item(sort, name, None if values is None else np.concatenate(values))
    if unit := attr.GetCustomDataByKey("meshreel:unit"):
        yield Item(Sort.UNIT, f"{name}:{unit}")


def _look(material: UsdShade.Material, used: set[Sdf.Path]) -> Iterator[Item]:
    """Yield what a material keeps, and add the paths of the properties that it is read from."""
    shader, label = _surface(material), _label(material)
    for name, field in SURFACE.items() if shader else ():
        sources = [*_trace(shader.GetInput(name).GetAttr(), used)] if shader.GetInput(name) else []
        values = [attr.Get(START) for attr in sources if attr.HasAuthoredValue()]
        assets = [value for value in values if isinstance(value, Sdf.AssetPath)]
        words = (f"texture of {name}", "opacity that is not the alpha")
        for asset in assets:
            found = Ar.GetResolver().OpenAsset(Ar.ResolvedPath(asset.resolvedPath))
            yield Item(Sort.IMAGE, asset.path, found.GetSize() if found else 0, words)
            yield Item(Sort.MATERIAL, f"{label}.{field}_texture", words=words)
        default = getattr(DEFAULTS, field, None)
        is_number = not any(attr.GetName().startswith("outputs:") for attr in sources)
        if values and is_number and field in ("metallic", "roughness", "emissive"):
            value = values[-1] if np.asarray(values[-1]).dtype.kind in "fiu" else None
            is_default = value is not None and np.array_equal(
                np.float32(value), np.float32(default)
            )
            item = Item(Sort.MATERIAL, f"{label}.{field}", value, (f"{name} must be",))
            yield from [] if is_default else [item]


def _trace(attr: Usd.Attribute, used: set[Sdf.Path]) -> Iterator[Usd.Attribute]:
    """Yield an input of a shader and all that it is read from."""
    if not attr or attr.GetPath() in used:
        return
    used.add(attr.GetPath())
    yield attr
    shader = UsdShade.Shader(attr.GetPrim())
    names = INPUTS.get(shader.GetShaderId() if shader else "", ())
    for name in names if attr.GetName().startswith("outputs:") else ():
        yield from _trace(shader.GetPrim().GetAttribute(f"inputs:{name}"), used)
    for target in attr.GetConnections():
        yield from _trace(attr.GetStage().GetAttributeAtPath(target), used)
