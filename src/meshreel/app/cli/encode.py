"""`meshreel encode`: encode an animation as a .reel."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from meshreel.app.cli.commands import command
from meshreel.app.cli.encode_options import ENCODING, Encoding
from meshreel.app.cli.parameters import Argument, File, ForceOption, JsonOption
from meshreel.app.cli.read_options import WHOLE_SEQUENCES, SplitOption, reading
from meshreel.app.cli.track_options import TrackOption, track_targets
from meshreel.app.cli.write_options import StreamOption

if TYPE_CHECKING:
    from meshreel.formats.options import ReadOptions

OTHER_OUTPUTS = (
    "`meshreel convert` writes other formats, `meshreel render` pictures and films, "
    "`meshreel export` pages"
)
"""Advice for outputs with other extensions."""


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
        "ReadOptions",
        reading(*WHOLE_SEQUENCES),
    ],
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
    - `meshreel encode walk.npz --method pca-qp --modes 30 --bits 10`
    """
    from contextlib import ExitStack
    from dataclasses import replace

    from meshreel.app.cli.console import print_json, print_notes, print_table, shown_progress
    from meshreel.app.cli.conversion import Conversion
    from meshreel.app.cli.read_options import output_stem, source_of
    from meshreel.codec.options import config_of
    from meshreel.codec.reel_options import quality_of
    from meshreel.formats.load import loading_for, open_for_encoding
    from meshreel.formats.needed_extras import extras_to_read
    from meshreel.formats.options import WriteOptions
    from meshreel.formats.reel import open as open_reel
    from meshreel.formats.remote import local_copy
    from meshreel.formats.sources import files_of_source
    from meshreel.runtime.extras import require
    from meshreel.runtime.outputs.checks import check_extension

    output = output or File(f"{output_stem(inputs[0])}.reel")
    check_extension(Path(output), (".reel",), OTHER_OUTPUTS)
    config, targets, notes = config_of(**encoding), track_targets(track), reading.notes
    with ExitStack() as stack:
        source = stack.enter_context(local_copy(source_of(inputs), notes))
        files = files_of_source(source, reading.topology)
        progress = stack.enter_context(shown_progress())
        conversion = Conversion(
            output, files, WriteOptions(), reading, config, None, force, progress, notes, targets,
        )  # fmt: skip
        conversion.check(output, None)
        require(extras_to_read(files, reading))
        keeps_order = config.order in ("keep", "vertices")
        reading = replace(
            reading,
            progress=progress,
            matches_frames=not keeps_order,
            quality=quality_of(config),
        )
        if split:
            conversion.write_segments(source, loading_for(config.memory_bytes, reading))
        else:
            opened = open_for_encoding(source, config.memory_bytes, reading)
            for registration in reading.registrations:  # one at most: of the only output
                conversion.config = registration.tuned(config, notes)
            conversion.write(opened, output)
        reports = []
        for registration in reading.registrations:
            from meshreel.registration.report import Report  # imports SciPy

            with open_reel(Path(output)) as reel:
                reports.append(Report.measured(registration, reel, progress))
    print_notes(notes)
    if as_json:
        outputs = conversion.figures
        figures = {"outputs": outputs} if split else outputs[0]
        for report in reports:
            figures |= report.figures()
        print_json({**figures, "notes": notes})
        return
    conversion.show()
    for report, stream in zip(reports, conversion.streams, strict=False):
        print_table("relative to the raw capture", report.rows(stream.encoded.stream.size_bytes))
