"""Point instancers: where the copies of each of their prototypes are, at any time code."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.usd.sampling import attribute_codes
from meshreel.formats.usd.transforms import Matrix, Transforms

Indices = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

MAX_INSTANCES = 1 << 22
"""Copies of one prototype, those of instancers within it included."""


def all_prims() -> Any:
    """A predicate of ranges: prims of instances too, and what prototypes may be, only ``over``."""
    usd = USD.load("Usd")
    return usd.TraverseInstanceProxies(usd.PrimIsActive & usd.PrimIsLoaded & ~usd.PrimIsAbstract)


class PointInstancer:
    """A ``UsdGeom.PointInstancer``, whose numbers are read once for each time code.

    Parameters
    ----------
    prim : Usd.Prim
    """

    def __init__(self, prim: Any) -> None:
        self.prim = prim
        self._instancer = USD.load("UsdGeom").PointInstancer(prim)
        self._selected: tuple[float, Indices, Mask] | None = None
        self._placed: tuple[float, Matrix] | None = None

    @property
    def path(self) -> str:
        """Where it is in the stage."""
        return str(self.prim.GetPath())

    @cached_property
    def prototypes(self) -> list[Any]:
        """The prims that it copies, in the order of their numbers; some may not be there."""
        stage, targets = self.prim.GetStage(), self._instancer.GetPrototypesRel()
        return [stage.GetPrimAtPath(target) for target in targets.GetForwardedTargets()]

    @property
    def codes(self) -> list[float]:
        """Where its arrays have samples."""
        found = self._instancer
        arrays = (
            found.GetPositionsAttr(),
            found.GetOrientationsAttr(),
            self.prim.GetAttribute("orientationsf"),  # newer than the oldest library allowed
            found.GetScalesAttr(),
        )
        own = [code for one in arrays if one for code in attribute_codes(one)]
        return own + self.selection_codes

    @property
    def selection_codes(self) -> list[float]:
        """Where it may change which instances are drawn, and of which prototypes."""
        found = self._instancer
        arrays = found.GetProtoIndicesAttr(), found.GetIdsAttr(), found.GetInvisibleIdsAttr()
        return [code for one in arrays for code in attribute_codes(one)]

    @property
    def own_values(self) -> list[str]:
        """Names of primvars that have a value for each instance."""
        primvars = USD.load("UsdGeom").PrimvarsAPI(self.prim).GetPrimvarsWithAuthoredValues()
        return [
            str(one.GetPrimvarName()) for one in primvars if one.GetInterpolation() != "constant"
        ]

    def selection(self, code: float) -> tuple[Indices, Mask]:
        """The prototype of each instance at a time code, and whether the instance is drawn.

        Those that are inactive or invisible are not drawn.

        Raises
        ------
        FormatError
            If there are too many, or they do not fit the prototypes or their ids.
        """
        if self._selected is None or self._selected[0] != code:
            self._selected = code, *self._read_selection(code)
        return self._selected[1:]

    def transforms(self, number: int, code: float) -> Matrix:
        """From a prototype to the instancer, of shape (I, 4, 4), for each instance drawn.

        Raises
        ------
        FormatError
            As `selection`, or if positions, orientations or scales do not fit.
        """
        numbers, is_drawn = self.selection(code)
        if self._placed is None or self._placed[0] != code:
            self._placed = code, self._read_transforms(len(numbers), code)
        drawn: Matrix = self._placed[1][(numbers == number) & is_drawn]
        return drawn

    def changes(self) -> bool:
        """Whether which instances are drawn, or their order, is not the same at all times."""

        def drawn_at(code: float) -> tuple[bytes, ...]:
            ids = self._instancer.GetIdsAttr().Get(code)
            found = (*self.selection(code), np.asarray([] if ids is None else ids, np.int64))
            return tuple(one.tobytes() for one in found)

        return len({drawn_at(code) for code in self.selection_codes}) > 1

    def _read_selection(self, code: float) -> tuple[Indices, Mask]:
        given = self._instancer.GetProtoIndicesAttr().Get(code)
        numbers = np.asarray([] if given is None else given, np.int64)
        if len(numbers) and not 0 <= numbers.min() <= numbers.max() < len(self.prototypes):
            raise FormatError(
                f"{self.path} has protoIndices of {numbers.min()} to {numbers.max()} at time code "
                f"{code:g}, and {len(self.prototypes)} prototypes"
            )
        if len(numbers) > MAX_INSTANCES:
            raise too_many(self.path, len(numbers))
        if not len(numbers):
            return numbers, np.zeros(0, bool)
        mask = np.asarray(self._instancer.ComputeMaskAtTime(code), bool)
        is_drawn = mask if len(mask) else np.ones(len(numbers), bool)
        if len(is_drawn) != len(numbers):
            raise self._unfit(len(numbers), "ids", code)
        return numbers, is_drawn

    def _read_transforms(self, n_instances: int, code: float) -> Matrix:
        if not n_instances:
            return np.zeros((0, 4, 4))
        kind = self._instancer
        found = kind.ComputeInstanceTransformsAtTime(
            code, code, kind.IncludeProtoXform, kind.IgnoreMask
        )
        if len(found) != n_instances:
            raise self._unfit(n_instances, "positions, orientations or scales", code)
        return np.array(found, np.float64)

    def _unfit(self, n_instances: int, what: str, code: float) -> FormatError:
        return FormatError(
            f"{self.path} has {n_instances} protoIndices and another number of {what} at time "
            f"code {code:g}"
        )


@dataclass(frozen=True, eq=False)
class Copies:
    """The copies of a prototype that an instancer makes.

    Parameters
    ----------
    number : int
        Of the prototype.
    """

    instancer: PointInstancer
    number: int

    @property
    def root(self) -> Any:
        """The prim that is copied, with all below it."""
        return self.instancer.prototypes[self.number]

    @cached_property
    def to_root(self) -> Transforms:
        """Transforms of prims below the prototype to it."""
        return Transforms(self.root)

    @property
    def codes(self) -> list[float]:
        """Where the copies move, within the instancer."""
        return self.instancer.codes + Transforms.own_codes(self.root)

    def are_drawn(self) -> bool:
        """Whether one is at any time; of an instancer that cannot be read, yes."""
        for code in self.instancer.selection_codes or [0.0]:
            try:
                numbers, is_drawn = self.instancer.selection(code)
            except FormatError:  # which reading its meshes raises again
                return True
            if (is_drawn & (numbers == self.number)).any():
                return True
        return False


@dataclass(frozen=True, eq=False)
class Placements:
    """Where all copies of a prototype are, which instancers within instancers make.

    Parameters
    ----------
    levels : sequence of Copies
        From the outermost instancer to the innermost; at least one.
    transforms : Transforms
        Of the stage.
    """

    levels: Sequence[Copies]
    transforms: Transforms

    @property
    def codes(self) -> list[float]:
        """Where they move."""
        own = [code for one in self.levels for code in one.codes]
        above = [code for level, above in self._above() for code in above.codes(level)]
        return own + above

    def world(self, code: float) -> Matrix:
        """From the innermost prototype to the world, of shape (I, 4, 4).

        Raises
        ------
        FormatError
            If the arrays of an instancer do not fit, or there are more than `MAX_INSTANCES`.
        """
        found = np.eye(4)[np.newaxis]
        pairs = list(zip(self.levels, self._above(), strict=True))
        for level, (prim, above) in reversed(pairs):
            own = level.instancer.transforms(level.number, code)
            if len(own) * len(found) > MAX_INSTANCES:
                raise too_many(level.instancer.path, len(own) * len(found))
            with np.errstate(all="ignore"):  # what is not finite is found in positions
                outer = own @ above.world(prim, code)
                found = (found[np.newaxis] @ outer[:, np.newaxis]).reshape(-1, 4, 4)
        return found

    def _above(self) -> Iterator[tuple[Any, Transforms]]:
        """Each instancer, and the transforms to what holds it: the world, or a prototype."""
        above = self.transforms
        for level in self.levels:
            yield level.instancer.prim, above
            above = level.to_root


def too_many(path: str, n_instances: int) -> FormatError:
    """The error for an instancer of more copies than are read."""
    return FormatError(
        f"{path} makes {n_instances} copies of a prototype; at most {MAX_INSTANCES} are read"
    )
