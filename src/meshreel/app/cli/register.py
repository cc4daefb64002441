"""`meshreel register`: follow the surface of a raw capture, and encode the result."""

from pathlib import Path
from typing import Annotated

import click

from meshreel.app.cli.commands import command
from meshreel.app.cli.encode_options import ENCODING, Encoding
from meshreel.app.cli.parameters import Argument, ForceOption, JsonOption
from meshreel.app.cli.read_options import MESHES, reading
from meshreel.app.cli.registering import KeepHolesOption
from meshreel.app.cli.write_options import StreamOption, stream_output
from meshreel.codec.option import Option
from meshreel.formats.options import Reading


@command
def register_command(
    inputs: Annotated[
        tuple[str, ...],
        Argument(
            "RAW...",
            "A raw capture, with a new mesh in every frame: a folder or a quoted glob of frames, "
            "the frame files (.drc, .obj, .ply, ...), or an animation file (.abc, .usd, .vtkhdf, "
            "...). Or addresses (s3://, gs://, https://), which are downloaded.",
        ),
    ],
    reading: Annotated[Reading, reading("fps", *MESHES, "dataset", "attributes")],
    encoding: Annotated[Encoding, ENCODING],
    output: StreamOption = None,
    tolerance: Annotated[
        str,
        Option(
            "Largest distance between the registered and the raw surface: percent of the diagonal "
            "of the box of all frames (0.2%), model units (0.5u), or a length (1mm, with --unit). "
            "In every frame, 99 % of both surfaces are within it, and no connected patch beyond it "
            "is larger than a square of ten tolerances.",
            metavar="LENGTH",
        ),
    ] = "0.2%",
    texture: Annotated[
        str | None,
        Option(
            "Textures of the raw frames: a folder or a quoted glob of images in frame order, or a "
            "video. They are baked into the texture coordinates of the segments.",
            metavar="IMAGES",
        ),
    ] = None,
    texture_output: Annotated[
        Path | None,
        Option(
            "The video (walk.mp4, needs [video]) or the images (walk_%04d.png) to write with "
            "--texture. Default: a video named after the output.",
            metavar="FILE",
        ),
    ] = None,
    measure: Annotated[
        bool,
        Option(
            "Measure the distances of the decoded surface, and D1 and D2. The tolerance is met in "
            "either case.",
            flag="--measure/--no-measure",
        ),
    ] = True,
    keep_holes: KeepHolesOption = False,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compress a raw capture, which has a new mesh in every frame, into one .reel file.

    The mesh of a key frame is deformed to fit the frames before and after it, as far as the
    tolerance is met; where it is not, another key begins a segment. The distance of the registered
    surface from the raw one, and that of the decoded surface, are measured and printed. Frames that
    cannot be followed keep their raw mesh. Texture coordinates and materials are those of the keys;
    --texture bakes the texture of every frame for them.

    Registered frames are stored in a folder beside the output, such as walk.registration, until the
    file is complete. If the command is stopped, start it again: it continues after these frames,
    also with other encoding options than --quality, which determines how many vertices keys keep.

    Examples:

    - `meshreel register capture/`
    - `meshreel register 'scan/*.obj' -o walk.reel --tolerance 0.1% --quality 70`
    - `meshreel register capture/ --tolerance 1mm --unit m`
    - `meshreel register capture/ --size 2MB`
    - `meshreel register capture/ -o walk.reel --texture 'capture/*.png' --texture-output walk.mp4`
    """
    from meshreel.app.cli.written import convert_and_print
    from meshreel.codec.error_bounds import METERS, bound_of
    from meshreel.codec.options import config_of
    from meshreel.operations.convert import Target
    from meshreel.operations.registering import Registering

    if texture_output is not None and texture is None:
        raise click.UsageError("--texture-output names the textures of --texture; give both")
    output = stream_output(output, inputs)
    is_length = tolerance.strip().lower().endswith(tuple(METERS))
    bound = bound_of(tolerance, encoding["unit"] if is_length else None, "tolerance")
    if is_length and encoding["max_error"] is None:
        encoding = {**encoding, "unit": None}
    registering = Registering(
        tolerance=bound,
        keep_holes=keep_holes,
        texture=texture,
        texture_output=texture_output or Path(output).with_suffix(".mp4"),
        overwrite=force,
    )
    target = Target(output=output, config=config_of(**encoding), overwrite=force)
    convert_and_print(
        inputs, target, reading, registering=registering, reports=measure, as_json=as_json
    )
