"""Enumerations of surfaces, in the order of their codes in a stream."""

from meshreel.model.materials import AlphaMode, Filter, Wrap
from meshreel.model.surface import Domain, Kind

KINDS = (Kind.UV, Kind.COLOR, Kind.OTHER)
DOMAINS = (Domain.VERTEX, Domain.FACE, Domain.CORNER, Domain.CELL)
ALPHA_MODES, WRAPS = tuple(AlphaMode), tuple(Wrap)

FILTERS = tuple(Filter)
"""Codes start at 1; 0 means any filter."""

CHANNELS = "rgba"
"""Channels in the order of the bits of a mask."""
