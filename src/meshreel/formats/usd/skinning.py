"""Meshes that a skeleton moves: blend shapes and skinning, by UsdSkel."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.usd.instancers import all_prims
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.formats.usd.transforms import Transforms
from meshreel.model.sequence import Vertices


@dataclass(frozen=True, eq=False)
class Shapes:
    """The blend shapes of a mesh.

    Attributes
    ----------
    query : UsdSkel.BlendShapeQuery
    point_indices : list
        Of each shape, which points it moves.
    offsets : list
        Of each shape and inbetween, how far it moves them.
    """

    query: Any
    point_indices: Any
    offsets: Any


@dataclass(frozen=True, eq=False)
class Skin:
    """How a skeleton moves a mesh.

    Attributes
    ----------
    skeleton_prim : Usd.Prim
        Where the skeleton is in the stage; of an instance the query only knows its prototype.
    skeleton : UsdSkel.SkeletonQuery
    skinning : UsdSkel.SkinningQuery
    """

    skeleton_prim: Any
    skeleton: Any
    skinning: Any
    shapes: Shapes | None

    @property
    def space(self) -> Any:
        """The prim in whose space the points are when they are deformed."""
        has_joints = self.skinning.HasJointInfluences()
        return self.skeleton_prim if has_joints else self.skinning.GetPrim()

    def codes(self, transforms: Transforms) -> list[float]:
        """Where what moves the points, beside the points themselves, has samples."""
        codes = transforms.codes(self.space)
        if binding := self.skinning.GetGeomBindTransformAttr():
            codes = codes + attribute_codes(binding)
        if animation := self.skeleton.GetAnimQuery():
            if self.skinning.HasJointInfluences():
                codes = codes + list(animation.GetJointTransformTimeSamples())
            if self.shapes is not None:
                codes = codes + list(animation.GetBlendShapeWeightTimeSamples())
        return codes

    def deformed(self, points: Vertices, code: float) -> Vertices:
        """Points of shape (V, 3), from the space of the mesh to `space`; float32.

        Raises
        ------
        FormatError
            If weights, joints or shapes do not fit the points.
        """
        array = USD.load("Vt").Vec3fArray.FromNumpy(np.ascontiguousarray(points, np.float32))
        is_done = self.shapes is None or self._blend(self.shapes, array, code)
        if is_done and self.skinning.HasJointInfluences():
            joints = self.skeleton.ComputeSkinningTransforms(code)
            is_done = bool(joints) and self.skinning.ComputeSkinnedPoints(joints, array, code)
        if not is_done:
            path = self.skinning.GetPrim().GetPath()
            raise FormatError(
                f"mesh {path} has {len(points)} points that its joint weights or blend shapes do "
                f"not fit at time code {code:g}; bind it to its skeleton again"
            )
        return np.asarray(array)

    def _blend(self, shapes: Shapes, points: Any, code: float) -> bool:
        """Whether blend shapes could move the points, which they have then."""
        animation = self.skeleton.GetAnimQuery()
        if not animation or not (given := animation.ComputeBlendShapeWeights(code)):
            return True
        own = self.skinning.GetBlendShapeMapper().Remap(given, type(given)(), 1)
        weights = shapes.query.ComputeSubShapeWeights(own)
        return bool(
            shapes.query.ComputeDeformedPoints(
                *weights, shapes.point_indices, shapes.offsets, points
            )
        )


def find_skins(prims: Iterable[Any]) -> dict[str, Skin]:
    """How skeletons move meshes, by the paths of those of the meshes that they do move."""
    skel = USD.load("UsdSkel")
    roots = {str(root.GetPath()): root for root in map(skel.Root.Find, prims) if root}
    skins = {}
    for root in roots.values():
        for skin in _skins_below(root):
            skins[str(skin.skinning.GetPrim().GetPath())] = skin
    return skins


def _skins_below(root: Any) -> Iterator[Skin]:
    predicate, cache = all_prims(), USD.load("UsdSkel").Cache()
    cache.Populate(root, predicate)
    for binding in cache.ComputeSkelBindings(root, predicate):
        skeleton = cache.GetSkelQuery(binding.GetSkeleton())
        for skinning in binding.GetSkinningTargets() if skeleton else ():
            if skinning.HasJointInfluences() or skinning.HasBlendShapes():
                prim = binding.GetSkeleton().GetPrim()
                yield Skin(prim, skeleton, skinning, _shapes(skinning))


def _shapes(skinning: Any) -> Shapes | None:
    if not skinning.HasBlendShapes():
        return None
    skel = USD.load("UsdSkel")
    query = skel.BlendShapeQuery(skel.BindingAPI(skinning.GetPrim()))
    return Shapes(query, query.ComputeBlendShapePointIndices(), query.ComputeSubShapePointOffsets())
