"""Encoding of a sequence into a file, and the figures printed about it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshreel.codec.config import EncoderConfig

if TYPE_CHECKING:
    from meshreel.codec.achieved import Achieved
    from meshreel.codec.inspect import StreamInfo
    from meshreel.codec.surface.uv_errors import UvErrors
    from meshreel.codec.track_bounds import TrackTargets
    from meshreel.model.sequence import MeshSequence
    from meshreel.runtime.progress import Progress


@dataclass(frozen=True)
class EncodedFile:
    """A written stream and its errors.

    Attributes
    ----------
    n_meshes : int
        Number of distinct meshes among the segments.
    """

    output: str
    stream: "StreamInfo"
    achieved: "Achieved"
    uv: "UvErrors | None" = None
    n_meshes: int = 1

    def figures(self) -> dict[str, Any]:
        """Figures for JSON."""
        from meshreel.app.cli.figures import size_figures, uv_figures

        tracks = {name: errors.as_dict() for name, errors in self.achieved.tracks.items()}
        achieved = {**vars(self.achieved), "tracks": tracks}
        counts = {"n_segments": len(self.stream.segments), "n_meshes": self.n_meshes}
        figures = {"output": self.output, **counts, **size_figures(self.stream), **achieved}
        return figures | uv_figures(self.uv)

    def show(self) -> None:
        """Print a table of figures, and the bytes of each part."""
        from meshreel.app.cli.console import print_bars, print_table
        from meshreel.app.cli.figures import achieved_rows, size_rows, uv_rows

        rows = {
            **size_rows(self.stream, self.n_meshes),
            **achieved_rows(self.achieved, self.stream),
        }
        rows |= uv_rows(self.uv)
        print_table(self.output, rows)
        print_bars("bytes", self.stream.part_bytes)


def encode_file(
    sequence: "MeshSequence",
    output: Path,
    config: EncoderConfig,
    notes: list[str],
    *,
    tracks: "TrackTargets | None" = None,
    force: bool,
    progress: "Progress",
    name: str,
) -> EncodedFile:
    """Encode a sequence, write it and measure it; figures show `name` as the output."""
    from meshreel.codec.achieved import measure_stream
    from meshreel.codec.encoder import encode_with
    from meshreel.codec.inspect import info
    from meshreel.codec.reordering import joined_note, without_reordering
    from meshreel.codec.solver_state import solver_state_note
    from meshreel.codec.surface.payloads import order_notes
    from meshreel.codec.surface.uv_errors import measure_uvs
    from meshreel.codec.track_bounds import without_units
    from meshreel.formats.notes import note_unknown_rate
    from meshreel.model.sequence import tracks_of_all
    from meshreel.runtime.outputs.atomic import replace_when_done

    given = sequence
    sequence = without_reordering(given, config.order)
    notes += filter(None, [joined_note(given, sequence)])
    tracks = without_units(tracks_of_all(sequence), tracks or {}, notes)
    data = encode_with(config, sequence, tracks=tracks, progress=progress)
    with replace_when_done(output, overwrite=force) as temporary:
        temporary.write_bytes(data)
    achieved = measure_stream(sequence, data, with_sted=config.is_chosen("sted"), progress=progress)
    stream = info(data)
    surfaces = (segment.surface for segment in sequence.segments)
    notes += order_notes(surfaces, stream.order, is_chosen=config.order is not None)
    if state_note := solver_state_note(stream.tracks, tracks):
        notes.append(state_note)
    note_unknown_rate(notes, sequence.n_frames, sequence.fps)
    uv = None if config.uv_bits is None else measure_uvs(sequence, data)
    return EncodedFile(name, stream, achieved, uv, sequence.n_meshes)
