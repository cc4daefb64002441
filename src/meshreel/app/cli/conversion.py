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
    from meshreel.formats.remote import Output
    from meshreel.formats.sources import Source
    from meshreel.model.sequence import MeshSequence


def input_size(files: Sequence[Path], reading: "ReadOptions", *, split: bool) -> int | None:
    """Return the bytes of input files; None if each output contains only a part of them."""
    if split or reading.object is not None:
        return None
    return sum(path.stat().st_size for path in files if path.is_file())


@dataclass
class Conversion:
    """Writes sequences and collects figures of the written files.

    Parameters
    ----------
    target : Output
        Names of the outputs.
    inputs : sequence of Path
        Files that are never replaced.
    config : EncoderConfig
        Options of streams.
    tracks : mapping of str to str, or None
        Error bounds of the tracks of streams.
    input_bytes : int, optional
        Size of the inputs, to be compared with an output of all their frames. Default: unknown, or
        an output contains only a part of them.
    """

    target: "Output"
    inputs: Sequence[Path]
    options: WriteOptions
    config: EncoderConfig
    start_number: int | None
    force: bool
    progress: Progress
    notes: list[str]
    tracks: Mapping[str, float | str] | None = None
    input_bytes: int | None = None
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
        chosen: slice | None = None,
        *,
        first: int = 0,
    ) -> None:
        """Write the chosen frames of a sequence whose first frame has the number `first`."""
        from meshreel.app.cli.encoded_file import encode_file
        from meshreel.app.cli.write_options import chosen_frames, is_stream, written_figures
        from meshreel.formats.save import save_part

        frames = chosen_frames(chosen, sequence.n_frames, self.notes)
        if is_stream(output):
            stream = encode_file(
                sequence.part(frames), Path(output), self.config, self.notes,
                tracks=self.tracks, force=self.force, progress=self.progress,
                name=self.target.name(output),
                input_bytes=self.input_bytes if len(frames) == sequence.n_frames else None,
            )  # fmt: skip
            self.streams.append(stream)
            figures = written_figures([Path(output)], sequence, len(frames), self.target)
            self.figures.append({**figures, **stream.figures()})
            return
        written = save_part(
            sequence, frames, output,
            overwrite=self.force, start_number=self._number(output, frames, first),
            inputs=self.inputs, options=self.options, progress=self.progress, notes=self.notes,
        )  # fmt: skip
        self.figures.append(written_figures(written, sequence, len(frames), self.target))

    def write_segments(self, source: "Source", reading: "ReadOptions") -> None:
        """Write each segment of an input to its own output, after checking all outputs."""
        from meshreel.formats.segments import open_any
        from meshreel.formats.sources import find_files
        from meshreel.model.sequence import MeshSequence

        if reading.register is not None:
            raise click.UsageError("--register joins segments; it cannot be combined with --split")
        sequence = open_any(find_files(source), replace(reading, matches_frames=False))
        whole, ranges = Path(self.target.local), [*starmap(range, pairwise(sequence.starts))]
        paths = [
            whole.with_name(f"{whole.stem}_{frames[0]}-{frames[-1]}{whole.suffix}")
            if len(ranges) > 1
            else whole
            for frames in ranges
        ]
        for frames, path in zip(ranges, paths, strict=True):
            self.check(path, range(len(frames)), first=frames[0])
        for segment, frames, path in zip(sequence.segments, ranges, paths, strict=True):
            self.write(MeshSequence.of_segments([segment]), path, first=frames[0])

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
