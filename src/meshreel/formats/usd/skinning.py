"""Meshes deformed by a skeleton: blend shapes and skinning with UsdSkel."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.usd.instancers import all_prims_predicate
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.formats.usd.transforms import Transforms
from meshreel.model.sequence import Vertices
from meshreel.runtime.extras import USD


@dataclass(frozen=True, eq=False)
class BlendShapes:
    """The blend shapes of a mesh.

    Attributes
    ----------
    query : UsdSkel.BlendShapeQuery
    point_indices : list
        Per shape, the indices of the points that it moves.
    offsets : list
        Per shape and inbetween, the offsets of these points.
    """

    query: Any
    point_indices: Any
    offsets: Any


@dataclass(frozen=True, eq=False)
class Skin:
    """The deformation of a mesh by a skeleton.

    Attributes
    ----------
    skeleton_prim : Usd.Prim
        The skeleton in the stage; for an instance, the query has only its prototype.
    skeleton : UsdSkel.SkeletonQuery
    skinning : UsdSkel.SkinningQuery
    """

    skeleton_prim: Any
    skeleton: Any
    skinning: Any
    shapes: BlendShapes | None

    @property
    def space(self) -> Any:
        """The prim in whose space the deformed points are."""
        has_joints = self.skinning.HasJointInfluences()
        return self.skeleton_prim if has_joints else self.skinning.GetPrim()

    def codes(self, transforms: Transforms) -> list[float]:
        """Return the time codes where transforms, joints or blend shapes have samples."""
        codes = transforms.codes(self.space)
        if bind_transform := self.skinning.GetGeomBindTransformAttr():
            codes = codes + attribute_codes(bind_transform)
        if animation := self.skeleton.GetAnimQuery():
            if self.skinning.HasJointInfluences():
                codes = codes + list(animation.GetJointTransformTimeSamples())
            if self.shapes is not None:
                codes = codes + list(animation.GetBlendShapeWeightTimeSamples())
        return codes

    def deform(self, points: Vertices, code: float) -> Vertices:
        """Return deformed points in `space`, from points in local space, as float32 of (V, 3).

        Raises
        ------
        FormatError
            If weights, joints or shapes do not match the points.
        """
        array = USD.load("Vt").Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32))
        is_valid = self.shapes is None or self._blend(self.shapes, array, code)
        if is_valid and self.skinning.HasJointInfluences():
            joints = self.skeleton.ComputeSkinningTransforms(code)
            is_valid = bool(joints) and self.skinning.ComputeSkinnedPoints(joints, array, code)
        if not is_valid:
            path = self.skinning.GetPrim().GetPath()
            raise FormatError(
                f"mesh {path} has {len(points)} points, which its joint weights or blend shapes do "
                f"not match at time code {code:g}; bind it to its skeleton again"
            )
        return np.asarray(array)

    def _blend(self, shapes: BlendShapes, points: Any, code: float) -> bool:
        """Apply blend shapes to the points in place, and return whether that succeeded."""
        animation = self.skeleton.GetAnimQuery()
        if not animation or not (all_weights := animation.ComputeBlendShapeWeights(code)):
            return True
        own = self.skinning.GetBlendShapeMapper().Remap(all_weights, type(all_weights)(), 1)
        weights = shapes.query.ComputeSubShapeWeights(own)
        return bool(
            shapes.query.ComputeDeformedPoints(
                *weights, shapes.point_indices, shapes.offsets, points
            )
        )


def find_skins(prims: Iterable[Any]) -> dict[str, Skin]:
    """Return the skins of the meshes that a skeleton deforms, by path of the mesh."""
    skel = USD.load("UsdSkel")
    roots = {str(root.GetPath()): root for root in map(skel.Root.Find, prims) if root}
    skins = {}
    for root in roots.values():
        for skin in _skins_below(root):
            skins[str(skin.skinning.GetPrim().GetPath())] = skin
    return skins


def _skins_below(root: Any) -> Iterator[Skin]:
    predicate, cache = all_prims_predicate(), USD.load("UsdSkel").Cache()
    cache.Populate(root, predicate)
    for binding in cache.ComputeSkelBindings(root, predicate):
        skeleton = cache.GetSkelQuery(binding.GetSkeleton())
        for skinning in binding.GetSkinningTargets() if skeleton else ():
            if skinning.HasJointInfluences() or skinning.HasBlendShapes():
                prim = binding.GetSkeleton().GetPrim()
                yield Skin(prim, skeleton, skinning, _shapes(skinning))


def _shapes(skinning: Any) -> BlendShapes | None:
    if not skinning.HasBlendShapes():
        return None
    skel = USD.load("UsdSkel")
    query = skel.BlendShapeQuery(skel.BindingAPI(skinning.GetPrim()))
    return BlendShapes(
        query, query.ComputeBlendShapePointIndices(), query.ComputeSubShapePointOffsets()
    )
