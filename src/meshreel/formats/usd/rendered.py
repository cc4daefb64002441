"""Matrices from prims to the world or to a prototype, at any time code."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.notes import note_kinds, note_left_out
from meshreel.formats.text.decimal_text import Narrowing
from meshreel.formats.usd.primitives import PRIMITIVES
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.model.sequence import Vertices
from meshreel.runtime.extras import USD

Matrix = npt.NDArray[np.float64]


class Transforms:
    """Transforms of the prims of a stage, cached per time code.

    Parameters
    ----------
    root : Usd.Prim, optional
        Transform prims below it to its space; default: to the world.
    """

    def __init__(self, root: Any = None) -> None:
        self._root = root
        self._geometry = USD.load("UsdGeom")
        self._cache = self._geometry.XformCache()
        self._codes: dict[str, list[float]] = {}

    def codes(self, prim: Any) -> list[float]:
        """Return the time codes where transforms of a prim or its ancestors have samples."""
        if not prim or prim.IsPseudoRoot() or (self._root and prim == self._root):
            return []
        path = str(prim.GetPath())
        if path not in self._codes:
            self._codes[path] = self._codes_of(prim)
        return self._codes[path]

    def world(self, prim: Any, code: float) -> Matrix:
        """Return the matrix from the prim to the world, of shape (4, 4), for row vectors.

        Raises
        ------
        FormatError
            If the prim is not below the root.
        """
        self._cache.SetTime(code)
        if self._root:
            if not prim.GetPath().HasPrefix(self._root.GetPath()):
                raise FormatError(
                    f"{prim.GetPath()} moves a mesh of the prototype {self._root.GetPath()} but is "
                    "not below it; move it there"
                )
            relative, _ = self._cache.ComputeRelativeTransform(prim, self._root)
            return np.array(relative, np.float64)
        return np.array(self._cache.GetLocalToWorldTransform(prim), np.float64)

    @staticmethod
    def own_codes(prim: Any) -> list[float]:
        """Return the time codes where the transform of a prim alone has samples."""
        xformable = USD.load("UsdGeom").Xformable(prim)
        operations = xformable.GetOrderedXformOps() if xformable else []
        return [code for one in operations for code in attribute_codes(one.GetAttr())]

    def _codes_of(self, prim: Any) -> list[float]:
        own = self.own_codes(prim)
        xformable = self._geometry.Xformable(prim)
        if xformable and xformable.GetResetXformStack():
            return own
        return own + self.codes(prim.GetParent())


def transform_points(points: Vertices, matrix: Matrix) -> Vertices:
    """Return transformed points of shape (V, 3), in their own float type if that is enough.

    They are computed in float64 and rounded once. The result stays float64 if it is so far from
    the origin that rounding would move a vertex by more than a millionth of the mesh size.
    """
    if np.array_equal(matrix, np.eye(4)):
        return points
    return transform_instances(points, matrix[np.newaxis])


def transform_instances(points: Vertices, matrices: Matrix) -> Vertices:
    """Return points of shape (V, 3) transformed by each of (I, 4, 4) matrices, as (I * V, 3).

    The float type is that of `transform_points`.
    """
    with np.errstate(all="ignore"):  # non-finite values are reported when frames are checked
        moved = points.astype(np.float64) @ matrices[:, :3, :3] + matrices[:, np.newaxis, 3, :3]
        world: Vertices = moved.reshape(-1, 3)
        narrowing = Narrowing()
        narrowing.add(world)
        dtype: Any = points.dtype if narrowing.is_harmless else np.float64
        vertices: Vertices = world.astype(dtype)
    return vertices


def is_mirroring(matrix: Matrix) -> bool:
    """Return whether a transform reverses orientation."""
    with np.errstate(all="ignore"):
        return bool(np.linalg.det(matrix[:3, :3]) < 0)


Indices = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

MAX_INSTANCES = 1 << 22
"""Limit of instances of a prototype, multiplied over nested instancers."""


def all_prims_predicate() -> Any:
    """Return a traversal predicate that includes instance proxies and ``over`` prims."""
    usd = USD.load("Usd")
    return usd.TraverseInstanceProxies(usd.PrimIsActive & usd.PrimIsLoaded & ~usd.PrimIsAbstract)


class PointInstancer:
    """A ``UsdGeom.PointInstancer``, whose arrays are cached for one time code.

    Parameters
    ----------
    prim : Usd.Prim
    """

    def __init__(self, prim: Any) -> None:
        self.prim = prim
        self._instancer = USD.load("UsdGeom").PointInstancer(prim)
        self._cached_selection: tuple[float, Indices, Mask] | None = None
        self._cached_transforms: tuple[float, Matrix] | None = None

    @property
    def path(self) -> str:
        """Its path in the stage."""
        return str(self.prim.GetPath())

    @cached_property
    def prototypes(self) -> list[Any]:
        """The prototype prims, in the order of protoIndices; invalid prims where missing."""
        stage, targets = self.prim.GetStage(), self._instancer.GetPrototypesRel()
        return [stage.GetPrimAtPath(target) for target in targets.GetForwardedTargets()]

    @property
    def codes(self) -> list[float]:
        """Time codes where its arrays have samples."""
        instancer = self._instancer
        arrays = (
            instancer.GetPositionsAttr(),
            instancer.GetOrientationsAttr(),
            self.prim.GetAttribute("orientationsf"),  # unknown to the oldest supported library
            instancer.GetScalesAttr(),
        )
        own = [code for one in arrays if one for code in attribute_codes(one)]
        return own + self.selection_codes

    @property
    def selection_codes(self) -> list[float]:
        """Time codes where the rendered instances, or their prototypes, may change."""
        instancer = self._instancer
        arrays = (
            instancer.GetProtoIndicesAttr(),
            instancer.GetIdsAttr(),
            instancer.GetInvisibleIdsAttr(),
        )
        return [code for one in arrays for code in attribute_codes(one)]

    @property
    def instance_primvars(self) -> list[str]:
        """Names of primvars with a value per instance."""
        primvars = USD.load("UsdGeom").PrimvarsAPI(self.prim).GetPrimvarsWithAuthoredValues()
        return [
            str(one.GetPrimvarName()) for one in primvars if one.GetInterpolation() != "constant"
        ]

    def selection(self, code: float) -> tuple[Indices, Mask]:
        """Return the prototype of each instance at a time code, and a mask of those rendered.

        Inactive and invisible instances are not rendered.

        Raises
        ------
        FormatError
            If there are too many, or they do not match the prototypes or their ids.
        """
        if self._cached_selection is None or self._cached_selection[0] != code:
            self._cached_selection = code, *self._read_selection(code)
        return self._cached_selection[1:]

    def transforms(self, number: int, code: float) -> Matrix:
        """Return matrices from a prototype to the instancer, (I, 4, 4), of rendered instances.

        Raises
        ------
        FormatError
            As `selection`, or if the number of positions, orientations or scales differs.
        """
        numbers, is_rendered = self.selection(code)
        if self._cached_transforms is None or self._cached_transforms[0] != code:
            self._cached_transforms = code, self._read_transforms(len(numbers), code)
        rendered: Matrix = self._cached_transforms[1][(numbers == number) & is_rendered]
        return rendered

    def selection_changes(self) -> bool:
        """Return whether the rendered instances, or their order, change over time."""

        def state_at(code: float) -> tuple[bytes, ...]:
            ids = self._instancer.GetIdsAttr().Get(code)
            state = (*self.selection(code), np.asarray([] if ids is None else ids, np.int64))
            return tuple(one.tobytes() for one in state)

        return len({state_at(code) for code in self.selection_codes}) > 1

    def _read_selection(self, code: float) -> tuple[Indices, Mask]:
        indices = self._instancer.GetProtoIndicesAttr().Get(code)
        numbers = np.asarray([] if indices is None else indices, np.int64)
        if len(numbers) and not 0 <= numbers.min() <= numbers.max() < len(self.prototypes):
            raise FormatError(
                f"{self.path} has protoIndices from {numbers.min()} to {numbers.max()} at time "
                f"code {code:g}, but {len(self.prototypes)} prototypes"
            )
        if len(numbers) > MAX_INSTANCES:
            raise instance_limit_error(self.path, len(numbers))
        if not len(numbers):
            return numbers, np.zeros(0, bool)
        mask = np.asarray(self._instancer.ComputeMaskAtTime(code), bool)
        is_rendered = mask if len(mask) else np.ones(len(numbers), bool)
        if len(is_rendered) != len(numbers):
            raise self._mismatch_error(len(numbers), "ids", code)
        return numbers, is_rendered

    def _read_transforms(self, n_instances: int, code: float) -> Matrix:
        if not n_instances:
            return np.zeros((0, 4, 4))
        instancer = self._instancer
        transforms = instancer.ComputeInstanceTransformsAtTime(
            code, code, instancer.IncludeProtoXform, instancer.IgnoreMask
        )
        if len(transforms) != n_instances:
            raise self._mismatch_error(n_instances, "positions, orientations or scales", code)
        return np.array(transforms, np.float64)

    def _mismatch_error(self, n_instances: int, what: str, code: float) -> FormatError:
        return FormatError(
            f"{self.path} has {n_instances} protoIndices but another number of {what} at time "
            f"code {code:g}"
        )


@dataclass(frozen=True, eq=False)
class PrototypeInstances:
    """The instances of a prototype by an instancer.

    Parameters
    ----------
    number : int
        Index of the prototype.
    """

    instancer: PointInstancer
    number: int

    @property
    def root(self) -> Any:
        """The root prim of the prototype."""
        return self.instancer.prototypes[self.number]

    @cached_property
    def to_root(self) -> Transforms:
        """Transforms from prims below the prototype root to the root."""
        return Transforms(self.root)

    @property
    def codes(self) -> list[float]:
        """Time codes where the instances move within the instancer."""
        return self.instancer.codes + Transforms.own_codes(self.root)

    def are_rendered(self) -> bool:
        """Return whether any instance is rendered at some time, or the instancer is unreadable."""
        for code in self.instancer.selection_codes or [0.0]:
            try:
                numbers, is_rendered = self.instancer.selection(code)
            except FormatError:  # raised again when its meshes are read
                return True
            if (is_rendered & (numbers == self.number)).any():
                return True
        return False


@dataclass(frozen=True, eq=False)
class Placements:
    """World transforms of all instances of a prototype, over nested instancers.

    Parameters
    ----------
    levels : sequence of PrototypeInstances
        From the outermost instancer to the innermost; at least one.
    transforms : Transforms
        Transforms of the stage.
    """

    levels: Sequence[PrototypeInstances]
    transforms: Transforms

    @property
    def codes(self) -> list[float]:
        """Time codes where the instances move."""
        own = [code for one in self.levels for code in one.codes]
        above = [code for level, above in self._above() for code in above.codes(level)]
        return own + above

    def world(self, code: float) -> Matrix:
        """Return matrices from the innermost prototype to the world, of shape (I, 4, 4).

        Raises
        ------
        FormatError
            If the arrays of an instancer do not match, or there are too many instances.
        """
        matrices = np.eye(4)[np.newaxis]
        pairs = list(zip(self.levels, self._above(), strict=True))
        for level, (prim, above) in reversed(pairs):
            own = level.instancer.transforms(level.number, code)
            if len(own) * len(matrices) > MAX_INSTANCES:
                raise instance_limit_error(level.instancer.path, len(own) * len(matrices))
            with np.errstate(all="ignore"):  # non-finite positions are reported later
                outer = own @ above.world(prim, code)
                matrices = (matrices[np.newaxis] @ outer[:, np.newaxis]).reshape(-1, 4, 4)
        return matrices

    def _above(self) -> Iterator[tuple[Any, Transforms]]:
        """Yield each instancer with the transforms to its parent space: world or prototype."""
        above = self.transforms
        for level in self.levels:
            yield level.instancer.prim, above
            above = level.to_root


def instance_limit_error(path: str, n_instances: int) -> FormatError:
    """Return the error for an instancer with too many instances."""
    return FormatError(
        f"{path} makes {n_instances} instances of a prototype; the limit is {MAX_INSTANCES}"
    )


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
