"""Which prims of a stage are meshes that are drawn, or primitives, which are read as meshes."""

from collections import Counter
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.usd.mesh_shape import MeshShape
from meshreel.formats.usd.primitives import PRIMITIVES, PrimitiveShape
from meshreel.formats.usd.sampling import attribute_codes

MAX_PRIMS = 1_000_000
"""Instances of instances can be any number, in a small file."""


def drawn_meshes(stage: Any, notes: list[str]) -> list[Any]:
    """The prims of meshes that are drawn, in the order of the stage; those of instances too.

    Cubes, spheres and other primitives are among them. Drawn is what is visible at any time, and
    meant for every purpose or for the final picture; and of meshes those that have points.

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
    meshes, others = _geometry(stage)
    reasons = {str(prim.GetPath()): _why_not_drawn(prim) for prim in meshes}
    drawn = [prim for prim in meshes if not reasons[str(prim.GetPath())]]
    hidden = Counter(reason for reason in reasons.values() if reason)
    if not drawn:
        raise FormatError(f"holds no mesh that is drawn; it holds {_counted(hidden, others)}")
    blinking = [str(prim.GetPath()) for prim in drawn if len(set(_visible(prim))) > 1]
    note_kinds(notes, "visibility that changes over time", blinking)
    if hidden or others:
        note_left_out(notes, _counted(hidden, others))
    return drawn


def shape_of(prim: Any) -> MeshShape | PrimitiveShape:
    """The shape of one of these prims in its own space."""
    return PrimitiveShape(prim) if prim.GetTypeName() in PRIMITIVES else MeshShape(prim)


def _geometry(stage: Any) -> tuple[list[Any], Counter[str]]:
    """Prims of meshes, and how many there are of other kinds, with cameras and lights."""
    usd, geometry, lights = USD.load("Usd"), USD.load("UsdGeom"), USD.load("UsdLux").LightAPI
    prims = iter(usd.PrimRange.Stage(stage, usd.TraverseInstanceProxies()))
    meshes: list[Any] = []
    others: Counter[str] = Counter()
    for number, prim in enumerate(prims):
        if number == MAX_PRIMS:
            raise FormatError(f"holds more than {MAX_PRIMS} prims; write the mesh to a file alone")
        if prim.IsA(geometry.Mesh) or prim.GetTypeName() in PRIMITIVES:
            meshes.append(prim)
        elif prim.IsA(geometry.PointInstancer):
            others[prim.GetTypeName()] += 1
            prims.PruneChildren()  # what is below is only drawn as its copies
        elif prim.IsA(geometry.Gprim) or prim.IsA(geometry.Camera) or prim.HasAPI(lights):
            others[prim.GetTypeName()] += 1
    return meshes, others


def _why_not_drawn(prim: Any) -> str:
    """In a word or two; empty if it is drawn."""
    geometry = USD.load("UsdGeom")
    shown = geometry.Imageable(prim)
    purpose = shown.ComputePurpose()
    if purpose not in (geometry.Tokens.default_, geometry.Tokens.render):
        return f"of purpose {purpose}"
    mesh = geometry.Mesh(prim)
    if mesh and not (mesh.GetPointsAttr().HasValue() and mesh.GetFaceVertexCountsAttr().HasValue()):
        return "without points or faces"
    return "" if any(_visible(prim)) else "invisible"


def _visible(prim: Any) -> list[bool]:
    """Whether a prim is visible, at each time at which that may change; once if it does not."""
    geometry = USD.load("UsdGeom")
    shown, codes = geometry.Imageable(prim), set[float]()
    while prim and not prim.IsPseudoRoot():
        codes.update(attribute_codes(geometry.Imageable(prim).GetVisibilityAttr()))
        prim = prim.GetParent()
    times = sorted(codes) or [0.0]
    return [shown.ComputeVisibility(time) != geometry.Tokens.invisible for time in times]


def _counted(hidden: Counter[str], others: Counter[str]) -> str:
    """As in "2 meshes of purpose proxy, 1 BasisCurves"."""
    meshes = [f"{n} {'mesh' if n == 1 else 'meshes'} {reason}" for reason, n in hidden.items()]
    return ", ".join(meshes + [f"{n} {kind}" for kind, n in others.items()]) or "no geometry"
