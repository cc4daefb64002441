"""Reports of studies on input sequences."""

import shlex
from collections.abc import Sequence
from pathlib import Path

import click
from click.core import ParameterSource

from meshreel.app.cli.console import print_json, print_notes, print_table, shown_progress
from meshreel.errors import ConnectivityChangeError
from meshreel.formats.load import load_any
from meshreel.formats.options import Reading
from meshreel.model.flag import simulate_flag
from meshreel.model.notes import Notes, listed
from meshreel.model.sequence import MeshSequence, single_segment
from meshreel.operations.inputs import check_inputs
from meshreel.runtime.extras import PEERS, PLOT, Extra
from meshreel.runtime.outputs.checks import check_output_folder
from meshreel.studies.study import R, Study, evaluate


def check_before_work(
    inputs: Sequence[str],
    out: Path,
    other_inputs: Sequence[Path] = (),
    extras: Sequence[Extra] = (),
) -> None:
    """Check before a long run that a report can be written.

    Parameters
    ----------
    inputs : sequence of str
        Sources of sequences.
    out : Path
        The folder of the report.
    other_inputs : sequence of Path
        Other files to read.
    extras : sequence of Extra
        Extras needed in addition to those of every report.

    Raises
    ------
    InvalidInputError
        If an extra or an input is missing, or the folder cannot be written.
    """
    files = check_inputs(inputs, PLOT, PEERS, *extras)
    check_output_folder(out, inputs=[*files, *other_inputs])


def write_report(
    study: Study[R],
    inputs: Sequence[str],
    out: Path,
    *,
    flag_frames: int = 0,
    as_json: bool,
) -> None:
    """Run a study on the inputs, and print the paths of its report.

    Parameters
    ----------
    inputs : sequence of str
        Sources of sequences; the flag if empty.
    flag_frames : int
        Number of frames of the flag.
    as_json : bool
        Print all figures as JSON instead.
    """
    notes = Notes()
    with shown_progress() as progress:
        reading = Reading(progress=progress, notes=notes)
        sequences: list[MeshSequence] = [load_any(source, reading) for source in inputs]
        for sequence, source in zip(sequences, inputs, strict=True):
            try:
                single_segment(sequence, f"{study.program} of {source}")
            except ConnectivityChangeError as error:
                raise ConnectivityChangeError(
                    f"{error}; run `meshreel register` first, or measure distances between "
                    "surfaces with `meshreel compare`"
                ) from None
        for number, sequence in enumerate(sequences):
            if sequence.tracks:  # only some methods encode them
                names = listed(sequence.tracks)
                notes.left_out(f"tracks, as the report covers positions: {names}")
                sequences[number] = sequence.replace(tracks={})
        sequences = sequences or [simulate_flag(flag_frames, progress=progress)]
        command = command_line(study.program)
        evaluation = evaluate(study, sequences, out, command=command, progress=progress)
    print_notes([*notes, *evaluation.notes])
    if as_json:
        print_json({**evaluation.as_dict(), "notes": notes})
        return
    n_figures = sum(len(pictures) for _, pictures in evaluation.measured)
    figures = f"{n_figures} in {out / 'figures'}"
    print_table("Written", {"report": str(evaluation.report), "figures": figures})


def command_line(program: str) -> str:
    """The command that reproduces the report: the user's, with the output folder."""
    context = click.get_current_context()
    words = [*program.split(), *map(portable_path, context.params["inputs"] or ())]
    words += ["--out", portable_path(str(context.params["out"]))]
    for option in context.command.params:
        name, value = str(option.name), context.params.get(str(option.name))
        is_explicit = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
        if is_explicit and name not in ("inputs", "out", "as_json"):
            text = portable_path(str(value)) if isinstance(value, Path) else str(value)
            words += [option.opts[0], *([] if value is True else [text])]
    return shlex.join(words)


def portable_path(path: str) -> str:
    """The path, or only its name if it is outside the current folder, for reports to share."""
    is_inside = not Path(path).is_absolute() and ".." not in Path(path).parts
    return path if is_inside else Path(path).name


def split_names(text: str) -> list[str]:
    """The names in a comma-separated list."""
    return [name.strip() for name in text.split(",") if name.strip()]
