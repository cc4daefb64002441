"""The meshes of a stage that are rendered, and their transforms."""

from collections import Counter
from typing import Any

import numpy as np

from meshreel.arrays import Floats
from meshreel.errors import FormatError
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.runtime.extras import USD

MAX_PRIMS = 1_000_000
"""Limit, since nested instances can make a small file expand to any number of prims."""


class Transforms:
    """Transforms of the prims of a stage to the world, at any time code."""

    def __init__(self) -> None:
        self._cache = USD.load("UsdGeom").XformCache()

    def codes(self, prim: Any) -> list[float]:
        """Return the time codes where transforms of a prim or its ancestors have samples."""
        codes: list[float] = []
        while prim and not prim.IsPseudoRoot():
            if xformable := USD.load("UsdGeom").Xformable(prim):
                for operation in xformable.GetOrderedXformOps():
                    codes += attribute_codes(operation.GetAttr())
                if xformable.GetResetXformStack():
                    break
            prim = prim.GetParent()
        return codes

    def world(self, prim: Any, code: float) -> Floats:
        """Return the matrix from the prim to the world, of shape (4, 4), for row vectors."""
        self._cache.SetTime(code)
        return np.array(self._cache.GetLocalToWorldTransform(prim), np.float64)


def rendered_meshes(stage: Any, notes: list[str]) -> list[Any]:
    """Return the prims of the meshes that are rendered, in stage order.

    These are the meshes that are visible at some time, have the purpose default or render, and have
    points and faces.

    Parameters
    ----------
    notes : list of str
        Gains a sentence on meshes that are not rendered, and on other geometry.

    Raises
    ------
    FormatError
        If there are none, listing the contents; or if the stage has more than `MAX_PRIMS` prims.
    """
    meshes, others = _geometry(stage)
    reasons = [_reason_not_rendered(mesh) for mesh in meshes]
    rendered = [mesh for mesh, reason in zip(meshes, reasons, strict=True) if not reason]
    hidden = Counter(reason for reason in reasons if reason)
    contents = ", ".join(
        [f"{n} {'mesh' if n == 1 else 'meshes'} {reason}" for reason, n in hidden.items()]
        + [f"{n} {kind}" for kind, n in others.items()]
    )
    if not rendered:
        no_geometry = "contains no geometry"
        raise FormatError(f"contains no visible mesh, only {contents}" if contents else no_geometry)
    blinking = [str(mesh.GetPath()) for mesh in rendered if len(set(_visibility(mesh))) > 1]
    note_kinds(notes, "visibility that changes over time", blinking)
    if contents:
        note_left_out(notes, contents)
    return rendered


def _geometry(stage: Any) -> tuple[list[Any], Counter[str]]:
    """Return the meshes of a stage, and counts of prims of other types, such as cameras.

    Prims below point instancers are skipped: they are rendered only as instances.
    """
    usd, geometry, lights = USD.load("Usd"), USD.load("UsdGeom"), USD.load("UsdLux").LightAPI
    meshes, others = list[Any](), Counter[str]()
    prims = iter(usd.PrimRange.Stage(stage, usd.TraverseInstanceProxies()))
    for number, prim in enumerate(prims):
        if number == MAX_PRIMS:
            raise FormatError(
                f"contains more than {MAX_PRIMS} prims; write the mesh to a separate file"
            )
        is_instancer = prim.IsA(geometry.PointInstancer)
        if prim.IsA(geometry.Mesh):
            meshes.append(prim)
        elif (
            is_instancer
            or prim.IsA(geometry.Gprim)
            or prim.IsA(geometry.Camera)
            or prim.HasAPI(lights)
        ):
            others[prim.GetTypeName()] += 1
        if is_instancer:
            prims.PruneChildren()
    return meshes, others


def _reason_not_rendered(prim: Any) -> str:
    """Return why a mesh is not rendered, in a few words; empty if it is."""
    geometry = USD.load("UsdGeom")
    purpose = geometry.Imageable(prim).ComputePurpose()
    if purpose not in (geometry.Tokens.default_, geometry.Tokens.render):
        return f"of purpose {purpose}"
    mesh = geometry.Mesh(prim)
    if not (mesh.GetPointsAttr().HasValue() and mesh.GetFaceVertexCountsAttr().HasValue()):
        return "without points or faces"
    return "" if any(_visibility(prim)) else "invisible"


def _visibility(prim: Any) -> list[bool]:
    """Return the visibility of a mesh at each of its samples, or a single value without samples."""
    geometry, codes = USD.load("UsdGeom"), set[float]()
    mesh = geometry.Imageable(prim)
    while prim and not prim.IsPseudoRoot():
        if imageable := geometry.Imageable(prim):
            codes |= {*attribute_codes(imageable.GetVisibilityAttr())}
        prim = prim.GetParent()
    shown = geometry.Tokens.inherited
    return [mesh.ComputeVisibility(code) == shown for code in sorted(codes) or [0.0]]
