"""Options of registration, each declared once, as a field."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from meshreel.codec.error_bounds import METERS, ErrorBound, bound_of
from meshreel.codec.option import COUNT, Option
from meshreel.codec.targets import DEFAULT_QUALITY, QUALITIES
from meshreel.errors import InvalidInputError, Keyword
from meshreel.formats.options import READING
from meshreel.runtime.progress import Progress, silent

WORKERS = "Where it runs (give one)"


@dataclass(frozen=True, kw_only=True)
class RegisterOptions:
    """Options of `meshreel.register` other than the source.

    Raises InvalidInputError if the tolerance is none, or one of the textures and their output is
    missing.
    """

    tolerance: Annotated[
        float | str,
        Option(
            "Largest distance between the registered and the raw surface: percent of the diagonal "
            "of the box of all frames (0.2%), model units (0.5u), or a length (1mm, with {unit}). "
            "In every frame, 99 % of both surfaces are within it, and no connected patch beyond it "
            "is larger than a square of ten tolerances.",
            metavar="LENGTH",
        ),
    ] = "0.2%"
    unit: Annotated[
        str | None,
        Option("Length unit of the model, for a {tolerance} that is a length.", names=(*METERS,)),
    ] = None
    keep_holes: Annotated[
        bool,
        Option(
            "Keep the holes of scans, which registered surfaces close: a track scanned is 1 for "
            "the faces that the raw frame has, otherwise 0. Players and pictures hide the others.",
            group=READING,
        ),
    ] = False
    keep_debris: Annotated[
        bool,
        Option(
            "Keep debris: small components that the frames before and after theirs lack. A frame "
            "with debris may become a separate segment.",
            group=READING,
        ),
    ] = False
    quality: Annotated[
        float,
        Option(
            "The quality at which the result will be encoded. Meshes keep more vertices for a "
            "higher one.",
            range=QUALITIES,
        ),
    ] = DEFAULT_QUALITY
    folder: Annotated[
        str | os.PathLike[str] | None,
        Option(
            "Stores finished runs of about 120 frames: after an interruption, the same call "
            "continues. The result reads its frames from the folder; remove it when they are not "
            "needed any more. "
            "Default: frames are in temporary files (in ``TMPDIR``), which vanish with the result."
        ),
    ] = None
    texture: Annotated[
        str | os.PathLike[str] | Sequence[str | os.PathLike[str]] | None,
        Option(
            "Textures of the raw frames: a folder or a quoted glob of images in frame order, or a "
            "video. They are baked into the texture coordinates of the segments.",
            metavar="IMAGES",
            more="Or a list of images. Every texel gets the color at the closest point of the raw "
            "surface. Their size is that of the first image.",
        ),
    ] = None
    texture_output: Annotated[
        str | os.PathLike[str] | None,
        Option(
            "The video (walk.mp4, needs [video]) or the images (walk_%04d.png) to write with "
            "{texture}.",
            metavar="FILE",
        ),
    ] = None
    sound: Annotated[
        str | os.PathLike[str] | None,
        Option(
            "The sound of the take, which begins at its first frame: any file that ffmpeg reads. "
            "AAC is copied, other sound encoded as AAC, into the video of the textures.",
            metavar="FILE",
        ),
    ] = None
    workers: Annotated[
        int | None,
        Option(
            "Number of processes that register runs of a long capture. Default: one, on all cores.",
            range=COUNT,
            group=WORKERS,
        ),
    ] = None
    scheduler: Annotated[
        str | None,
        Option(
            "Address of a Dask scheduler whose workers have the capture at the same path or "
            "address (needs [dask]).",
            metavar="ADDRESS",
            group=WORKERS,
        ),
    ] = None
    overwrite: Annotated[bool, Option("Whether existing textures may be replaced.")] = False
    progress: Progress = silent

    def __post_init__(self) -> None:
        _ = self.bound
        if self.workers is not None and self.scheduler is not None:
            raise InvalidInputError(
                Keyword("workers"), " and ", Keyword("scheduler"),
                " cannot be combined; give one",
            )  # fmt: skip
        if (self.texture is None) != (self.texture_output is None):
            raise InvalidInputError(
                Keyword("texture"), " and ", Keyword("texture_output"),
                " belong together; give both or none",
            )  # fmt: skip
        if self.sound is not None and Path(self.texture_output or "").suffix.lower() != ".mp4":
            raise InvalidInputError(
                Keyword("sound"), " is stored in a video of textures (.mp4); give ",
                Keyword("texture"), " too",
            )  # fmt: skip

    @property
    def bound(self) -> ErrorBound:
        """The tolerance."""
        return bound_of(self.tolerance, self.unit, "tolerance")
