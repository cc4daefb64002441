"""Rigs as writers receive them."""

from dataclasses import dataclass

from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.options import WriteOptions
from meshreel.model.extent import Extent
from meshreel.model.rig import Rig


@dataclass(frozen=True)
class FittedRig:
    """A rig of the frames to write."""

    rig: Rig
    extent: Extent
    """Box of the frames."""
    error: float | None
    """Largest error relative to the original, in model units; None if unknown."""


def is_rigged(options: WriteOptions) -> bool:
    """Return whether a rig is to be written.

    Raises
    ------
    InvalidInputError
        If another option has no effect with this choice.
    """
    for name in ("kg", "quality"):
        if not options.rig and getattr(options, name) is not None:
            raise InvalidInputError(
                Keyword(name), " is a bound of rigs; add ", Keyword("rig"), ", or omit it"
            )
    return bool(options.rig)
