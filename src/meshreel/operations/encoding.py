"""Encoding of a sequence, with measured errors and notes for the user."""

from dataclasses import dataclass
from typing import Any

from meshreel.codec.achieved import Achieved, measure_stream, measure_uvs
from meshreel.codec.config import EncoderConfig
from meshreel.codec.encoder import encode_with
from meshreel.codec.inspect import StreamInfo, bound_notes, info
from meshreel.codec.reordering import joined_note, without_reordering
from meshreel.codec.solver_state import solver_state_note
from meshreel.codec.surface.payloads import order_notes
from meshreel.codec.track_bounds import EXACT, TrackTargets, kept_bounds, without_units
from meshreel.errors import Keyword, Message, parts_of
from meshreel.model.notes import Notes, note_unknown_rate
from meshreel.model.sequence import MeshSequence, tracks_of_all
from meshreel.model.tracks import error_bound_of
from meshreel.runtime.counting import size_text
from meshreel.runtime.progress import Progress, silent

MAX_ORDER_SHARE, MIN_ORDER_BYTES = 0.15, 1000
"""Share of a stream and size above which a note says how to drop the order."""


MAX_IMAGE_SHARE, MIN_IMAGE_BYTES = 0.3, 20_000
"""Share of a stream and size above which a note says how to make images smaller."""


@dataclass(frozen=True)
class Encoded:
    """A stream and its measured errors."""

    data: bytes
    stream: StreamInfo
    achieved: Achieved
    uv: float | None
    """Largest error of texture coordinates, in widths of the texture; None if they are exact."""
    n_meshes: int
    """Number of distinct meshes among the segments."""
    origins: dict[str, str]
    """What set the bound of each track, such as "quality 80"."""

    def as_dict(self) -> dict[str, Any]:
        """Figures for JSON."""
        stream, achieved = self.stream, self.achieved
        tracks = {
            track.name: {
                "bound": track.bound,
                "bound_origin": self.origins[track.name],
                **achieved.tracks[track.name].as_dict(),
            }
            for track in stream.tracks
        }
        uv = self.uv
        return {
            "n_segments": len(stream.segments),
            "n_meshes": self.n_meshes,
            **size_figures(stream),
            **vars(achieved),
            "error_bound_percent": stream.error_bound_percent,
            "tracks": tracks,
            **({} if uv is None else {"uv_error": uv, "uv_error_texels_4096": uv * 4096}),
        }


def size_figures(stream: StreamInfo) -> dict[str, Any]:
    """Sizes and counts of a stream, as `encode` prints them as JSON."""
    figures = stream.as_dict()
    return {
        key: figures[key]
        for key in ("n_frames", "n_verts", "n_faces", "method", "n_modes",
                    "raw_size_bytes", "size_bytes", "image_bytes", "part_bytes", "ratio",
                    "rate_bpvf")
    }  # fmt: skip


def encode_and_measure(
    original: MeshSequence,
    config: EncoderConfig,
    tracks: TrackTargets | None,
    notes: Notes,
    *,
    progress: Progress = silent,
) -> Encoded:
    """Encode a sequence, and measure the errors of the stream.

    Parameters
    ----------
    tracks : mapping of str to float or str, or None
        Error bounds of tracks.
    notes : Notes
        Receives notes on changes, and on what the stream omits.
    """
    sequence = without_reordering(original, config.order)
    notes += filter(None, [joined_note(original, sequence)])
    tracks = without_units(tracks_of_all(sequence), tracks or {}, notes)
    data = encode_with(config, sequence, tracks=tracks, progress=progress, notes=notes)
    achieved = measure_stream(sequence, data, with_shape=True, progress=progress)
    stream = info(data)
    surfaces = (segment.surface for segment in sequence.segments)
    notes += order_notes(surfaces, stream.order, is_chosen=config.order is not None)
    order_bytes = stream.part_bytes.get("order", 0)
    limit_bytes = max(MIN_ORDER_BYTES, MAX_ORDER_SHARE * stream.size_bytes)
    if config.order is None and order_bytes >= limit_bytes:
        lost = {"polygons": stream.n_polygons != stream.n_faces, "parts": stream.parts}
        names = " and ".join(name for name, is_lost in lost.items() if is_lost)
        notes.result(
            Message(
                f"{100 * order_bytes / stream.size_bytes:.0f} % of the file is the order of "
                "vertices and faces; ",
                Keyword("order", "drop"),
                " leaves it out: the model is the same, but vertices and faces get other numbers, "
                "so that other files which refer to these no longer fit",
                f"; {names} are lost" if names else "",
            )
        )
    keeps_images = config.images is None and config.max_image is None
    limit_bytes = max(MIN_IMAGE_BYTES, MAX_IMAGE_SHARE * stream.size_bytes)
    if keeps_images and stream.image_bytes >= limit_bytes:
        notes.result(
            Message(
                f"images are {100 * stream.image_bytes / stream.size_bytes:.0f} % of the file, "
                f"{size_text(stream.image_bytes)}: ",
                Keyword("images", "webp"),
                " compresses them, with small losses of color, and ",
                Keyword("max_image"),
                " scales them down",
            )
        )
    notes += filter(None, [solver_state_note(stream.tracks, tracks)])
    notes += bound_notes(sequence, data, achieved.max_error_percent)
    note_unknown_rate(notes, sequence.n_frames, sequence.fps)
    uv = None if config.uv_bits is None else measure_uvs(sequence, data)
    originals = tracks_of_all(sequence)
    bounds, origins = kept_bounds(config, originals, tracks), {}
    for track in stream.tracks:
        bound = bounds[track.name]
        origin = "for size or precision" if track.is_exact and bound != EXACT else bound.origin
        if error_bound_of(originals[track.name]):
            origin = Message(*parts_of(origin), ", plus the source's")
        origins[track.name] = origin
    return Encoded(data, stream, achieved, uv, sequence.n_meshes, origins)
