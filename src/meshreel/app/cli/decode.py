"""`meshreel decode`: decode a .reel to another format."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from meshreel.app.cli.commands import command
from meshreel.app.cli.parameters import Argument, ForceOption, JsonOption
from meshreel.app.cli.read_options import MemoryOption, SegmentOption
from meshreel.app.cli.write_options import (
    WRITING_DECODED,
    FramesOption,
    OutputOption,
    StartNumberOption,
)
from meshreel.codec.option import Option
from meshreel.codec.options import option_named
from meshreel.formats.options import BOUNDS, WriteOptions

UNIT = replace(option_named("unit"), group=BOUNDS)


@command
def decode_command(
    source: Annotated[
        str,
        Argument(
            "FILE.reel",
            "The stream to decode, or its address (s3://, gs://, https://). With --frames only the "
            "blocks of those frames are downloaded.",
        ),
    ],
    output: OutputOption,
    writing: Annotated[dict[str, Any], WRITING_DECODED],
    frames: FramesOption = None,
    start_number: StartNumberOption = None,
    modes: Annotated[
        int | None,
        Option(
            "Number of leading modes that move, for a coarser animation that decodes faster; "
            "further modes keep their mean. Default: all."
        ),
    ] = None,
    segment: SegmentOption = None,
    memory: MemoryOption = None,
    unit: Annotated[str | None, UNIT] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Decode the animation of a .reel file.

    Files of a pattern have the numbers of their frames.

    Examples:

    - `meshreel decode walk.reel -o walk.npz`
    - `meshreel decode walk.reel -o walk.glb --max-error 0.05`
    - `meshreel decode walk.reel -o walk.glb --max-error 0.5 --rig`
    - `meshreel decode walk.reel -o walk.vat/`
    - `meshreel decode walk.reel -o out/frame_%04d.obj --frames 10:20`
    - `meshreel decode walk.reel -o preview.npz --modes 8`
    """
    from contextlib import nullcontext

    from meshreel.app.cli.console import print_json, print_notes, shown_progress
    from meshreel.app.cli.read_options import refuse_other_formats
    from meshreel.app.cli.rig_figures import size_as_morph_targets
    from meshreel.app.cli.write_options import (
        checked_bound,
        chosen_frames,
        frame_slice,
        print_written,
        refuse_stream,
        written_figures,
    )
    from meshreel.formats.file_errors import errors_naming
    from meshreel.formats.outputs import check_output
    from meshreel.formats.reel import open as open_reel
    from meshreel.formats.remote import local_file
    from meshreel.formats.save import save_part
    from meshreel.model.notes import Notes
    from meshreel.runtime.stores.address import is_remote

    selection = frame_slice(frames)
    writing["max_error"] = checked_bound(writing["max_error"], unit)
    refuse_stream(output)
    options = WriteOptions(**writing)
    notes = Notes()
    with local_file(source, notes, memory) if selection is None else nullcontext(source) as stream:
        inputs = [] if is_remote(source) else [Path(source)]
        check_output(
            output,
            overwrite=force, start_number=start_number, inputs=inputs, options=options,
        )  # fmt: skip
        remedy = f"encode it first: meshreel encode {source} -o {Path(source).stem}.reel"
        convert = "`meshreel convert` writes it in another format directly"
        refuse_other_formats(Path(source), f"{remedy}; {convert}")
        with (
            shown_progress() as progress,
            open_reel(stream, n_modes=modes, segment=segment, memory=memory) as reel,
            errors_naming(source),
        ):
            numbers = chosen_frames(selection, reel.n_frames, notes)
            figures: dict[str, Any] = {}
            paths = save_part(
                reel,
                numbers,
                output,
                overwrite=force,
                start_number=start_number,
                inputs=inputs,
                options=options,
                progress=progress,
                notes=notes,
                figures=figures,
            )
            if "rig" in figures:
                sizes = size_as_morph_targets(
                    reel, numbers, paths[0], options, figures["rig"], progress
                )
                if len(numbers) == reel.n_frames:
                    sizes[".reel (input)"] = reel.size_bytes
                figures["alternatives_bytes"] = sizes
            figures |= written_figures(paths, reel, len(numbers))
    if not reel.is_whole:
        notes.result(f"{source} is truncated: these are the frames of its complete blocks")
    print_notes(notes)
    if as_json:
        print_json({**figures, "is_whole": reel.is_whole, "notes": notes})
        return
    print_written(figures)
