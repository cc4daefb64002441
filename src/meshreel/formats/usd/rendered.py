"""The meshes of a stage that are rendered, and the transforms of each and of its instances."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers
from meshreel.errors import FormatError
from meshreel.formats.notes import listed, note_kinds, note_left_out
from meshreel.formats.usd.sampling import attribute_codes, sample_codes
from meshreel.runtime.counting import counted
from meshreel.runtime.extras import USD

Mask = npt.NDArray[np.bool_]

MAX_PRIMS = 1_000_000
"""Limit, since nested instances can make a small file expand to any number of prims."""

MAX_INSTANCES = 1 << 22
"""Limit of instances of a prototype, multiplied over nested instancers."""

SELECTION = ("protoIndices", "ids", "invisibleIds")
"""Attributes of a point instancer that decide which instances are rendered."""

PLACEMENT = ("positions", "orientations", "orientationsf", "scales")


def all_prims_predicate() -> Any:
    """Return a traversal predicate that includes instance proxies and ``over`` prims."""
    usd = USD.load("Usd")
    return usd.TraverseInstanceProxies(usd.PrimIsActive & usd.PrimIsLoaded & ~usd.PrimIsAbstract)


class Transforms:
    """Transforms of the prims of a stage at any time code.

    Parameters
    ----------
    root : Usd.Prim, optional
        Transform prims below it to its space; default: to the world.
    """

    def __init__(self, root: Any = None) -> None:
        self._root = root
        self._cache = USD.load("UsdGeom").XformCache()

    def codes(self, prim: Any) -> list[float]:
        """Return the time codes where transforms of a prim or its ancestors have samples."""
        codes: list[float] = []
        while prim and not prim.IsPseudoRoot() and not (self._root and prim == self._root):
            codes += own_codes(prim)
            xformable = USD.load("UsdGeom").Xformable(prim)
            if xformable and xformable.GetResetXformStack():
                break
            prim = prim.GetParent()
        return codes

    def world(self, prim: Any, code: float) -> Floats:
        """Return the matrix from the prim to the world, of shape (4, 4), for row vectors.

        Raises
        ------
        FormatError
            If the prim is not below the root.
        """
        self._cache.SetTime(code)
        if not self._root:
            return np.array(self._cache.GetLocalToWorldTransform(prim), np.float64)
        if not prim.GetPath().HasPrefix(self._root.GetPath()):
            raise FormatError(
                f"{prim.GetPath()} moves a mesh of the prototype {self._root.GetPath()} but is "
                "not below it; move it there"
            )
        return np.array(self._cache.ComputeRelativeTransform(prim, self._root)[0], np.float64)


def own_codes(prim: Any) -> list[float]:
    """Return the time codes where the transform of a prim alone has samples."""
    xformable = USD.load("UsdGeom").Xformable(prim)
    operations = xformable.GetOrderedXformOps() if xformable else []
    return [code for operation in operations for code in attribute_codes(operation.GetAttr())]


class PointInstancer:
    """A ``UsdGeom.PointInstancer``, whose arrays are cached for one time code.

    Parameters
    ----------
    prim : Usd.Prim

    Attributes
    ----------
    path : str
        Its path in the stage.
    selection : function of a time code
        Returns the prototype of each instance, and a mask of those that are rendered: neither
        inactive nor invisible. Raises `FormatError` if there are too many, or they do not match the
        prototypes or their ids.
    """

    def __init__(self, prim: Any) -> None:
        self.prim, self.path = prim, str(prim.GetPath())
        self._instancer = USD.load("UsdGeom").PointInstancer(prim)
        self.selection: Callable[[float], tuple[Integers, Mask]] = lru_cache(1)(self._selection)
        self._matrices = lru_cache(1)(self._all_matrices)

    @cached_property
    def prototypes(self) -> list[Any]:
        """The prototype prims, in the order of protoIndices; invalid prims where missing."""
        stage, targets = self.prim.GetStage(), self._instancer.GetPrototypesRel()
        return [stage.GetPrimAtPath(target) for target in targets.GetForwardedTargets()]

    @property
    def instance_primvars(self) -> list[str]:
        """Names of primvars with a value per instance."""
        primvars = USD.load("UsdGeom").PrimvarsAPI(self.prim).GetPrimvarsWithAuthoredValues()
        return [
            str(primvar.GetPrimvarName())
            for primvar in primvars
            if primvar.GetInterpolation() != "constant"
        ]

    def matrices(self, number: int, code: float) -> Floats:
        """Return matrices from a prototype to the instancer, (I, 4, 4), of rendered instances.

        Raises
        ------
        FormatError
            As `selection`, or if the number of positions, orientations or scales differs.
        """
        numbers, is_rendered = self.selection(code)
        rendered: Floats = self._matrices(code)[(numbers == number) & is_rendered]
        return rendered

    def selection_changes(self) -> bool:
        """Return whether the rendered instances, or their order, change over time."""

        def state_at(code: float) -> tuple[bytes, ...]:
            ids = self._instancer.GetIdsAttr().Get(code)
            state = (*self.selection(code), np.asarray([] if ids is None else ids, np.int64))
            return tuple(array.tobytes() for array in state)

        return len({state_at(code) for code in sample_codes(self.prim, SELECTION)}) > 1

    def _selection(self, code: float) -> tuple[Integers, Mask]:
        indices = self._instancer.GetProtoIndicesAttr().Get(code)
        numbers = np.asarray([] if indices is None else indices, np.int64)
        if not len(numbers):
            return numbers, np.zeros(0, bool)
        if not 0 <= numbers.min() <= numbers.max() < len(self.prototypes):
            raise FormatError(
                f"{self.path} has protoIndices from {numbers.min()} to {numbers.max()} at time "
                f"code {code:g}, but {len(self.prototypes)} prototypes"
            )
        _check_count(self.path, len(numbers))
        mask = np.asarray(self._instancer.ComputeMaskAtTime(code), bool)
        is_rendered = mask if len(mask) else np.ones(len(numbers), bool)
        self._check_match(len(is_rendered), len(numbers), "ids", code)
        return numbers, is_rendered

    def _all_matrices(self, code: float) -> Floats:
        n_instances = len(self.selection(code)[0])
        if not n_instances:
            return np.zeros((0, 4, 4))
        instancer = self._instancer
        matrices = instancer.ComputeInstanceTransformsAtTime(
            code, code, instancer.IncludeProtoXform, instancer.IgnoreMask
        )
        self._check_match(len(matrices), n_instances, "positions, orientations or scales", code)
        return np.array(matrices, np.float64)

    def _check_match(self, count: int, n_instances: int, what: str, code: float) -> None:
        if count != n_instances:
            raise FormatError(
                f"{self.path} has {n_instances} protoIndices but another number of {what} at time "
                f"code {code:g}"
            )


@dataclass(frozen=True, eq=False)
class Level:
    """The instances of a prototype by an instancer.

    Parameters
    ----------
    number : int
        Index of the prototype.
    above : Transforms
        Transforms to the space that contains the instancer: the world or an outer prototype.
    """

    instancer: PointInstancer
    number: int
    above: Transforms

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
        """Time codes where the instances move."""
        own = sample_codes(self.instancer.prim, PLACEMENT + SELECTION) + own_codes(self.root)
        return own + self.above.codes(self.instancer.prim)

    def is_rendered(self) -> bool:
        """Return whether any instance is rendered at some time, or the instancer is unreadable."""
        for code in sample_codes(self.instancer.prim, SELECTION) or [0.0]:
            try:
                numbers, is_rendered = self.instancer.selection(code)
            except FormatError:  # raised again when its meshes are read
                return True
            if (is_rendered & (numbers == self.number)).any():
                return True
        return False


def instance_matrices(levels: Sequence[Level], code: float) -> Floats:
    """Return matrices from the innermost prototype to the world, of shape (I, 4, 4).

    Raises
    ------
    FormatError
        If the arrays of an instancer do not match, or there are too many instances.
    """
    matrices = np.eye(4)[np.newaxis]
    for level in reversed(levels):
        own = level.instancer.matrices(level.number, code)
        _check_count(level.instancer.path, len(own) * len(matrices))
        with np.errstate(all="ignore"):  # non-finite positions are reported later
            outer = own @ level.above.world(level.instancer.prim, code)
            matrices = (matrices[np.newaxis] @ outer[:, np.newaxis]).reshape(-1, 4, 4)
    return matrices


def _check_count(path: str, n_instances: int) -> None:
    if n_instances > MAX_INSTANCES:
        raise FormatError(
            f"{path} makes {n_instances} instances of a prototype; the limit is {MAX_INSTANCES}"
        )


@dataclass(frozen=True, eq=False)
class RenderedMesh:
    """A mesh of a stage, or of a prototype of point instancers.

    Parameters
    ----------
    prim : Usd.Prim
    transforms : Transforms
        Transforms to the world, or to the root of the prototype.
    levels : tuple of Level
        The prototypes that contain it, from the outermost instancer to the innermost; empty for a
        mesh outside of instancers.
    """

    prim: Any
    transforms: Transforms
    levels: tuple[Level, ...] = ()

    @property
    def name(self) -> str:
        """Its path, prefixed by that of an instancer whose prototype is elsewhere in the stage."""
        name = str(self.prim.GetPath())
        for level in reversed(self.levels):
            above = level.instancer.path
            name = name if name.startswith(f"{above}/") else f"{above}{name}"
        return name


def rendered_meshes(stage: Any, notes: list[str]) -> list[RenderedMesh]:
    """Return the meshes that are rendered, in stage order, instances included.

    These are the meshes that are visible at some time, have the purpose default or render, and have
    points and faces; a prototype must have at least one instance.

    Parameters
    ----------
    stage : Usd.Stage
    notes : list of str
        Gains a sentence on meshes that are not rendered, on other geometry, and on instances.

    Raises
    ------
    FormatError
        If there are none, listing the contents; or if the stage has more than `MAX_PRIMS` prims.
    """
    geometry, usd = _Geometry(), USD.load("Usd")
    geometry.add(usd.PrimRange.Stage(stage, usd.TraverseInstanceProxies()), Transforms())
    reasons = [_reason_not_rendered(mesh) for mesh in geometry.meshes]
    rendered = [mesh for mesh, reason in zip(geometry.meshes, reasons, strict=True) if not reason]
    hidden = Counter(reason for reason in reasons if reason)
    contents = ", ".join(
        [f"{n} {'mesh' if n == 1 else 'meshes'} {reason}" for reason, n in hidden.items()]
        + [f"{n} {kind}" for kind, n in geometry.others.items()]
    )
    if not rendered:
        raise FormatError(f"contains no mesh that is rendered, only {contents or 'no geometry'}")
    blinking = [mesh.name for mesh in rendered if len(set(_visibility(mesh))) > 1]
    note_kinds(notes, "visibility that changes over time", blinking)
    if contents:
        note_left_out(notes, contents)
    _note_instances(
        {level.instancer.path: level.instancer for m in rendered for level in m.levels}, notes
    )
    return rendered


@dataclass(eq=False)
class _Geometry:
    """Meshes of a stage, and counts of prims of other types, such as cameras and lights."""

    meshes: list[RenderedMesh] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)
    n_prims: int = 0

    def add(self, prims: Any, transforms: Transforms, levels: tuple[Level, ...] = ()) -> None:
        """Add the prims of a range, which is within the given prototypes."""
        geometry, lights = USD.load("UsdGeom"), USD.load("UsdLux").LightAPI
        prims = iter(prims)
        for prim in prims:
            self.n_prims += 1
            if self.n_prims > MAX_PRIMS:
                raise FormatError(
                    f"contains more than {MAX_PRIMS} prims; write the mesh to a separate file"
                )
            if prim.IsA(geometry.Mesh):
                self.meshes.append(RenderedMesh(prim, transforms, levels))
            elif prim.IsA(geometry.PointInstancer):
                self._add_instancer(prim, transforms, levels)
                prims.PruneChildren()  # prims below are rendered only as instances
            elif prim.IsA(geometry.Gprim) or prim.IsA(geometry.Camera) or prim.HasAPI(lights):
                self.others[prim.GetTypeName()] += 1

    def _add_instancer(self, prim: Any, transforms: Transforms, levels: tuple[Level, ...]) -> None:
        instancer, n_before = PointInstancer(prim), len(self.meshes)
        if instancer.path in [level.instancer.path for level in levels]:
            raise FormatError(f"point instancer {instancer.path} is in one of its prototypes")
        for number, root in enumerate(instancer.prototypes):
            if not root:
                self.others[f"missing prototype of {instancer.path}"] += 1
                continue
            prims = USD.load("Usd").PrimRange(root, all_prims_predicate())
            level = Level(instancer, number, transforms)
            self.add(prims, level.to_root, (*levels, level))
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
    if not (mesh.GetPointsAttr().HasValue() and mesh.GetFaceVertexCountsAttr().HasValue()):
        return "without points or faces"
    if not all(level.is_rendered() for level in rendered.levels):
        return "of prototypes without a rendered instance"
    return "" if any(_visibility(rendered)) else "invisible"


def _visibility(mesh: RenderedMesh) -> list[bool]:
    """Return the visibility of a mesh at each of its samples, or a single value without samples."""
    attributes = [imageable.GetVisibilityAttr() for imageable in _visibility_chain(mesh)]
    times = sorted({code for attribute in attributes for code in attribute_codes(attribute)}) or [
        0.0
    ]
    invisible = USD.load("UsdGeom").Tokens.invisible
    return [all(attribute.Get(time) != invisible for attribute in attributes) for time in times]


def _visibility_chain(mesh: RenderedMesh) -> Iterator[Any]:
    """Yield the mesh and its ancestors; at a prototype root, continue with the instancer."""
    prim, levels = mesh.prim, list(mesh.levels)
    while prim and not prim.IsPseudoRoot():
        if imageable := USD.load("UsdGeom").Imageable(prim):
            yield imageable
        is_root = levels and prim == levels[-1].root
        prim = levels.pop().instancer.prim if is_root else prim.GetParent()


def _note_instances(instancers: dict[str, PointInstancer], notes: list[str]) -> None:
    """Note the instances of a file: their number, those left out, and changes over time."""
    if not instancers:
        return
    counts, masked, changing, primvars = [], [], [], dict[str, None]()
    for path, instancer in instancers.items():
        with suppress(FormatError):  # raised again when its meshes are read
            first = min(sample_codes(instancer.prim, SELECTION), default=0.0)
            _, is_rendered = instancer.selection(first)
            counts.append(int(np.count_nonzero(is_rendered)))
            if not is_rendered.all():
                masked.append(f"{np.count_nonzero(~is_rendered)} of {len(is_rendered)} of {path}")
            if instancer.selection_changes():
                changing.append(path)
        primvars |= dict.fromkeys(instancer.instance_primvars)
    where = f" of {len(counts)} point instancers" if len(counts) > 1 else ""
    notes.append(
        f"baked {counted(sum(counts), 'instance')}{where} into one mesh per prototype mesh"
    )
    note_kinds(notes, "instances that are inactive or invisible", masked)
    if changing:
        notes.append(
            f"the rendered instances change over time: {listed(changing)}; the vertices of a frame "
            "are those of the instances in that frame, in file order"
        )
    note_kinds(notes, "primvars of instances", primvars)
