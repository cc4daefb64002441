"""Notes on everything in a stage that was not read."""

import re
from collections import defaultdict
from collections.abc import Collection, Iterator
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.usd.stage import usd_errors
from meshreel.model.notes import CHANGES, NORMALS, UNCHANGING, Notes
from meshreel.runtime.extras import USD

BOOKKEEPING = {
    "outputs:|material:binding|skel:": "connections and bindings, which count as what they lead to",
    "info:": "kinds of shaders, which count by their inputs",
    "xformOp|visibility|purpose": "motion and visibility of meshes, which other notes are about",
    "extent": "bounds, which programs compute",
    "ui:": "layout of the windows of an editor",
    "proxyPrim": "which mesh a hidden one replaces",
    "subsetFamily:": "whether face subsets overlap",
    "primvars:.*:indices$": "read with their primvar",
    "interpolateBoundary|triangleSub|faceVaryingLinear": "settings of a subdivision",
}
"""Patterns of properties without content of their own, and why."""

MAX_PRIMS = 1_000_000
"""Limit, since nested instances can make a small file expand to any number of prims."""

METADATA = ("assetInfo", "customData", "customLayerData")
"""Metadata that notes mention, except for entries that meshreel wrote."""

CONTAINERS = ("", "Xform", "Scope", "SkelRoot", "NodeGraph")
"""Types of prims without content unless they have properties."""

MISFITS = "primvars for a whole mesh, or that do not fit its faces"

SUBJECTS = {
    "(primvars:|.*:)?(normals|normalOffsets)$": NORMALS,
    "primvars:(tangents|bitangents|binormals)$": "tangents, which programs compute",
    "velocities|accelerations": UNCHANGING,
    "crease|corner": "creases of meshes that are not subdivided",
    "primvars:": MISFITS,
    "inputs:": "inputs of materials",
    "": "other properties",
}
"""Subjects of notes on properties by pattern of their names; the first match applies."""

Unread = tuple[str, str]  # the subject of the note and a name


class StageContents:
    """What was read of a stage, so that notes can name everything else.

    Parameters
    ----------
    stage : Usd.Stage
        Kept alive, since its prims become invalid with it.
    notes : Notes
        Gains sentences on what was not read.

    Attributes
    ----------
    prims : list of Usd.Prim
        All prims; those below point instancers are rendered only as instances, and skipped.

    Raises
    ------
    FormatError
        If there are more than `MAX_PRIMS`.
    """

    def __init__(self, stage: Any, notes: Notes) -> None:
        usd, instancer = USD.load("Usd"), USD.load("UsdGeom").PointInstancer
        self.stage: Any = stage
        self.notes: Notes = notes
        self.prims: list[Any] = []
        predicate = usd.TraverseInstanceProxies(~usd.PrimIsAbstract)
        traversal = iter(usd.PrimRange.Stage(stage, predicate))
        for prim in traversal:
            if len(self.prims) == MAX_PRIMS:
                raise FormatError(
                    f"contains more than {MAX_PRIMS} prims; write the mesh to a separate file"
                )
            self.prims.append(prim)
            if prim.IsA(instancer) or not prim.IsDefined():
                traversal.PruneChildren()
        self._read = defaultdict[Any, set[str]](set)
        self._new: list[Any] = []

    def add(self, prim: Any, *names: str) -> None:
        """Record that a prim was read, and properties of it."""
        path = original_path(prim)
        if path not in self._read:
            self._new.append(prim)
        self._read[path].update(names)

    def has(self, item: Any) -> bool:
        """Return whether a property was read."""
        return item.GetName() in self._read.get(original_path(item.GetPrim()), ())

    def note_others(self, used: Collection[Any]) -> None:
        """Note prims that no mesh uses, variants that are not selected, and metadata.

        `used` are the meshes, and prims that they refer to, such as materials.
        """
        mesh, material = USD.load("UsdGeom").Mesh, USD.load("UsdShade").Material
        parts = {prim.GetPath() for prim in used if prim.IsA(mesh)}
        above = {path for part in parts for path in part.GetPrefixes()}
        originals, unread = set(map(original_path, used)), _metadata(self.stage.GetPseudoRoot())
        for prim in self.prims:
            path, kind = prim.GetPath(), str(prim.GetTypeName())
            unread += _metadata(prim)
            for name, selected in prim.GetVariantSets().GetAllVariantSelections().items():
                others = {*prim.GetVariantSets().GetVariantSet(name).GetVariantNames()} - {selected}
                kinds = (f"{path}{{{name}={other}}}" for other in others)
                unread += (("variants that are not selected", text) for text in kinds)
            is_part = path.GetParentPath() in parts
            if is_part or prim.IsA(mesh) or prim.IsA(material):
                parts.add(path)
            is_used = is_part or path in above or original_path(prim) in originals
            if not (prim.IsActive() and prim.IsDefined()):
                unread.append(("inactive or undefined prims", str(path)))
            elif not is_used and (kind not in CONTAINERS or any(_contents(prim))):
                unread.append((f"{kind or 'untyped'} prims", str(path)))
        self.notes.left_out_items(sorted(unread))

    def note_unread(self) -> None:
        """Note what was not read of the prims that were read since the last call."""
        prims, self._new = self._new, []
        with usd_errors("USD cannot read its properties"):
            unread = sorted(item for prim in prims for item in self._unread(prim))
        self.notes.left_out_items(unread)

    def _unread(self, prim: Any) -> Iterator[Unread]:
        """Yield what was not read of a prim, and of those below a mesh or a material."""
        geometry, usd = USD.load("UsdGeom"), USD.load("Usd")
        is_mesh, items = prim.IsA(geometry.Mesh), [*_contents(prim)]
        if is_mesh:
            primvars = geometry.PrimvarsAPI(prim).FindPrimvarsWithInheritance()
            items += (primvar.GetAttr() for primvar in primvars if primvar.HasAuthoredValue())
        for item in items:
            name = str(item.GetName())
            if name.startswith("inputs:") and self.has(item) and item.ValueMightBeTimeVarying():
                yield CHANGES, str(item.GetPath())
            elif not self.has(item) and (is_mesh or not name.startswith("primvars:")):
                subject = next(SUBJECTS[pattern] for pattern in SUBJECTS if re.match(pattern, name))
                yield subject, re.sub("^(primvars|inputs):", "", name)
        for item in prim.GetAuthoredProperties():
            yield from _metadata(item)
        if is_mesh or prim.IsA(USD.load("UsdShade").Material):
            for part in usd.PrimRange(prim, usd.TraverseInstanceProxies()):
                is_read = original_path(part) in self._read or part.IsA(geometry.Mesh)
                if not is_read and any(_contents(part)):
                    yield f"{part.GetTypeName()} prims", str(part.GetPath())


def original_path(prim: Any) -> Any:
    """Return the path of a prim; in an instance, that of the prim that all instances share."""
    return (prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim).GetPath()


def _contents(prim: Any) -> Iterator[Any]:
    """Yield the properties of a prim that have targets, or values other than the default."""
    shader = USD.load("UsdShade").Shader(prim)
    kind = str(shader.GetShaderId() or "") if shader else ""
    node = USD.load("Sdr").Registry().GetShaderNodeByIdentifier(kind) if kind else None
    for item in prim.GetAuthoredProperties():
        name = str(item.GetName())
        if re.match("|".join(BOOKKEEPING), name):
            continue
        if isinstance(item, USD.load("Usd").Relationship) or item.HasAuthoredConnections():
            yield item
        elif item.HasAuthoredValue():
            default = prim.GetPrimDefinition().GetAttributeFallbackValue(name)
            if node and (parameter := node.GetShaderInput(name.removeprefix("inputs:"))):
                default = parameter.GetDefaultValue()
            if default is None or item.ValueMightBeTimeVarying() or item.Get() != default:
                yield item


def _metadata(item: Any) -> list[Unread]:
    values = item.GetAllAuthoredMetadata()
    known = [key for key in METADATA if isinstance(values.get(key), dict)]
    return [("metadata", key) for key in known if values[key].keys() - {"meshreel"}]
