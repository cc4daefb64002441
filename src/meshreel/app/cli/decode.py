"""`meshreel decode`: decode a .reel to another format."""

from typing import Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.console import shown_progress
from meshreel.app.cli.options import (
    FramesOption,
    MemoryOption,
    OutputOption,
    SegmentOption,
    StartNumberOption,
    WritingOption,
    frame_slice,
    refuse_other_formats,
    refuse_stream,
)
from meshreel.app.cli.parameters import Argument, ForceOption, JsonOption
from meshreel.codec.option import Option


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
    options: WritingOption,
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
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Decode the animation of a .reel file.

    Outputs such as frame_%04d.obj are numbered like their frames.

    Examples:

    - `meshreel decode walk.reel -o walk.npz`
    - `meshreel decode walk.reel -o walk.glb --max-error 0.05`
    - `meshreel decode walk.reel -o walk.glb --max-error 0.5 --rig`
    - `meshreel decode walk.reel -o walk.vat/`
    - `meshreel decode walk.reel -o out/frame_%04d.obj --frames 10:20`
    - `meshreel decode walk.reel -o preview.npz --modes 8`
    """
    from meshreel.app.cli.written import print_result
    from meshreel.model.notes import Notes
    from meshreel.operations.convert import Target, decode

    refuse_stream(output)
    refuse_other_formats(source, "; `meshreel convert` writes it in another format directly")
    notes = Notes()
    target = Target(output=output, options=options, start_number=start_number, overwrite=force)
    with shown_progress() as progress:
        result = decode(
            source,
            target,
            notes,
            frames=frame_slice(frames),
            n_modes=modes,
            segment=segment,
            memory=memory,
            progress=progress,
        )
    print_result(result, notes, as_json=as_json)
