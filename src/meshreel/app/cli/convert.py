"""`meshreel convert`: write an animation in another format."""

from typing import Annotated, Any

from meshreel.app.cli.commands import command
from meshreel.app.cli.options import (
    OUTPUT_ERROR,
    OUTPUT_KG,
    OUTPUT_QUALITY,
    SHARED_NAMES,
    WHOLE_SEQUENCES,
    WRITING,
    Encoding,
    FramesOption,
    OutputOption,
    RegisteringOption,
    SplitOption,
    StartNumberOption,
    TrackOption,
    checked_bound,
    encoding,
    frame_slice,
    reading,
    refuse_stream_options,
    track_targets,
)
from meshreel.app.cli.parameters import Argument, ForceOption, JsonOption
from meshreel.formats.options import Reading, WriteOptions

GENERAL_OPTIONS = (*SHARED_NAMES, "unit")
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
    reading: Annotated[Reading, reading(*WHOLE_SEQUENCES)],
    registering: RegisteringOption,
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
    its error is printed. Outputs such as frame_%04d.obj are numbered like their frames.

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
    from meshreel.app.cli.written import convert_and_print
    from meshreel.codec.options import config_of
    from meshreel.operations.convert import Target, is_stream

    options = WriteOptions()
    if not is_stream(output):
        general = {name: encoding.pop(name) for name in GENERAL_OPTIONS}
        refuse_stream_options({*encoding, "track"}, output)
        bound = checked_bound(general.pop("max_error"), general.pop("unit"))
        options = WriteOptions(max_error=bound, **general, **writing)
    target = Target(
        output=output,
        config=config_of(**encoding),
        tracks=track_targets(track),
        options=options,
        start_number=start_number,
        overwrite=force,
    )
    choices = {"registering": registering, "frames": frame_slice(frames), "splits": split}
    convert_and_print(inputs, target, reading, as_json=as_json, **choices)
