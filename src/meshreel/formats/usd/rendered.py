"""The prims of a stage that are rendered and can be read as meshes."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.usd.instancers import PointInstancer, PrototypeInstances, all_prims_predicate
from meshreel.formats.usd.mesh_shape import MeshShape
from meshreel.formats.usd.primitives import PRIMITIVES, PrimitiveShape
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.runtime.extras import USD

MAX_PRIMS = 1_000_000
"""Limit, since nested instances can make a small file expand to any number of prims."""


@dataclass(frozen=True, eq=False)
class RenderedMesh:
    """A mesh of a stage, or of a prototype of point instancers.

    Parameters
    ----------
    prim : Usd.Prim
    levels : tuple of PrototypeInstances
        The prototypes that contain it, from the outermost instancer to the innermost; empty for a
        mesh outside of instancers.
    """

    prim: Any
    levels: tuple[PrototypeInstances, ...] = ()

    @property
    def name(self) -> str:
        """Its path, prefixed by that of an instancer whose prototype is elsewhere in the stage."""
        name = str(self.prim.GetPath())
        for level in reversed(self.levels):
            above = level.instancer.path
            name = name if name.startswith(f"{above}/") else f"{above}{name}"
        return name


def rendered_meshes(stage: Any, notes: list[str]) -> list[RenderedMesh]:
    """Return the meshes and primitives that are rendered, in stage order, instances included.

    These are the prims that are visible at some time and have the purpose default or render. A
    mesh must also have points and faces, and a prototype at least one instance.

    Parameters
    ----------
    stage : Usd.Stage
    notes : list of str
        Gains a sentence on meshes that are not rendered, and one on other geometry.

    Raises
    ------
    FormatError
        If there are none, listing the contents; or if the stage has more than `MAX_PRIMS` prims.
    """
    geometry = _Geometry()
    usd = USD.load("Usd")
    geometry.add(usd.PrimRange.Stage(stage, usd.TraverseInstanceProxies()))
    reasons = [_reason_not_rendered(mesh) for mesh in geometry.meshes]
    rendered = [mesh for mesh, reason in zip(geometry.meshes, reasons, strict=True) if not reason]
    hidden = Counter(reason for reason in reasons if reason)
    if not rendered:
        raise FormatError(
            f"contains no mesh that is rendered, only {_describe(hidden, geometry.others)}"
        )
    blinking = [mesh.name for mesh in rendered if len(set(_visibility(mesh))) > 1]
    note_kinds(notes, "visibility that changes over time", blinking)
    if hidden or geometry.others:
        note_left_out(notes, _describe(hidden, geometry.others))
    return rendered


def shape_of(prim: Any) -> MeshShape | PrimitiveShape:
    """Return the shape of a mesh or primitive prim, in its local space."""
    return PrimitiveShape(prim) if prim.GetTypeName() in PRIMITIVES else MeshShape(prim)


@dataclass(eq=False)
class _Geometry:
    """Meshes of a stage, and counts of prims of other types, such as cameras and lights."""

    meshes: list[RenderedMesh] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    n_prims: int = 0

    def add(self, prims: Any, levels: tuple[PrototypeInstances, ...] = ()) -> None:
        """Add the prims of a range, which is within the given prototypes."""
        geometry, lights = USD.load("UsdGeom"), USD.load("UsdLux").LightAPI
        prims = iter(prims)
        for prim in prims:
            self.n_prims += 1
            if self.n_prims > MAX_PRIMS:
                raise FormatError(
                    f"contains more than {MAX_PRIMS} prims; write the mesh to a separate file"
                )
            if prim.IsA(geometry.Mesh) or prim.GetTypeName() in PRIMITIVES:
                self.meshes.append(RenderedMesh(prim, levels))
            elif prim.IsA(geometry.PointInstancer):
                self._add_instancer(prim, levels)
                prims.PruneChildren()  # prims below are rendered only as instances
            elif prim.IsA(geometry.Gprim) or prim.IsA(geometry.Camera) or prim.HasAPI(lights):
                self.others[prim.GetTypeName()] += 1

    def _add_instancer(self, prim: Any, levels: tuple[PrototypeInstances, ...]) -> None:
        instancer, n_before = PointInstancer(prim), len(self.meshes)
        if prim.GetPath() in [level.instancer.prim.GetPath() for level in levels]:
            raise FormatError(f"point instancer {instancer.path} is in one of its prototypes")
        for number, root in enumerate(instancer.prototypes):
            if not root:
                self.others[f"missing prototype of {instancer.path}"] += 1
                continue
            prims = USD.load("Usd").PrimRange(root, all_prims_predicate())
            self.add(prims, (*levels, PrototypeInstances(instancer, number)))
        if len(self.meshes) == n_before:
            self.others[f"{prim.GetTypeName()} whose prototypes contain no mesh"] += 1


def _reason_not_rendered(rendered: RenderedMesh) -> str:
    """Return why a mesh is not rendered, in a few words; empty if it is."""
    geometry, prim = USD.load("UsdGeom"), rendered.prim
    for imageable in (prim, *(level.instancer.prim for level in rendered.levels)):
        purpose = geometry.Imageable(imageable).ComputePurpose()
        if purpose not in (geometry.Tokens.default_, geometry.Tokens.render):
            return f"of purpose {purpose}"
    mesh = geometry.Mesh(prim)
    if mesh and not (mesh.GetPointsAttr().HasValue() and mesh.GetFaceVertexCountsAttr().HasValue()):
        return "without points or faces"
    if not all(level.are_rendered() for level in rendered.levels):
        return "of prototypes without a rendered instance"
    return "" if any(_visibility(rendered)) else "invisible"


def _visibility(mesh: RenderedMesh) -> list[bool]:
    """Return the visibility of a mesh at each of its samples, or a single value without samples."""
    attributes = [one.GetVisibilityAttr() for one in _visibility_chain(mesh)]
    times = sorted({code for one in attributes for code in attribute_codes(one)}) or [0.0]
    invisible = USD.load("UsdGeom").Tokens.invisible
    return [all(one.Get(time) != invisible for one in attributes) for time in times]


def _visibility_chain(mesh: RenderedMesh) -> Iterator[Any]:
    """Yield the mesh and its ancestors; at a prototype root, continue with the instancer."""
    geometry = USD.load("UsdGeom")
    steps: list[tuple[Any, Any]] = [(mesh.prim, None)]
    for level in reversed(mesh.levels):
        steps[-1] = steps[-1][0], level.root
        steps.append((level.instancer.prim, None))
    for prim, root in steps:
        while prim and not prim.IsPseudoRoot():
            if imageable := geometry.Imageable(prim):
                yield imageable
            prim = None if root and prim == root else prim.GetParent()


def _describe(hidden: Counter[str], others: Counter[str]) -> str:
    """Return counts in words, such as "2 meshes of purpose proxy, 1 BasisCurves"."""
    meshes = [f"{n} {'mesh' if n == 1 else 'meshes'} {reason}" for reason, n in hidden.items()]
    return ", ".join(meshes + [f"{n} {kind}" for kind, n in others.items()]) or "no geometry"
