"""Geometry parameters: properties of an Alembic mesh with values per vertex, face or corner."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.formats.alembic.archive import Property
from meshreel.formats.alembic.ogawa import damage_error
from meshreel.formats.alembic.time_sampling import Times, bracketing_samples
from meshreel.model.surface import VALUE_TYPES, Domain, Kind

DOMAINS = {"vtx": Domain.VERTEX, "var": Domain.VERTEX, "uni": Domain.FACE, "fvr": Domain.CORNER}
"""Domains by Alembic's name of the geometry scope."""
VALUES, INDICES = ".vals", ".indices"


@dataclass(frozen=True, eq=False)
class GeometryParam:
    """A geometry parameter at a time: values, possibly indexed.

    Parameters
    ----------
    source : Property
        The values, or a compound of values and indices.
    """

    source: Property
    time_s: float

    @property
    def name(self) -> str:
        """Its source name if declared, as texture coordinates often do, or its property name."""
        return self.source.header.metadata.get("sourceName") or self.source.header.name

    @property
    def domain(self) -> Domain | None:
        """The domain of the values; None for a single value per mesh."""
        return DOMAINS.get(self.source.header.metadata.get("geoScope", ""))

    @property
    def width(self) -> int:
        """Components of a value, which may span several values of the file."""
        packed = self.source.header.metadata.get("arrayExtent", "")
        return self._values.header.extent * (int(packed) if packed.isdecimal() else 1)

    @property
    def kind(self) -> Kind:
        """The kind of attribute that it becomes."""
        header = self._values.header
        interpretation = header.metadata.get("interpretation", "")
        is_float = header.dtype is not None and header.dtype.kind == "f"
        if interpretation in ("rgb", "rgba") and self.width == len(interpretation):
            return Kind.COLOR if is_float or header.dtype == np.uint8 else Kind.OTHER
        return Kind.UV if is_float and self.width == header.extent == 2 else Kind.OTHER

    @property
    def is_text(self) -> bool:
        """Whether the values are strings."""
        return self._values.header.is_text

    @property
    def is_constant(self) -> bool:
        """Whether neither values nor indices change over time."""
        return self._values.is_constant and (self._indices is None or self._indices.is_constant)

    def numbers(self) -> npt.NDArray[Any] | None:
        """Return the values, of shape (N, width), in an attribute type; None if all lose bits."""
        if self._values.header.dtype is None or self.width == 0:
            return None
        numbers = self._values.numbers(self._sample(self._values)).ravel()
        if len(numbers) % self.width:
            raise damage_error(
                f"{self.name} has {len(numbers)} numbers, not a multiple of {self.width}"
            )
        return _as_attribute_type(numbers.reshape(-1, self.width))

    def item_values(self) -> npt.NDArray[Any] | None:
        """Return the values with indices applied, of shape (N, width); None if not numeric."""
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
        """Times at which values or indices are sampled, ascending."""
        own = [self._values.times_s]
        times = own if self._indices is None else [*own, self._indices.times_s]
        animated = [one for one in times if len(one) > 1]
        return np.unique(np.concatenate(animated)) if animated else times[0][:1]

    def metadata(self, key: str) -> str:
        """Return an entry of the metadata; empty if there is none."""
        return self.source.header.metadata.get(key, "")

    @property
    def interpretation(self) -> str:
        """The declared interpretation of the numbers: "vector", "normal" and others."""
        return self._values.header.metadata.get("interpretation", "")

    def texts(self) -> list[str]:
        """Return the values as strings."""
        return self._values.texts(self._sample(self._values))

    def indices(self, n_values: int) -> npt.NDArray[np.int32] | None:
        """Return the value index of each item, of shape (N,); None if not indexed."""
        if self._indices is None:
            return None
        indices = self._indices.integers(self._sample(self._indices))
        if len(indices) and not 0 <= indices.min() <= indices.max() < n_values:
            raise damage_error(f"{self.name} has indices beyond its {n_values} values")
        return indices.astype(np.int32)

    @property
    def _values(self) -> Property:
        return self.source.properties.get(VALUES, self.source)

    @property
    def _indices(self) -> Property | None:
        return self.source.properties.get(INDICES)

    def _sample(self, values: Property) -> int:
        return bracketing_samples(values.times_s, self.time_s)[0]


def _as_attribute_type(numbers: npt.NDArray[Any]) -> npt.NDArray[Any] | None:
    """Return numbers in a type that an attribute may have; None for integers beyond 32 bits."""
    if numbers.dtype in VALUE_TYPES:
        return numbers
    if numbers.dtype.kind == "f":
        return numbers.astype(np.float32)
    integers = numbers.astype(np.int32)
    return integers if (integers == numbers).all() else None
