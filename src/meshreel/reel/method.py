"""Our codec as a method of coding; encoder and decoder are imported when they are needed."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from meshreel.codec.config import MAX_BLOCK_POSITIONS, EncoderConfig
from meshreel.codec.open_stream import OpenStream
from meshreel.codec.source import CodedMesh, Source
from meshreel.codec.targets import Aim
from meshreel.codec.track_bounds import TrackTargets
from meshreel.errors import InvalidInputError
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress
from meshreel.subspace.trajectories import BoundingFrame
from meshreel.tracks import Track

if TYPE_CHECKING:
    from meshreel.reel.decoder import ReelBlockDecoder, TrackDecoder
    from meshreel.reel.encoding.live import LiveCoder

Vertices = npt.NDArray[np.floating]

LIVE_AIMS = (Aim.QUALITY, Aim.STEP, Aim.MAX_ERROR)
"""Targets that can be met without knowing the frames to come."""


class ReelMethod:
    """`reel`, as `codec.methods.Method` has it."""

    name = "reel"
    block_frames = None
    codes_blocks_apart = True
    has_tracks = True

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
        if config.target.aim not in LIVE_AIMS:
            raise InvalidInputError(
                f"{config.target.aim.value} needs the whole sequence; for frames that come one by "
                f"one give {', '.join(aim.value for aim in LIVE_AIMS)}"
            )

    def longest_block(self, n_frames: int, n_verts: int) -> int:
        """Frames coded together where neither a number of frames nor memory is given.

        As many as possible: every cut sends all fields again.
        """
        n_blocks = -(-n_frames * n_verts // MAX_BLOCK_POSITIONS)
        return -(-n_frames // n_blocks)

    def most_modes(self, n_frames: int, n_verts: int) -> int:
        """Modes that a block of so many frames can have at most."""
        return 3 * n_frames

    def n_joint_modes(self, n_modes: int, n_frames: int, n_verts: int) -> int:
        """The modes of a block, which are of all axes together."""
        return n_modes

    def encode(self, source: Source, progress: Progress, engine: Engine | None) -> bytes:
        """The bytes of a stream of the source; raises as `whole.encode`."""
        from meshreel.reel.encoding import whole

        return whole.encode(source, progress, engine)

    def live_coder(
        self,
        mesh: CodedMesh,
        frame: BoundingFrame,
        first: Vertices,
        tracks: dict[str, Track],
        targets: TrackTargets | None,
    ) -> "LiveCoder":
        """The coder of frames that are not all there yet; raises as `LiveCoder`."""
        from meshreel.reel.encoding.live import LiveCoder

        return LiveCoder(mesh, frame, first, tracks, targets)

    def track_decoder(self, opened: OpenStream, track: int) -> "TrackDecoder":
        """The decoder of a track beside the positions, from 1 on."""
        from meshreel.reel.decoder import TrackDecoder

        return TrackDecoder(opened, track)

    def decoder(self, opened: OpenStream, n_modes: int | None) -> "ReelBlockDecoder":
        """The decoder of a stream's blocks; raises as `ReelBlockDecoder`."""
        from meshreel.reel.decoder import ReelBlockDecoder

        return ReelBlockDecoder(opened, n_modes)


METHODS = {ReelMethod.name: ReelMethod()}
