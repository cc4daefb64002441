"""`meshreel convert`: write an animation in another format."""

from typing import Annotated, Any

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.encode_options import Encoding, encoding
from meshreel.app.cli.parameters import Argument, ForceOption, JsonOption
from meshreel.app.cli.read_options import WHOLE_SEQUENCES, SplitOption, reading
from meshreel.app.cli.track_options import TrackOption, track_targets
from meshreel.app.cli.write_options import (
    OUTPUT_ERROR,
    OUTPUT_KG,
    OUTPUT_QUALITY,
    WRITING,
    FramesOption,
    OutputOption,
    StartNumberOption,
)
from meshreel.formats.options import ReadOptions, WriteOptions

GENERAL_OPTIONS = ("max_error", "unit", "kg", "quality")
"""Options for encoding that also apply to other outputs than .reel."""


@command
def convert_command(
    inputs: Annotated[
        tuple[str, ...],
        Argument(
            "INPUT...",
            "An animation file, a folder or a quoted glob of frames, or the frame files. Or "
            "addresses (s3://, gs://, https://), which are downloaded.",
        ),
    ],
    output: OutputOption,
    reading: Annotated[ReadOptions, reading(*WHOLE_SEQUENCES)],
    writing: Annotated[dict[str, Any], WRITING],
    encoding: Annotated[
        Encoding, encoding(max_error=OUTPUT_ERROR, kg=OUTPUT_KG, quality=OUTPUT_QUALITY)
    ],
    frames: FramesOption = None,
    start_number: StartNumberOption = None,
    track: TrackOption = (),
    split: SplitOption = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Write an animated mesh in another format, without loss as far as the format allows.

    A .reel output is encoded with the options of `meshreel encode`, which only apply to .reel, and
    its error is printed. Files of a pattern have the numbers of their frames.

    Examples:

    - `meshreel convert walk.abc -o walk.usdc`
    - `meshreel convert character.glb -o walk.abc --fps 30 --merge`
    - `meshreel convert cache.mdd --topology rest.obj -o cache.abc`
    - `meshreel convert walk.npz -o walk.glb --max-error 0.05`
    - `meshreel convert walk.abc -o walk.glb --rig 64`
    - `meshreel convert walk.npz -o walk.vat/ --layout openvat-unity --max-error 0.05`
    - `meshreel convert walk.abc -o part.reel --frames 100:200 --max-error 0.1`
    - `meshreel convert walk.abc -o out/frame_%04d.obj --start-number 1001`
    """
    from contextlib import ExitStack
    from dataclasses import replace

    from meshreel.app.cli.console import print_json, print_notes, shown_progress
    from meshreel.app.cli.conversion import Conversion
    from meshreel.app.cli.read_options import source_of
    from meshreel.app.cli.write_options import (
        checked_bound,
        frame_slice,
        is_stream,
        known_frames,
        refuse_stream_options,
    )
    from meshreel.codec.options import config_of
    from meshreel.formats.load import loading_for
    from meshreel.formats.needed_extras import extras_to_read, extras_to_write
    from meshreel.formats.reel import origin_of_file
    from meshreel.formats.remote import local_copy
    from meshreel.formats.segments import open_any
    from meshreel.formats.sources import files_of_source, find_files
    from meshreel.runtime.extras import require

    stream_options = {name: encoding[name] for name in encoding if name not in GENERAL_OPTIONS}
    bound = checked_bound(encoding["max_error"], encoding["unit"])
    selection = frame_slice(frames)
    if split and selection is not None:
        raise click.UsageError("--split and --frames cannot be combined; give one")
    if not is_stream(output):
        refuse_stream_options({*stream_options, "track"}, output)
    config = config_of(**(encoding if is_stream(output) else stream_options))
    rig_bounds = {} if is_stream(output) else {name: encoding[name] for name in ("kg", "quality")}
    notes = reading.notes
    with ExitStack() as stack:
        source = stack.enter_context(local_copy(source_of(inputs), notes))
        files = files_of_source(source, reading.topology)
        progress = stack.enter_context(shown_progress())
        origin = origin_of_file(files[0]) if len(inputs) == 1 else None
        reading = loading_for(config.memory_bytes, replace(reading, progress=progress))
        if origin is not None and not is_stream(output):
            # Writers read each frame once, so that decoding all frames first would gain nothing.
            reading = replace(reading, max_loaded_bytes=0)
        conversion = Conversion(
            output,
            files,
            WriteOptions(max_error=bound, origin=origin, **rig_bounds, **writing),
            reading,
            config,
            start_number,
            force,
            progress,
            notes,
            track_targets(track),
        )
        require([*extras_to_read(files, reading), *extras_to_write(output)])
        # Check the output before the input is read, which may take long.
        conversion.check(output, None if split else known_frames(files, selection))
        if split:
            conversion.write_segments(source, reading)
        else:
            conversion.write(open_any(find_files(source), reading), output, selection)
    print_notes(notes)
    if as_json:
        outputs = conversion.figures
        print_json({**({"outputs": outputs} if split else outputs[0]), "notes": notes})
        return
    conversion.show()
