"""Data that a player shows beside the stream: figures, original, errors, texture.

A server answers requests for it, and an exported page contains it.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.app.viewer.measuring import Comparison, MeasuredErrors, Measuring
from meshreel.app.viewer.playable import playable, reencoding_text
from meshreel.app.viewer.track_comparison import TrackComparison
from meshreel.codec.inspect import StreamInfo
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import ConnectivityChangeError, CorruptStreamError, InvalidInputError
from meshreel.formats.file_errors import check_input_file
from meshreel.model.surface import Kind
from meshreel.rendering.looks import TrackLook
from meshreel.rendering.track_colors import TrackColors
from meshreel.runtime.progress import Progress, silent

Rows = Mapping[str, str]
"""Names and figures as text, as the command line prints them."""

SMALLEST_DIAGONAL, LARGEST_DIAGONAL = 1e-30, 1e30
"""Range of diagonals that can be drawn: graphics cards use float32."""

TEXTURE = "texture"
"""Address of the texture of a served page."""

MEDIA_TYPES = {
    ".png": "image/png", ".jpg": "image/jpeg", ".jpeg": "image/jpeg", ".webp": "image/webp",
    ".avif": "image/avif", ".mp4": "video/mp4", ".webm": "video/webm", ".mov": "video/quicktime",
}  # fmt: skip
"""Media types of the formats that browsers show, by extension."""


@dataclass(frozen=True)
class Texture:
    """A texture file and its media type."""

    path: Path
    media_type: str

    @property
    def size_bytes(self) -> int:
        """Size of the file."""
        return self.path.stat().st_size

    def read(self, start: int, stop: int) -> bytes:
        """Return bytes start..stop - 1 of the file."""
        with self.path.open("rb") as file:
            file.seek(start)
            return file.read(stop - start)


def texture_for(reel: ReelFile, path: Path) -> Texture:
    """Return the texture in a file, checked against the mesh.

    Raises
    ------
    InvalidInputError
        If the file is missing, browsers cannot show its format, or the mesh has no UVs.
    """
    media_type = MEDIA_TYPES.get(path.suffix.lower())
    if media_type is None:
        raise InvalidInputError(
            f"{path} is not an image or video that browsers show; supported extensions: "
            f"{', '.join(MEDIA_TYPES)}"
        )
    if not path.is_file():
        raise InvalidInputError(f"there is no file {str(path)!r}; check it")
    check_input_file(path)
    if not any(attribute.kind is Kind.UV for attribute in reel.surface.attributes):
        raise InvalidInputError(
            f"the stream has no texture coordinates to map {path.name} to the mesh; encode an "
            "input that has them"
        )
    return Texture(path, media_type)


class PlayerData:
    """What a player shows; thread-safe.

    Parameters
    ----------
    file : ReelFile
        Files with several segments can neither be compared nor colored by a track.
    name : str
        Name to show if the stream has none.
    rows_of : callable
        Returns figures of the stream as text.
    comparison : Comparison, optional
        Comparison with the original.
    measured_rows : callable, optional
        Returns errors of all frames as text.
    progress : callable, optional
        Reports the progress of re-encoding.
    look : TrackLook, optional
        The track that colors the mesh initially.
    texture : Path, optional
        An image or a video for the mesh.

    Attributes
    ----------
    file : ReelFile
        The stream that the page plays: see `meshreel.app.viewer.playable`.
    reel : ReelFile
        The same stream, or its first segment.
    method : str
        Method of the file.
    measuring : Measuring or None
        Measures errors; None without an original.
    tracks : TrackComparison or None
        None without an original.
    texture : Texture or None

    Raises
    ------
    ConnectivityChangeError
        If a file with several segments is compared, or colored by a track.
    InvalidInputError
        If the model is too large or too small to draw, the track of `look` does not exist or
        cannot be shown that way, or the texture cannot be shown.
    CorruptStreamError
        If the first block is damaged.
    """

    def __init__(
        self,
        file: ReelFile,
        name: str,
        rows_of: Callable[[StreamInfo], Rows],
        comparison: Comparison | None = None,
        measured_rows: Callable[[MeasuredErrors], Rows] = lambda _: {},
        progress: Progress = silent,
        look: TrackLook | None = None,
        texture: Path | None = None,
    ) -> None:
        if file.n_segments > 1 and (comparison or look):
            feature = "a comparison" if comparison else "coloring by a track"
            raise ConnectivityChangeError(
                f"the faces change: {file!r}; {feature} in the player needs the same faces in "
                "every frame"
            )
        reel = file.segments[0]
        if look is not None:
            TrackColors(look, reel.track(look.name))  # raises if the track cannot be shown
        self._look = look
        self.texture: Texture | None = None if texture is None else texture_for(reel, texture)
        self.tracks: TrackComparison | None = (
            TrackComparison(reel, comparison.original) if comparison else None
        )
        diagonal = reel.frame.scale
        if not SMALLEST_DIAGONAL <= diagonal <= LARGEST_DIAGONAL:
            raise InvalidInputError(
                f"the diagonal of the model is {diagonal:.3g} units; the player draws from "
                f"{SMALLEST_DIAGONAL:g} to {LARGEST_DIAGONAL:g}: scale the model before encoding"
            )
        self.method: str = reel.method
        self.comparison = comparison
        self.reel: ReelFile = reel if file.n_segments > 1 else playable(reel, progress)
        self.file: ReelFile = file if file.n_segments > 1 else self.reel
        self._name, self._measured_rows = name, measured_rows
        self._rows: dict[str, str] = {}
        self._budget: dict[str, int] = {}
        try:
            info = file.info()
        except CorruptStreamError as error:  # the page shows the error in place of the figures
            self._rows["damaged"] = str(error)
        else:
            self._rows, self._budget = dict(rows_of(info)), dict(info.budget_bytes)
        if self.is_reencoded:
            self._rows["shown"] = reencoding_text(self.method)
        self.reel.read(0, 1)  # raises if the first block is damaged
        self.measuring: Measuring | None = None if comparison is None else Measuring(comparison)

    @property
    def is_reencoded(self) -> bool:
        """Whether the page plays a re-encoded stream."""
        return self.method != self.reel.method

    def facts(self) -> dict[str, Any]:
        """Facts about the file that its stream does not contain."""
        original = None
        if self.comparison is not None:
            errors = self.plots()
            original = {
                "diagonal": self.comparison.reference.diagonal,
                "tracks": self.tracks.names if self.tracks else [],
                "track_heats": self.tracks.heat_maps() if self.tracks else [],
                **{key: errors[key] for key in ("heats", "plots", "rows", "worst_frame")},
            }
        look, colored_by = self._look, None
        if look is not None:
            colored_by = {
                "track": look.name,
                "component": look.component,
                "range": look.range,
                "colormap": look.colormap,
            }
        return {
            "name": self.file.name or self._name,
            "rows": [list(row) for row in self._rows.items()],
            "budget": [list(row) for row in self._budget.items()],
            "original": original,
            "colored_by": colored_by,
            "texture": self.texture and {"url": TEXTURE, "mediaType": self.texture.media_type},
        }

    def plots(self) -> dict[str, Any]:
        """Errors of all frames when all are measured, and the progress of measuring."""
        assert self.measuring is not None  # callers check for an original
        measuring = self.measuring
        is_ready, figures = measuring.is_ready, measuring.figures
        rows = self._measured_rows(figures.measured) if is_ready else {}
        return {
            "ready": is_ready,
            "share": measuring.share,
            "error": measuring.error,
            "heats": figures.heat_maps(),
            "plots": figures.plots() if is_ready else [],
            "rows": [list(row) for row in rows.items()],
            "worst_frame": figures.worst_frame if is_ready else None,
        }

    def original(self, number: int) -> bytes:
        """Positions of a frame of the original, float32, relative to the center of the file."""
        assert self.comparison is not None  # callers check for an original
        positions = self.comparison.original.frame(number) - np.array(self.reel.frame.origin)
        return bytes(positions.astype("<f4").tobytes())
