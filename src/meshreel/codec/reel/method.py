"""The methods `reel`, `lossless` and `grid`; encoders are imported when first used."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from meshreel.codec.config import EncoderConfig
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.methods import LiveStart
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.option import COUNT
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.source import Source
from meshreel.codec.targets import TargetKind
from meshreel.errors import InvalidInputError, Keyword
from meshreel.kernel.files import FrameDecoder
from meshreel.runtime.progress import Progress

if TYPE_CHECKING:
    from meshreel.codec.methods import BlockCoder


@dataclass(frozen=True)
class ReelMethod:
    """Positions as modes, lossless or on a grid, with tracks; see `codec.methods.Method`."""

    name: str

    def check(self, config: EncoderConfig) -> None:
        """Raise InvalidInputError if no error bound or step determines the grid of `grid`."""
        assert isinstance(config, ReelOptions)
        if self.name == "grid" and config.target.kind not in (
            TargetKind.MAX_ERROR,
            TargetKind.STEP,
        ):
            raise InvalidInputError(
                "method grid rounds positions to a grid; set ",
                Keyword("max_error"),
                " (or step in Python)",
            )

    def encode(self, sources: Sequence[Source], progress: Progress) -> Iterator[bytes]:
        """Yield the stream of each segment.

        Raises as `encode_segments` and the `encode` of the module for one segment.
        """
        from meshreel.codec.reel.encoding import exact_positions, grid_positions, segments, whole

        modules = {"reel": whole.encode, LOSSLESS: exact_positions.encode}
        encode = modules.get(self.name, grid_positions.encode)
        if len(sources) == 1:
            return iter([encode(sources[0], progress)])
        return segments.encode_segments(encode, sources, progress)

    def live_coder(self, start: LiveStart) -> "BlockCoder":
        """Return the coder of frames added in order; raises as `LiveCoder`."""
        from meshreel.codec.reel.encoding import live

        return live.LiveCoder(start)

    def frames(self, opened: OpenStream, n_modes: int | None) -> FrameDecoder:
        """Return the decoder of frames.

        Raises
        ------
        InvalidInputError
            If `n_modes` is below 1, or there are no modes.
        """
        if n_modes is None:
            return FrameDecoder(opened.file)
        if self.name != "reel":
            raise InvalidInputError(
                f"a stream of method {self.name} has no modes; omit ", Keyword("n_modes")
            )
        COUNT.check(n_modes, Keyword("n_modes"))
        return FrameDecoder(opened.file, n_modes)


METHODS = {name: ReelMethod(name) for name in ("reel", LOSSLESS, "grid")}
