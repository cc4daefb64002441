"""Rigs as writers receive them."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.options import WriteOptions
from meshreel.model.extent import Extent
from meshreel.model.rig import Rig

if TYPE_CHECKING:
    from meshreel.formats.frames.frame_stream import SegmentedStream


@dataclass(frozen=True)
class FittedRig:
    """A rig of the frames to write."""

    rig: Rig
    extent: Extent
    """Box of the frames."""
    error: float | None
    """Largest error relative to the original, in model units; None if unknown."""


class RigFit(Protocol):
    """Fits a rig to a stream, which takes long."""

    def __call__(
        self, stream: "SegmentedStream", options: WriteOptions, max_bones: int | None, /
    ) -> FittedRig | None:
        """Return a rig within the error bounds of the options, and report its errors.

        Parameters
        ----------
        max_bones : int or None
            To return None if a rig needs more bones, or probably cannot meet the bounds; None to
            use the bones of the options, and to raise an error.
        """


def is_rigged(options: WriteOptions) -> bool:
    """Return whether a rig is to be written.

    Raises
    ------
    InvalidInputError
        If another option has no effect with this choice.
    """
    if not options.rig:
        for name in ("kg", "quality"):
            if getattr(options, name) is not None:
                raise InvalidInputError(
                    Keyword(name), " is a bound of rigs; add ", Keyword("rig"), ", or omit it"
                )
        return False
    return True
