"""The methods `reel`, `lossless` and `grid`; encoders are imported when first used."""

from collections.abc import Iterator, Sequence
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
from meshreel.model.extent import extent_of
from meshreel.runtime.progress import Progress

if TYPE_CHECKING:
    from meshreel.codec.methods import BlockCoder
    from meshreel.codec.reel.encoding.exact_positions import PositionCoder


class ReelMethod:
    """The method `reel`; see `codec.methods.Method`."""

    name = "reel"

    def check(self, config: EncoderConfig) -> None:
        """Accept all options that `ReelOptions` accepts."""

    def encode(self, sources: Sequence[Source], progress: Progress) -> Iterator[bytes]:
        """Yield the stream of each segment; raises as `whole.encode` and `encode_segments`."""
        if len(sources) == 1:
            return iter([self._encode(sources[0], progress)])
        from meshreel.codec.reel.encoding.segments import encode_segments

        return encode_segments(self._encode, sources, progress)

    def _encode(self, source: Source, progress: Progress) -> bytes:
        from meshreel.codec.reel.encoding import whole

        return whole.encode(source, progress)

    def live_coder(self, start: LiveStart) -> "BlockCoder":
        """Return the coder of frames added in order; raises as `LiveCoder`."""
        from meshreel.codec.reel.encoding.live import LiveCoder

        return LiveCoder(start)

    def frames(self, opened: OpenStream, n_modes: int | None) -> FrameDecoder:
        """Return the decoder of frames.

        Raises
        ------
        InvalidInputError
            If `n_modes` is below 1.
        """
        if n_modes is not None:
            COUNT.check(n_modes, Keyword("n_modes"))
        return FrameDecoder(opened.file, n_modes or 0)


class LosslessMethod(ReelMethod):
    """The method `lossless`; tracks are coded as in `reel`."""

    name = LOSSLESS

    def _encode(self, source: Source, progress: Progress) -> bytes:
        from meshreel.codec.reel.encoding import exact_positions

        return exact_positions.encode(source, progress)

    def live_coder(self, start: LiveStart) -> "BlockCoder":
        """Return the coder of frames added in order; raises as `LivePositionCoder`."""
        from meshreel.codec.reel.encoding.exact_positions import LivePositionCoder

        return LivePositionCoder(self._position_coder(start), start)

    def _position_coder(self, start: LiveStart) -> "PositionCoder":
        from meshreel.codec.reel.encoding.exact_positions import ExactPositionCoder

        return ExactPositionCoder(start.mesh.links, start.mesh.n_verts)

    def frames(self, opened: OpenStream, n_modes: int | None) -> FrameDecoder:
        """Return the decoder of frames.

        Raises
        ------
        InvalidInputError
            If `n_modes` is given.
        """
        if n_modes is not None:
            raise InvalidInputError(
                f"a stream of method {self.name} has no modes; omit ", Keyword("n_modes")
            )
        return FrameDecoder(opened.file)


class GridMethod(LosslessMethod):
    """The method `grid`: positions rounded to a grid, then lossless."""

    name = "grid"

    def check(self, config: EncoderConfig) -> None:
        """Raise InvalidInputError if no error bound or step determines the grid."""
        assert isinstance(config, ReelOptions)
        if config.target.kind not in (TargetKind.MAX_ERROR, TargetKind.STEP):
            raise InvalidInputError(
                "method grid rounds positions to a grid; set ",
                Keyword("max_error"),
                " or ",
                Keyword("step"),
            )

    def _encode(self, source: Source, progress: Progress) -> bytes:
        from meshreel.codec.reel.encoding import grid_positions

        return grid_positions.encode(source, progress)

    def _position_coder(self, start: LiveStart) -> "PositionCoder":
        from meshreel.codec.reel.encoding.grid_positions import grid_coder

        return grid_coder(start.mesh, start.frame, extent_of(start.first), start.first.dtype)


METHODS = {method.name: method for method in (ReelMethod(), LosslessMethod(), GridMethod())}
