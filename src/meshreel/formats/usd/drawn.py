"""Which prims of a stage are meshes that are drawn, or primitives, which are read as meshes."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.usd.instancers import Copies, PointInstancer, all_prims
from meshreel.formats.usd.mesh_shape import MeshShape
from meshreel.formats.usd.primitives import PRIMITIVES, PrimitiveShape
from meshreel.formats.usd.sampling import attribute_codes

MAX_PRIMS = 1_000_000
"""Instances of instances can be any number, in a small file."""


@dataclass(frozen=True, eq=False)
class DrawnMesh:
    """A mesh of a stage, or one that point instancers copy.

    Parameters
    ----------
    prim : Usd.Prim
    levels : tuple of Copies
        The prototypes that it is in, from the outermost instancer to the innermost; none if it is
        drawn where it is.
    """

    prim: Any
    levels: tuple[Copies, ...] = ()

    @property
    def name(self) -> str:
        """Its path; behind that of an instancer whose prototype is elsewhere in the stage."""
        name = str(self.prim.GetPath())
        for level in reversed(self.levels):
            above = level.instancer.path
            name = name if name.startswith(f"{above}/") else f"{above}{name}"
        return name


def drawn_meshes(stage: Any, notes: list[str]) -> list[DrawnMesh]:
    """The meshes that are drawn, in the order of the stage; those of instances too.

    Cubes, spheres and other primitives are among them. Drawn is what is visible at any time, and
    meant for every purpose or for the final picture; and of meshes those that have points. Meshes
    of prototypes are drawn where an instancer has instances of them.

    Parameters
    ----------
    stage : Usd.Stage
    notes : list of str
        Gains a sentence on meshes that are not drawn, and one on other geometry.

    Raises
    ------
    FormatError
        If there are none, with what there is; or if the stage has more than `MAX_PRIMS` prims.
    """
    found = _Geometry()
    usd = USD.load("Usd")
    found.add(usd.PrimRange.Stage(stage, usd.TraverseInstanceProxies()))
    reasons = [_why_not_drawn(mesh) for mesh in found.meshes]
    drawn = [mesh for mesh, reason in zip(found.meshes, reasons, strict=True) if not reason]
    hidden = Counter(reason for reason in reasons if reason)
    if not drawn:
        raise FormatError(f"holds no mesh that is drawn; it holds {_counted(hidden, found.others)}")
    blinking = [mesh.name for mesh in drawn if len(set(_visible(mesh))) > 1]
    note_kinds(notes, "visibility that changes over time", blinking)
    if hidden or found.others:
        note_left_out(notes, _counted(hidden, found.others))
    return drawn


def shape_of(prim: Any) -> MeshShape | PrimitiveShape:
    """The shape of one of these prims in its own space."""
    return PrimitiveShape(prim) if prim.GetTypeName() in PRIMITIVES else MeshShape(prim)


@dataclass(eq=False)
class _Geometry:
    """Meshes of a stage, and how many prims there are of other kinds, with cameras and lights."""

    meshes: list[DrawnMesh] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    n_prims: int = 0

    def add(self, prims: Any, levels: tuple[Copies, ...] = ()) -> None:
        """Add the prims of a range, which are in these prototypes."""
        geometry, lights = USD.load("UsdGeom"), USD.load("UsdLux").LightAPI
        prims = iter(prims)
        for prim in prims:
            self.n_prims += 1
            if self.n_prims > MAX_PRIMS:
                raise FormatError(
                    f"holds more than {MAX_PRIMS} prims; write the mesh to a file alone"
                )
            if prim.IsA(geometry.Mesh) or prim.GetTypeName() in PRIMITIVES:
                self.meshes.append(DrawnMesh(prim, levels))
            elif prim.IsA(geometry.PointInstancer):
                self._add_instancer(prim, levels)
                prims.PruneChildren()  # what is below is only drawn as its copies
            elif prim.IsA(geometry.Gprim) or prim.IsA(geometry.Camera) or prim.HasAPI(lights):
                self.others[prim.GetTypeName()] += 1

    def _add_instancer(self, prim: Any, levels: tuple[Copies, ...]) -> None:
        instancer, n_before = PointInstancer(prim), len(self.meshes)
        if prim.GetPath() in [level.instancer.prim.GetPath() for level in levels]:
            raise FormatError(f"point instancer {instancer.path} is in one of its prototypes")
        for number, root in enumerate(instancer.prototypes):
            if not root:
                self.others[f"prototype of {instancer.path} that is not there"] += 1
                continue
            prims = USD.load("Usd").PrimRange(root, all_prims())
            self.add(prims, (*levels, Copies(instancer, number)))
        if len(self.meshes) == n_before:
            self.others[f"{prim.GetTypeName()} whose prototypes hold no mesh"] += 1


def _why_not_drawn(found: DrawnMesh) -> str:
    """In a word or two; empty if it is drawn."""
    geometry, prim = USD.load("UsdGeom"), found.prim
    for shown in (prim, *(level.instancer.prim for level in found.levels)):
        purpose = geometry.Imageable(shown).ComputePurpose()
        if purpose not in (geometry.Tokens.default_, geometry.Tokens.render):
            return f"of purpose {purpose}"
    mesh = geometry.Mesh(prim)
    if mesh and not (mesh.GetPointsAttr().HasValue() and mesh.GetFaceVertexCountsAttr().HasValue()):
        return "without points or faces"
    if not all(level.are_drawn() for level in found.levels):
        return "of prototypes without an instance that is drawn"
    return "" if any(_visible(found)) else "invisible"


def _visible(found: DrawnMesh) -> list[bool]:
    """Whether a mesh is visible, at each time at which that may change; once if it does not."""
    shown = [one.GetVisibilityAttr() for one in _seen_through(found)]
    times = sorted({code for one in shown for code in attribute_codes(one)}) or [0.0]
    invisible = USD.load("UsdGeom").Tokens.invisible
    return [all(one.Get(time) != invisible for one in shown) for time in times]


def _seen_through(found: DrawnMesh) -> Iterator[Any]:
    """The mesh and all above it; of a prototype up to its root, then from the instancer on."""
    geometry = USD.load("UsdGeom")
    steps: list[tuple[Any, Any]] = [(found.prim, None)]
    for level in reversed(found.levels):
        steps[-1] = steps[-1][0], level.root
        steps.append((level.instancer.prim, None))
    for prim, root in steps:
        while prim and not prim.IsPseudoRoot():
            if imageable := geometry.Imageable(prim):
                yield imageable
            prim = None if root and prim == root else prim.GetParent()


def _counted(hidden: Counter[str], others: Counter[str]) -> str:
    """As in "2 meshes of purpose proxy, 1 BasisCurves"."""
    meshes = [f"{n} {'mesh' if n == 1 else 'meshes'} {reason}" for reason, n in hidden.items()]
    return ", ".join(meshes + [f"{n} {kind}" for kind, n in others.items()]) or "no geometry"
