"""`meshreel register`: follow the surface of a raw capture, and encode the result."""

from typing import Annotated, Any

from meshreel.app.cli.commands import command
from meshreel.app.cli.options import (
    ENCODING,
    MESHES,
    REGISTERING,
    Encoding,
    StreamOption,
    reading,
    stream_output,
)
from meshreel.app.cli.parameters import Argument, ForceOption, JsonOption
from meshreel.codec.error_bounds import METERS
from meshreel.codec.option import Option
from meshreel.formats.options import Reading
from meshreel.registration.options import RegisterOptions

SEPARATE_FILES = "to write a .reel and a video, name the video with --texture-output"


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
    registering: Annotated[dict[str, Any], REGISTERING],
    output: StreamOption = None,
    measure: Annotated[
        bool,
        Option(
            "Measure the distances of the decoded surface, and D1 and D2. The tolerance is met in "
            "either case.",
            flag="--measure/--no-measure",
        ),
    ] = True,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Compress a raw capture, which has a new mesh in every frame, into one file.

    The mesh of a key frame is deformed to fit the frames before and after it, as far as the
    tolerance is met; where it is not, another key begins a segment. The distance of the registered
    surface from the raw one, and that of the decoded surface, are measured and printed. Frames that
    cannot be followed keep their raw mesh. Texture coordinates and materials are those of the keys;
    --texture bakes the texture of every frame for them, into a .mp4 that also contains the .reel:
    programs play its video, `meshreel view`, `meshreel export` and <reel-player> all of it.

    Long captures are registered in runs of about 120 frames, on --workers or a --scheduler, and
    joined. Finished runs are stored in a folder beside the output, such as walk.registration, until
    the file is complete. If the command is stopped, start it again: it continues after these runs,
    also with other encoding options than --quality, which determines how many vertices keys keep.

    Examples:

    - `meshreel register capture/`
    - `meshreel register 'scan/*.obj' -o walk.reel --tolerance 0.1% --quality 70`
    - `meshreel register capture/ --tolerance 1mm --unit m`
    - `meshreel register capture/ --size 2MB`
    - `meshreel register s3://studio/take/ -o take.reel --scheduler tcp://10.0.0.5:8786`
    - `meshreel register scans/ -o walk.mp4 --texture 'scans/*.png' --sound walk.wav`
    """
    from meshreel.app.cli.written import convert_and_print
    from meshreel.codec.options import config_of
    from meshreel.operations.convert import Target

    joins = registering["texture"] is not None and registering["texture_output"] is None
    output = stream_output(output, inputs, *((".mp4", SEPARATE_FILES) if joins else ()))
    unit = None
    if registering["tolerance"].strip().lower().endswith(tuple(METERS)):
        unit = encoding["unit"]
        encoding = {**encoding, "unit": unit if encoding["max_error"] is not None else None}
    if joins:
        registering["texture_output"] = output
    target = Target(output=output, config=config_of(**encoding), overwrite=force)
    convert_and_print(
        inputs, target, reading,
        registering=RegisterOptions(**registering, unit=unit, overwrite=force), reports=measure,
        as_json=as_json,
    )  # fmt: skip
