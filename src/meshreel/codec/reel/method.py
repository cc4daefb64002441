"""Our codec as a method of coding; encoder and decoder are imported when they are needed."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshreel.codec.config import MAX_BLOCK_POSITIONS, EncoderConfig
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.option import COUNT
from meshreel.codec.source import CodedMesh, Source
from meshreel.codec.subspace.trajectories import BoundingFrame
from meshreel.codec.targets import TargetKind
from meshreel.codec.track_bounds import TrackTargets
from meshreel.errors import InvalidInputError
from meshreel.kernel.files import FrameDecoder
from meshreel.model.sequence import extent_of
from meshreel.model.tracks import Track
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress

if TYPE_CHECKING:
    from meshreel.codec.methods import BlockCoder
    from meshreel.codec.reel.encoding.exact_positions import PositionCoder

Vertices = npt.NDArray[np.floating]

MAX_EXACT_POSITIONS, LEAST_EXACT_FRAMES = 1 << 22, 64
"""Of a block of `lossless`: some 2 s of decoding; but as many frames as let it learn motions."""

MOST_FRAMES_UNCUT, MOST_POSITIONS_UNCUT = 1024, 1 << 23
"""Sequences of more frames and more positions are cut by `reel`: of small meshes any frame is there
soon anyway."""

FRAMES_OF_LONG = 512
"""Most frames of a block of these."""

PROCESS_BYTES, BYTES_OF_FRAME, BYTES_OF_PAIR = 110e6, 2e5, 200.0
"""Memory of the program itself, of a frame (pieces of it in threads), and of two frames (their
correlation). What these and the following come from: docs/benchmarks.md, "Large meshes"."""

BYTES_OF_VERTEX, BYTES_OF_MODE, BYTES_OF_COMPARED_MODE, MOST_MODES = 1500.0, 10.0, 50.0, 150
"""Of what is known of a vertex, and of a mode at a vertex: more where a block is coded with and
without reused modes. There may be more modes; a block of few frames has fewer."""

BYTES_OF_KEPT, MOST_KEPT = 52.0, 2.8e6
"""Of coordinates of a position, which are kept for so many, beside the position as it came."""

LIVE_AIMS = (TargetKind.QUALITY, TargetKind.STEP, TargetKind.MAX_ERROR)
"""Targets that can be met without knowing the frames to come."""


class ReelMethod:
    """`reel`, as `codec.methods.Method` has it."""

    name = "reel"
    block_frames = None
    blocks_are_independent = True
    has_tracks = True
    is_lossless = False

    def check(self, config: EncoderConfig) -> None:
        """Nothing if there is one target at most.

        Raises
        ------
        InvalidInputError
            If there are several.
        """
        _ = config.target

    def check_live(self, config: EncoderConfig) -> None:
        """Nothing if the target can be met without knowing the frames to come.

        Raises
        ------
        InvalidInputError
            If it cannot.
        """
        if config.target.kind not in LIVE_AIMS:
            raise InvalidInputError(
                f"{config.target.kind.value} needs the whole sequence; for frames that come one by "
                f"one give {', '.join(kind.value for kind in LIVE_AIMS)}"
            )

    def longest_block(self, n_frames: int, n_verts: int) -> int:
        """Frames coded together where no number of them is given, and memory allows it.

        As many as possible: every cut sends all fields again, but those that blocks reuse. Long
        sequences are cut so that time and memory do not grow, and a frame is there soon.
        """
        n_blocks = -(-n_frames * n_verts // MAX_BLOCK_POSITIONS)
        if n_frames > MOST_FRAMES_UNCUT and n_frames * n_verts > MOST_POSITIONS_UNCUT:
            n_blocks = max(n_blocks, -(-n_frames // FRAMES_OF_LONG))
        return -(-n_frames // n_blocks)

    def block_bytes(
        self, block_frames: int, n_verts: int, number_bytes: int, *, is_whole: bool
    ) -> float:
        """Memory that encoding takes with blocks of so many frames.

        `number_bytes` is the size of a coordinate; with a block that is the whole sequence no other
        is read meanwhile.
        """
        n_positions, n_modes = block_frames * n_verts, min(3 * block_frames, MOST_MODES)
        of_mode, n_blocks = (BYTES_OF_MODE, 1) if is_whole else (BYTES_OF_COMPARED_MODE, 2)
        return (
            PROCESS_BYTES
            + BYTES_OF_FRAME * block_frames
            + BYTES_OF_PAIR * block_frames**2
            + (BYTES_OF_VERTEX + of_mode * n_modes) * n_verts
            + BYTES_OF_KEPT * min(n_positions, MOST_KEPT)
            + 3 * number_bytes * n_blocks * n_positions
        )

    def most_modes(self, n_frames: int, n_verts: int) -> int:
        """Modes that a block of so many frames can have at most."""
        return 3 * n_frames

    def encode(self, source: Source, progress: Progress, engine: Engine | None) -> bytes:
        """The bytes of a stream of the source; raises as `whole.encode`."""
        from meshreel.codec.reel.encoding import whole

        return whole.encode(source, progress, engine)

    def encode_segments(
        self, sources: Sequence[Source], progress: Progress, engine: Engine | None
    ) -> Iterator[bytes]:
        """Yield the stream of each segment; raises as `segments.encode_segments`."""
        from meshreel.codec.reel.encoding.segments import encode_segments

        return encode_segments(self.encode, sources, progress, engine)

    def live_coder(
        self,
        mesh: CodedMesh,
        frame: BoundingFrame,
        first: Vertices,
        tracks: dict[str, Track],
        targets: TrackTargets | None,
    ) -> "BlockCoder":
        """The coder of frames that are not all there yet; raises as `LiveCoder`."""
        from meshreel.codec.reel.encoding.live import LiveCoder

        return LiveCoder(mesh, frame, first, tracks, targets)

    def frames(self, opened: OpenStream, n_modes: int | None) -> FrameDecoder:
        """The decoder of a stream's frames.

        Raises
        ------
        InvalidInputError
            If `n_modes` is below 1.
        """
        if n_modes is not None:
            COUNT.check(n_modes, "n_modes")
        return FrameDecoder(opened.file, n_modes or 0)


class LosslessMethod(ReelMethod):
    """`lossless`: positions bit for bit, and tracks as in `reel`."""

    name = "lossless"
    is_lossless = True

    def check(self, config: EncoderConfig) -> None:
        """Nothing: what it takes fits."""

    def check_live(self, config: EncoderConfig) -> None:
        """Nothing: every option can be used for frames that come one by one."""

    def longest_block(self, n_frames: int, n_verts: int) -> int:
        """Frames coded together where no number of them is given, and memory allows it.

        To show one frame its whole block is decoded, which takes longer than with modes; and cuts
        cost less.
        """
        together = max(LEAST_EXACT_FRAMES, MAX_EXACT_POSITIONS // n_verts)
        together = max(1, min(together, MAX_BLOCK_POSITIONS // n_verts))
        return -(-n_frames // -(-n_frames // together))

    def most_modes(self, n_frames: int, n_verts: int) -> int:
        """There are none."""
        return 0

    def encode(self, source: Source, progress: Progress, engine: Engine | None) -> bytes:
        """The bytes of a stream of the source; raises as `exact_positions.encode`."""
        from meshreel.codec.reel.encoding import exact_positions

        return exact_positions.encode(source, progress, engine)

    def live_coder(
        self,
        mesh: CodedMesh,
        frame: BoundingFrame,
        first: Vertices,
        tracks: dict[str, Track],
        targets: TrackTargets | None,
    ) -> "BlockCoder":
        """The coder of frames that are not all there yet; raises as `LivePositionCoder`."""
        from meshreel.codec.reel.encoding.exact_positions import LivePositionCoder

        return LivePositionCoder(
            self._position_coder(mesh, frame, first), mesh, first, tracks, targets
        )

    def _position_coder(
        self, mesh: CodedMesh, frame: BoundingFrame, first: Vertices
    ) -> "PositionCoder":
        from meshreel.codec.reel.encoding.exact_positions import ExactPositionCoder

        return ExactPositionCoder(mesh.faces, mesh.n_verts)

    def frames(self, opened: OpenStream, n_modes: int | None) -> FrameDecoder:
        """The decoder of a stream's frames.

        Raises
        ------
        InvalidInputError
            If `n_modes` is given.
        """
        if n_modes is not None:
            raise InvalidInputError(
                f"a stream of method {self.name} has no modes, and every bit is decoded; leave "
                "n_modes= out"
            )
        return FrameDecoder(opened.file)


class GridMethod(LosslessMethod):
    """`grid`: positions rounded to a grid that keeps a promise, then bit for bit."""

    name = "grid"
    is_lossless = False

    def check(self, config: EncoderConfig) -> None:
        """Nothing if there is a largest error.

        Raises
        ------
        InvalidInputError
            If there is none.
        """
        if config.max_error is None:
            raise InvalidInputError(
                f"method {self.name} rounds positions as far as a largest error allows; give "
                "max_error="
            )

    def encode(self, source: Source, progress: Progress, engine: Engine | None) -> bytes:
        """The bytes of a stream of the source; raises as `grid_positions.encode`."""
        from meshreel.codec.reel.encoding import grid_positions

        return grid_positions.encode(source, progress, engine)

    def _position_coder(
        self, mesh: CodedMesh, frame: BoundingFrame, first: Vertices
    ) -> "PositionCoder":
        from meshreel.codec.reel.encoding.grid_positions import grid_coder

        return grid_coder(mesh, frame, extent_of(first), first.dtype)


METHODS = {method.name: method for method in (ReelMethod(), LosslessMethod(), GridMethod())}
