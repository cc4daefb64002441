"""Conversion of sequences to other formats or streams, and the figures printed about it."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from meshreel.codec.config import EncoderConfig
from meshreel.formats.options import WriteOptions
from meshreel.runtime.progress import Progress

if TYPE_CHECKING:
    from meshreel.app.cli.encoded_file import EncodedFile
    from meshreel.formats.options import ReadOptions
    from meshreel.formats.sources import Source
    from meshreel.model.notes import Notes
    from meshreel.model.sequence import MeshSequence


@dataclass
class Conversion:
    """Writes sequences and collects figures of the written files."""

    output: str
    """The requested output."""
    inputs: Sequence[Path]
    """Files that are never replaced."""
    options: WriteOptions
    reading: "ReadOptions"
    """Options with which the inputs are read."""
    config: EncoderConfig
    """Options of streams."""
    start_number: int | None
    force: bool
    progress: Progress
    notes: "Notes"
    tracks: Mapping[str, float | str] | None = None
    """Error bounds of the tracks of streams."""
    figures: list[dict[str, Any]] = field(default_factory=list)
    streams: list["EncodedFile"] = field(default_factory=list)

    def check(
        self, output: "str | os.PathLike[str]", frames: range | None, *, first: int = 0
    ) -> None:
        """Raise before encoding if an output cannot be written or would replace a file.

        Parameters
        ----------
        output : str or path
        frames : range or None
            None if the frames are still unknown.
        first : int
            Number of the first frame of the sequence.
        """
        from meshreel.formats.outputs import check_output

        check_output(
            output,
            None if frames is None else len(frames),
            overwrite=self.force,
            start_number=self._number(output, frames or range(1), first),
            inputs=self.inputs,
            options=self.options,
        )

    def write(
        self,
        sequence: "MeshSequence",
        output: "str | os.PathLike[str]",
        selection: slice | None = None,
        *,
        first: int = 0,
        is_part: bool = False,
    ) -> None:
        """Write the chosen frames of a sequence whose first frame has the number `first`.

        The size of a stream is compared with that of the inputs unless the frames are a part.
        """
        from meshreel.app.cli.encoded_file import encode_file
        from meshreel.app.cli.rig_figures import size_as_morph_targets, size_as_stream
        from meshreel.app.cli.write_options import chosen_frames, is_stream, written_figures
        from meshreel.formats.save import save_part

        frames = chosen_frames(selection, sequence.n_frames, self.notes)
        is_part = is_part or len(frames) < sequence.n_frames
        figures: dict[str, Any] = {}
        if is_stream(output):
            stream = encode_file(
                sequence.part(frames), Path(output), self.config, self.notes,
                tracks=self.tracks, force=self.force, progress=self.progress,
                input_bytes=None if is_part else self._input_bytes(),
            )  # fmt: skip
            self.streams.append(stream)
            figures |= written_figures([Path(output)], sequence, len(frames))
            self.figures.append({**figures, **stream.figures()})
            return
        paths = save_part(
            sequence, frames, output,
            overwrite=self.force, start_number=self._number(output, frames, first),
            inputs=self.inputs, options=self.options, progress=self.progress, notes=self.notes,
            figures=figures,
        )  # fmt: skip
        if "rig" in figures:
            rig = figures["rig"]
            sizes = size_as_morph_targets(
                sequence, frames, paths[0], self.options, rig, self.progress
            )
            if self.options.origin is None:
                sizes |= size_as_stream(sequence.part(frames), rig, self.progress)
            figures["alternatives_bytes"] = sizes
        figures |= written_figures(paths, sequence, len(frames))
        self.figures.append(figures)

    def _input_bytes(self) -> int | None:
        """Size of the inputs with the files that they reference; None if one object is read."""
        if self.reading.object is not None:
            return None
        files = {path.resolve() for path in self.inputs} | self.reading.referenced
        return sum(path.stat().st_size for path in files if path.is_file())

    def write_segments(self, source: "Source", reading: "ReadOptions") -> None:
        """Write each segment of an input to its own output, after checking all outputs."""
        from meshreel.formats.segments import open_any
        from meshreel.formats.sources import find_files
        from meshreel.model.sequence import MeshSequence

        if reading.register is not None:
            raise click.UsageError("--register joins segments; it cannot be combined with --split")
        sequence = open_any(find_files(source), replace(reading, matches_frames=False))
        output, ranges = Path(self.output), [*starmap(range, pairwise(sequence.starts))]
        paths = [
            output.with_name(f"{output.stem}_{frames[0]}-{frames[-1]}{output.suffix}")
            if len(ranges) > 1
            else output
            for frames in ranges
        ]
        for frames, path in zip(ranges, paths, strict=True):
            self.check(path, range(len(frames)), first=frames[0])
        for segment, frames, path in zip(sequence.segments, ranges, paths, strict=True):
            part = MeshSequence.of_segments([segment])
            self.write(part, path, first=frames[0], is_part=len(ranges) > 1)

    def _number(self, output: "str | os.PathLike[str]", frames: range, first: int) -> int | None:
        """Number of the first file of an output; None for a single file."""
        from meshreel.formats.outputs import numbering

        number = numbering(output, frames, self.start_number)
        return number if number is None else first + number

    def show(self) -> None:
        """Print tables of the written files."""
        from meshreel.app.cli.write_options import print_written

        for stream in self.streams:
            stream.show()
        if not self.streams:
            for figures in self.figures:
                print_written(figures)
