"""Objects of a JSON file, each value of which is checked when it is asked for."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import FormatError

MAX_WHOLE = 1 << 53
"""Whole numbers up to here are the same in every reader of JSON."""


@dataclass(frozen=True, eq=False)
class JsonObject:
    """An object of a JSON file, and where it stands.

    Parameters
    ----------
    values : dict
        As it was parsed.
    place : str
        Where it stands, in words: "accessor 3". Every error begins with it.
    """

    values: dict[str, Any]
    place: str

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def error(self, key: str, allowed: str) -> FormatError:
        """The error to raise where the value of a key is not what is allowed."""
        if key not in self.values:
            return FormatError(f"{self.place}: has no {key!r}; it must be {allowed}")
        given = repr(self.values[key])
        shown = given if len(given) <= 60 else f"{given[:57]}..."
        return FormatError(f"{self.place}: {key!r} must be {allowed}; got {shown}")

    def whole(self, key: str, default: int | None = None) -> int:
        """A whole number from 0 on; without a default the key must be there."""
        value = self.values.get(key, default)
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        if value is None or not _is_whole(value):
            raise self.error(key, "a whole number from 0 to 2^53")
        return int(value)

    def index(self, key: str, n_items: int) -> int | None:
        """The number of one of so many items; None if the key is not there."""
        if key not in self.values:
            return None
        value = self.whole(key)
        if value >= n_items:
            raise self.error(key, f"below {n_items}, which is how many there are")
        return value

    def indices(self, key: str, n_items: int) -> list[int]:
        """Numbers of some of so many items; none if the key is not there."""
        values = self.values.get(key, [])
        if not isinstance(values, list) or not all(_is_whole(value) for value in values):
            raise self.error(key, "a list of whole numbers from 0 to 2^53")
        if any(value >= n_items for value in values):
            raise self.error(key, f"a list of numbers below {n_items}, which is how many there are")
        return values

    def numbers(
        self, key: str, length: int, default: npt.ArrayLike | None = None
    ) -> npt.NDArray[np.float64]:
        """So many finite numbers; without a default the key must be there."""
        if key not in self.values and default is not None:
            return np.array(default, np.float64)
        values = self.values.get(key)
        if (
            not isinstance(values, list)
            or len(values) != length
            or not all(_is_finite(value) for value in values)
        ):
            raise self.error(key, f"a list of {length} finite numbers")
        return np.array(values, np.float64)

    def number(self, key: str, default: float) -> float:
        """A finite number; the default if the key is not there."""
        value = self.values.get(key, default)
        if not _is_finite(value):
            raise self.error(key, "a finite number")
        return float(value)

    def flag(self, key: str) -> bool:
        """Whether a key that may be left out is true."""
        value = self.values.get(key, False)
        if not isinstance(value, bool):
            raise self.error(key, "true or false")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Text; without a default the key must be there."""
        value = self.values.get(key, default)
        if not isinstance(value, str):
            raise self.error(key, "text")
        return value

    def texts(self, key: str) -> list[str]:
        """A list of text; empty if the key is not there."""
        values = self.values.get(key, [])
        if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
            raise self.error(key, "a list of text")
        return values

    def child(self, key: str) -> "JsonObject | None":
        """An object within this one; None if the key is not there."""
        if key not in self.values:
            return None
        value = self.values[key]
        if not isinstance(value, dict):
            raise self.error(key, "an object")
        return JsonObject(value, f"{self.place}, {key}")

    def needed(self, key: str) -> "JsonObject":
        """An object within this one, which must be there."""
        found = self.child(key)
        if found is None:
            raise self.error(key, "an object")
        return found

    def children(self, key: str, called: str) -> tuple["JsonObject", ...]:
        """The objects of a list; none if the key is not there.

        Parameters
        ----------
        called : str
            What one of them is called: "primitive".
        """
        values = self.values.get(key, [])
        if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
            raise self.error(key, "a list of objects")
        before = f"{self.place}, " if self.place else ""
        return tuple(
            JsonObject(value, f"{before}{called} {number}") for number, value in enumerate(values)
        )

    def extension(self, name: str) -> "JsonObject | None":
        """The object of an extension; None if this one does not have it."""
        extensions = self.child("extensions")
        return None if extensions is None else extensions.child(name)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MAX_WHOLE


def _is_finite(value: Any) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return abs(value) <= MAX_WHOLE if isinstance(value, int) else math.isfinite(value)
