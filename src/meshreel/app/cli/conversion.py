"""Conversion of sequences to other formats or streams, and its report."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshreel.codec.config import EncoderConfig
from meshreel.formats.options import WriteOptions
from meshreel.runtime.progress import Progress

if TYPE_CHECKING:
    from meshreel.app.cli.encoded_file import EncodedFile
    from meshreel.formats.remote import Output
    from meshreel.model.segments import AnySequence


@dataclass
class Conversion:
    """How sequences are written, and what has been written.

    Parameters
    ----------
    target : Output
        What the outputs are called.
    inputs : sequence of Path
        Never replaced.
    config : EncoderConfig
        Of streams.
    tracks : mapping of str to str, or None
        How exact tracks of streams are to come back.
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
    figures: list[dict[str, Any]] = field(default_factory=list)
    _streams: list["EncodedFile"] = field(default_factory=list)

    def check(
        self, output: "str | os.PathLike[str]", wanted: range | None, *, first: int = 0
    ) -> None:
        """Refuse a output that cannot or must not be written, before the work.

        Parameters
        ----------
        output : str or path
        wanted : range or None
            The frames, where they are known.
        first : int
            Number of the first of all frames.
        """
        from meshreel.formats.outputs import check_output

        check_output(
            output,
            None if wanted is None else len(wanted),
            overwrite=self.force,
            start_number=self._number(output, wanted or range(1), first),
            inputs=self.inputs,
            options=self.options,
        )

    def write(
        self,
        sequence: "AnySequence",
        output: "str | os.PathLike[str]",
        chosen: slice | None = None,
        *,
        first: int = 0,
    ) -> None:
        """Write the chosen frames of a sequence, the first of which has this number."""
        from meshreel.app.cli.encoded_file import encode_file, frames_of
        from meshreel.app.cli.write_options import chosen_frames, is_stream, written_figures
        from meshreel.formats.save import save_part
        from meshreel.model.segments import single_segment

        wanted = chosen_frames(chosen, sequence.n_frames, self.notes)
        if is_stream(output):
            made = encode_file(
                frames_of(sequence, wanted), Path(output), self.config, self.notes,
                tracks=self.tracks, force=self.force, progress=self.progress,
                name=self.target.name(output),
            )  # fmt: skip
            self._streams.append(made)
            figures = written_figures([Path(output)], sequence, len(wanted), self.target)
            self.figures.append({**figures, **made.figures()})
            return
        sequence = single_segment(sequence, f"{output} (without --split)")
        written = save_part(
            sequence, wanted, output,
            overwrite=self.force, start_number=self._number(output, wanted, first),
            inputs=self.inputs, options=self.options, progress=self.progress, notes=self.notes,
        )  # fmt: skip
        self.figures.append(written_figures(written, sequence, len(wanted), self.target))

    def _number(self, output: "str | os.PathLike[str]", wanted: range, first: int) -> int | None:
        """Number of the first file of a output; None if it has no numbers."""
        from meshreel.formats.outputs import numbering

        number = numbering(output, wanted, self.start_number)
        return number if number is None else first + number

    def show(self) -> None:
        """Print what was written, as tables."""
        from meshreel.app.cli.write_options import print_written

        for stream in self._streams:
            stream.show()
        if not self._streams:
            for figures in self.figures:
                print_written(figures)
