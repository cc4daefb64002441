"""Properties of an Alembic mesh that have a value for each vertex, face or corner."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.archive import Property
from meshreel.formats.alembic.ogawa import damaged
from meshreel.formats.alembic.time_sampling import Times, between
from meshreel.model.surface import VALUE_TYPES, Domain, Kind

DOMAINS = {"vtx": Domain.VERTEX, "var": Domain.VERTEX, "uni": Domain.FACE, "fvr": Domain.CORNER}
"""Domains by what the file calls them."""
VALUES, INDICES = ".vals", ".indices"


@dataclass(frozen=True, eq=False)
class GeometryParam:
    """A property of values, and maybe of indices of them, at a time.

    Parameters
    ----------
    found : Property
        The values themselves, or a compound of values and indices.
    time_s : float
    """

    found: Property
    time_s: float

    @property
    def name(self) -> str:
        """Its name; texture coordinates may have one of their own."""
        return self.found.header.metadata.get("sourceName") or self.found.header.name

    @property
    def domain(self) -> Domain | None:
        """The domain of its values; None if it has one value for the whole mesh."""
        return DOMAINS.get(self.found.header.metadata.get("geoScope", ""))

    @property
    def width(self) -> int:
        """Numbers of one value, which may be several of the file's."""
        packed = self.found.header.metadata.get("arrayExtent", "")
        return self._values.header.extent * (int(packed) if packed.isdecimal() else 1)

    @property
    def kind(self) -> Kind:
        """Its kind."""
        header = self._values.header
        meaning = header.metadata.get("interpretation", "")
        is_float = header.dtype is not None and header.dtype.kind == "f"
        if meaning in ("rgb", "rgba") and self.width == len(meaning):
            return Kind.COLOR if is_float or header.dtype == np.uint8 else Kind.OTHER
        return Kind.UV if is_float and self.width == header.extent == 2 else Kind.OTHER

    @property
    def is_text(self) -> bool:
        """Whether its values are texts."""
        return self._values.header.is_text

    @property
    def is_constant(self) -> bool:
        """Whether it is the same at all times."""
        return self._values.is_constant and (self._rows is None or self._rows.is_constant)

    def numbers(self) -> npt.NDArray[Any] | None:
        """Values of shape (N, width), of a type that an attribute can have; None if none fits."""
        if self._values.header.dtype is None or self.width == 0:
            return None
        numbers = self._values.numbers(self._sample(self._values)).ravel()
        if len(numbers) % self.width:
            raise damaged(f"{self.name} has {len(numbers)} numbers, {self.width} to a value")
        return _allowed(numbers.reshape(-1, self.width))

    def every_number(self) -> npt.NDArray[Any] | None:
        """Values of all items, of shape (N, width), in a type of tracks; None if none fits."""
        if self._values.header.dtype is None or self.width == 0:
            return None
        numbers = self._values.numbers(self._sample(self._values)).ravel()
        if numbers.dtype == np.float16:
            numbers = numbers.astype(np.float32)
        if len(numbers) == 0 or len(numbers) % self.width:
            return None
        values = numbers.astype(numbers.dtype.newbyteorder("=")).reshape(-1, self.width)
        indices = self.indices(len(values))
        return values if indices is None else values[indices]

    @property
    def times_s(self) -> Times:
        """When its values or the indices of them are sampled, ascending."""
        times = [self._values.times_s, *([self._rows.times_s] if self._rows is not None else [])]
        moving = [one for one in times if len(one) > 1]
        return np.unique(np.concatenate(moving)) if moving else times[0][:1]

    def said(self, what: str) -> str:
        """An entry of its metadata; empty if there is none."""
        return self.found.header.metadata.get(what, "")

    @property
    def meaning(self) -> str:
        """What the file says that its numbers are: "vector", "normal" and others."""
        return self._values.header.metadata.get("interpretation", "")

    def texts(self) -> list[str]:
        """Values that are texts."""
        return self._values.texts(self._sample(self._values))

    def indices(self, n_values: int) -> npt.NDArray[np.int32] | None:
        """The value of each item, of shape (number of items,); None if each has its own."""
        if self._rows is None:
            return None
        indices = self._rows.whole_numbers(self._sample(self._rows))
        if len(indices) and not 0 <= indices.min() <= indices.max() < n_values:
            raise damaged(f"{self.name} has indices of values that are not there")
        return indices.astype(np.int32)

    @property
    def _values(self) -> Property:
        return self.found.properties.get(VALUES, self.found)

    @property
    def _rows(self) -> Property | None:
        return self.found.properties.get(INDICES)

    def _sample(self, found: Property) -> int:
        return between(found.times_s, self.time_s)[0]


def _allowed(numbers: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """The same numbers in a type that an attribute can have; None if they do not fit into any."""
    if numbers.dtype in VALUE_TYPES:
        return numbers
    if numbers.dtype.kind == "f":
        return numbers.astype(np.float32)
    whole = numbers.astype(np.int32)
    return whole if (whole == numbers).all() else None
