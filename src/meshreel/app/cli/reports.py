"""The way from inputs to a report, for the commands that write one."""

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

from meshreel.app.cli.console import print_json, print_notes, print_table, progress_bar
from meshreel.evaluation.pipeline import Evaluation, R, Study, evaluate
from meshreel.evaluation.tracks.study import with_track_alone
from meshreel.formats.load import load
from meshreel.formats.notes import listed, note_left_out
from meshreel.formats.sources import files_of_source
from meshreel.model.flag import simulate_flag
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.plots import require_matplotlib
from meshreel.runtime.outputs.checks import check_output_folder


def check_before_work(inputs: Sequence[str], out: Path, others: Sequence[Path] = ()) -> None:
    """Refuse what would end long work without a report.

    Parameters
    ----------
    inputs : sequence of str
        Sources of sequences.
    out : Path
        The folder for the report.
    others : sequence of Path
        Further files that are read.

    Raises
    ------
    InvalidInputError
        If matplotlib is missing, an input cannot be found, or the folder takes no files.
    """
    require_matplotlib()
    files = [file for given in inputs for file in files_of_source(given)]
    check_output_folder(out, inputs=[*files, *others])


def write_report(
    study: Study[R],
    inputs: Sequence[str],
    out: Path,
    options: Mapping[str, str | None],
    *,
    flag_frames: int = 0,
    track: str | None = None,
    as_json: bool,
) -> None:
    """Run a study on the inputs, and say where its report lies.

    Parameters
    ----------
    inputs : sequence of str
        Sources of sequences; the flag where there is none.
    options : mapping of str to str or None
        Those beside `--out` that make the same report again; None for a switch.
    flag_frames : int
        Frames of the flag.
    track : str, optional
        The track that the study is on; sequences keep it alone. Default: none.
    as_json : bool
        Print all figures.
    """
    notes: list[str] = []
    with progress_bar() as progress:
        sequences = [
            _to_study(load(source, progress=progress, notes=notes), track, notes)
            for source in inputs
        ]
        sequences = sequences or [simulate_flag(flag_frames, progress=progress)]
        command = command_line(study.program, inputs, out, options)
        made = evaluate(study, sequences, out, command=command, progress=progress)
    print_notes([*notes, *chain.from_iterable(made.notes.values())])
    _print_report(made, out, notes, as_json=as_json)


def _to_study(sequence: MeshSequence, track: str | None, notes: list[str]) -> MeshSequence:
    """The sequence with one track, or none: they would count in the sizes of some methods only."""
    if track is not None:
        return with_track_alone(sequence, track)
    if not sequence.tracks:
        return sequence
    note_left_out(notes, f"tracks, for the report is on positions: {listed(sequence.tracks)}")
    return replace(sequence, tracks={})


def _print_report(made: Evaluation[R], out: Path, notes: list[str], *, as_json: bool) -> None:
    """Where the report lies, or all its figures as JSON, with the notes on the inputs."""
    if as_json:
        print_json({**made.as_dict(), "notes": notes})
        return
    n_figures = sum(len(pictures) for _, pictures in made.measured)
    written = {"report": str(made.html), "the same, as Markdown": str(made.markdown)}
    print_table("Written", {**written, "figures": f"{n_figures} in {out / 'figures'}"})


def command_line(
    program: str, inputs: Sequence[str], out: Path, options: Mapping[str, str | None]
) -> str:
    """The command that makes the report again."""
    words = [*program.split(), *map(within, inputs), "--out", within(str(out))]
    for name, value in options.items():
        words += [name] if value is None else [name, value]
    return shlex.join(words)


def within(path: str) -> str:
    """A path as given, but without folders outside the current one: a report travels."""
    inside = not Path(path).is_absolute() and ".." not in Path(path).parts
    return path if inside else Path(path).name


def named(text: str) -> list[str]:
    """The names of a list with commas."""
    return [name.strip() for name in text.split(",") if name.strip()]
