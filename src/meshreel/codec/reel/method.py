"""The methods `reel`, `lossless` and `grid`; encoders are imported when first used."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from meshreel.codec.config import MAX_BLOCK_POSITIONS, EncoderConfig
from meshreel.codec.methods import LOSSLESS, LiveStart
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

MAX_EXACT_POSITIONS, MIN_EXACT_FRAMES = 1 << 22, 64
"""Size of a block of `lossless`: at most about 2 s of decoding, but enough frames to adapt to."""

MAX_UNCUT_FRAMES, MAX_UNCUT_POSITIONS = 1024, 1 << 23
"""`reel` cuts sequences that exceed both limits; small meshes decode quickly anyway."""

MAX_CUT_FRAMES = 512
"""Maximum number of frames of a block of a cut sequence."""

PROCESS_BYTES, BYTES_PER_FRAME, BYTES_PER_PAIR = 110e6, 2e5, 200.0
"""Memory of the program, of a frame (its pieces in threads), and of a pair of frames (their
correlation). Measured, like the following: docs/benchmarks.md, "Large meshes"."""

BYTES_PER_VERTEX, BYTES_PER_MODE, BYTES_PER_COMPARED_MODE, MAX_MODES = 1500.0, 10.0, 50.0, 150
"""Memory of a vertex, and of a mode at a vertex, which is more if a block is also tried with reused
modes. MAX_MODES is the number assumed for long blocks."""

BYTES_PER_CACHED, MAX_CACHED = 52.0, 2.8e6
"""Memory of the cached coordinates of a position, and the largest number of cached positions."""


class ReelMethod:
    """The method `reel`; see `codec.methods.Method`."""

    name = "reel"
    positions_only = False

    def check(self, config: EncoderConfig) -> None:
        """Raise InvalidInputError if there are several targets."""
        assert isinstance(config, ReelOptions)
        _ = config.target

    def longest_block(self, n_frames: int | None, n_verts: int) -> int | None:
        """Return the number of frames per block without an option or a memory limit.

        Every cut repeats the fields that are not reused, so blocks are long. Long sequences are cut
        to limit time, memory and latency.
        """
        if n_frames is None:
            return None
        n_blocks = -(-n_frames * n_verts // MAX_BLOCK_POSITIONS)
        if n_frames > MAX_UNCUT_FRAMES and n_frames * n_verts > MAX_UNCUT_POSITIONS:
            n_blocks = max(n_blocks, -(-n_frames // MAX_CUT_FRAMES))
        return -(-n_frames // n_blocks)

    def block_bytes(
        self, block_frames: int, n_verts: int, number_bytes: int, *, is_whole: bool
    ) -> float:
        """Estimate the memory of encoding with blocks of this length."""
        n_positions, n_modes = block_frames * n_verts, min(3 * block_frames, MAX_MODES)
        mode_bytes, n_blocks = (BYTES_PER_MODE, 1) if is_whole else (BYTES_PER_COMPARED_MODE, 2)
        return (
            PROCESS_BYTES
            + BYTES_PER_FRAME * block_frames
            + BYTES_PER_PAIR * block_frames**2
            + (BYTES_PER_VERTEX + mode_bytes * n_modes) * n_verts
            + BYTES_PER_CACHED * min(n_positions, MAX_CACHED)
            + 3 * number_bytes * n_blocks * n_positions
        )

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

    def check(self, config: EncoderConfig) -> None:
        """Accept all options."""

    def longest_block(self, n_frames: int | None, n_verts: int) -> int | None:
        """Return the number of frames per block without an option or a memory limit.

        Showing a frame decodes its whole block, which takes longer than with modes, and cuts cost
        fewer bytes.
        """
        if n_frames is None:
            return None
        together = max(MIN_EXACT_FRAMES, MAX_EXACT_POSITIONS // n_verts)
        together = max(1, min(together, MAX_BLOCK_POSITIONS // n_verts))
        return -(-n_frames // -(-n_frames // together))

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
        """Raise InvalidInputError without `max_error` or `step`."""
        assert isinstance(config, ReelOptions)
        if config.target.kind not in (TargetKind.MAX_ERROR, TargetKind.STEP):
            raise InvalidInputError(
                f"method {self.name} rounds positions to a grid; set ",
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
