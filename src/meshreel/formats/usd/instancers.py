"""Point instancers: transforms of the instances of each prototype, at any time code."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.formats.usd.transforms import Matrix, Transforms
from meshreel.runtime.extras import USD

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
