"""`meshreel encode`: encode an animation as a .reel."""

from typing import Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.options import (
    ENCODING,
    WHOLE_SEQUENCES,
    Encoding,
    RegisteringOption,
    SplitOption,
    StreamOption,
    TrackOption,
    reading,
    stream_output,
    track_targets,
)
from meshreel.app.cli.parameters import Argument, ForceOption, JsonOption
from meshreel.formats.options import Reading


@command
def encode_command(
    inputs: Annotated[
        tuple[str, ...],
        Argument(
            "INPUT...",
            "An animation file (.abc, .usd, .glb, .npz, ...: see `meshreel formats`), a folder or "
            "a quoted glob of frames, or the frame files (.obj, .ply, .off, .stl), in natural "
            "order. Or addresses (s3://, gs://, https://), which are downloaded.",
        ),
    ],
    encoding: Annotated[Encoding, ENCODING],
    reading: Annotated[
        "Reading",
        reading(*WHOLE_SEQUENCES),
    ],
    registering: RegisteringOption,
    output: StreamOption = None,
    track: TrackOption = (),
    split: SplitOption = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compress an animated mesh into one .reel file.

    Prints the bound, largest error and bytes of positions and of each track, and the bytes of
    connectivity, surface (attributes, groups, materials, images) and container.

    Examples:

    - `meshreel encode walk.npz`
    - `meshreel encode frames/ -o walk.reel --fps 25`
    - `meshreel encode 'sim/*.obj' -o sim.reel --max-error 0.1`
    - `meshreel encode scan.usdc --max-error 0.5mm --unit cm`
    - `meshreel encode shot.abc --object /root/body -o body.reel`
    - `meshreel encode shot.usdc --merge -o shot.reel`
    - `meshreel encode walk.npz --lossless`
    - `meshreel encode walk.npz --size 100kB --order drop --effort 9`
    - `meshreel encode character.glb --uv-bits 12`
    - `meshreel encode character.glb --attributes none`
    - `meshreel encode sim.vtkhdf --bound 0.1% --track stress=1MPa`
    - `meshreel encode sim.vtkhdf --track stress=500Pa --track velocity=0.1% --track id=exact`
    - `meshreel encode capture/ --register 0.2%`
    - `meshreel encode huge_frames/ --memory 1GiB`
    - `meshreel encode walk.npz --method pca-qp --modes 30`
    """
    from meshreel.app.cli.written import convert_and_print
    from meshreel.codec.options import config_of
    from meshreel.operations.convert import Target

    target = Target(
        output=stream_output(output, inputs),
        config=config_of(**encoding),
        tracks=track_targets(track),
        overwrite=force,
    )
    convert_and_print(
        inputs, target, reading, registering=registering, splits=split, as_json=as_json
    )
