"""Encoding of a sequence into a file, and the figures printed about it."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshreel.codec.config import EncoderConfig
from meshreel.runtime.counting import change_text, size_text

if TYPE_CHECKING:
    from meshreel.codec.track_bounds import TrackTargets
    from meshreel.model.notes import Notes
    from meshreel.model.sequence import MeshSequence
    from meshreel.operations.encoding import Encoded
    from meshreel.runtime.progress import Progress

PARTS = "parts, positions in percent of the diagonal and in model units (u)"

MAX_COMPACT_SHARE = 0.7
"""Files below this share of the raw values describe motion by a skin, or compress it."""


@dataclass(frozen=True)
class EncodedFile:
    """A written stream, its name, and the size of the files that contain exactly its frames."""

    output: str
    encoded: "Encoded"
    input_bytes: int | None = None

    def figures(self) -> dict[str, Any]:
        """Figures for JSON."""
        from meshreel.app.figures import size_figures, uv_figures

        stream, achieved = self.encoded.stream, self.encoded.achieved
        tracks = {
            track.name: {"bound": track.bound, **achieved.tracks[track.name].as_dict()}
            for track in stream.tracks
        }
        return {
            "output": self.output,
            "input_size_bytes": self.input_bytes,
            "n_segments": len(stream.segments),
            "n_meshes": self.encoded.n_meshes,
            **size_figures(stream),
            **vars(achieved),
            "error_bound_percent": stream.error_bound_percent,
            "tracks": tracks,
            **uv_figures(self.encoded.uv),
        }

    def show(self) -> None:
        """Print a table of figures, and the bound, largest error and bytes of each part."""
        from meshreel.app.cli.console import print_columns, print_table
        from meshreel.app.figures import (
            PART_HEADINGS,
            achieved_rows,
            part_table,
            size_rows,
            uv_rows,
        )

        encoded, stream = self.encoded, self.encoded.stream
        rows = size_rows(stream, encoded.n_meshes) | achieved_rows(encoded.achieved)
        rows["ratio"] += " than raw values"
        print_table(self.output, self._input_rows() | rows | uv_rows(encoded.uv))
        print_columns(PARTS, PART_HEADINGS, part_table(encoded.achieved, stream))

    def _input_rows(self) -> dict[str, str]:
        """Return a row that compares the sizes of the input files and of the output."""
        if not self.input_bytes:
            return {}
        size, raw = self.encoded.stream.size_bytes, self.encoded.stream.raw_size_bytes
        change = change_text(self.input_bytes, size)
        rows = {"size": f"{size_text(self.input_bytes)} -> {size_text(size)}, {change}"}
        if self.input_bytes < MAX_COMPACT_SHARE * raw:
            rows["input"] = "compact already: smaller than the raw values of all frames"
        return rows


def encode_file(
    sequence: "MeshSequence",
    output: Path,
    config: EncoderConfig,
    notes: "Notes",
    *,
    tracks: "TrackTargets | None" = None,
    force: bool,
    progress: "Progress",
    input_bytes: int | None = None,
) -> EncodedFile:
    """Encode a sequence, measure and write it."""
    from meshreel.operations.encoding import encode_and_measure
    from meshreel.runtime.outputs.atomic import replace_when_done

    encoded = encode_and_measure(sequence, config, tracks, notes, progress=progress)
    with replace_when_done(output, overwrite=force) as temporary:
        temporary.write_bytes(encoded.data)
    return EncodedFile(str(output), encoded, input_bytes)
