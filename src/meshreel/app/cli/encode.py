"""`meshreel encode`: encode an animation as a .reel."""

from pathlib import Path
from typing import TYPE_CHECKING

from meshreel.app.cli.commands import command
from meshreel.app.cli.completing import input_files
from meshreel.app.cli.encode_options import Encoding, encode_options
from meshreel.app.cli.parameters import argument, option
from meshreel.app.cli.read_options import MESHES, reading_options, split_option
from meshreel.app.cli.track_options import track_option, track_targets
from meshreel.app.cli.write_options import stream_option

if TYPE_CHECKING:
    from collections.abc import Callable

    from meshreel.formats.options import ReadOptions
    from meshreel.model.sequence import MeshSequence

OTHER_OUTPUTS = (
    "`meshreel convert` writes other formats, `meshreel render` pictures and films, "
    "`meshreel export` pages"
)
"""Advice for outputs with other extensions."""


@command
@argument(
    "inputs",
    nargs=-1,
    required=True,
    metavar="INPUT...",
    completion=input_files,
    help="An animation file (.abc, .usd, .glb, .npz, ...: see `meshreel formats`), a folder or a "
    "quoted glob of frames, or the frame files (.obj, .ply, .off, .stl), in natural order. Or "
    "addresses (s3://, gs://, https://), which are downloaded.",
)
@stream_option
@encode_options()
@reading_options("fps", *MESHES, "topology", "dataset", "attributes", "register")
@track_option
@split_option
@option("--force", "-f", is_flag=True, help="Replace the output if it exists.")
@option("as_json", "--json", is_flag=True, help="Print the figures as JSON.")
def encode_command(
    inputs: tuple[str, ...],
    output: str | None,
    encoding: Encoding,
    reading: "ReadOptions",
    track: tuple[str, ...],
    split: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Compress an animated mesh into one .reel file.

    Prints the measured errors, and the bytes of each part: positions, connectivity, surface
    (attributes, groups, materials, images), tracks and container.

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

    - `meshreel encode sim.vtkhdf --track stress=500Pa --track velocity=0.1% --track id=exact`

    - `meshreel encode capture/ --register 0.2%`

    - `meshreel encode huge_frames/ --memory 1GiB`

    - `meshreel encode walk.npz --method pca-qp --modes 30 --bits 10`
    """
    from contextlib import ExitStack
    from dataclasses import replace
    from functools import partial

    from meshreel.app.cli.console import print_json, print_notes, print_table, progress_bar
    from meshreel.app.cli.encoded_file import encode_file
    from meshreel.app.cli.read_options import output_stem, source_of
    from meshreel.codec.options import config_of
    from meshreel.formats.load import loading_for, open_for_encoding
    from meshreel.formats.needed_extras import extras_to_read
    from meshreel.formats.reel import open as open_reel
    from meshreel.formats.remote import local_copy, uploaded
    from meshreel.formats.segments import find_segments
    from meshreel.formats.sources import files_of_source
    from meshreel.runtime.extras import require
    from meshreel.runtime.outputs.checks import check_extension, check_output_path

    output = output or f"{output_stem(inputs[0])}.reel"
    check_extension(Path(output), (".reel",), OTHER_OUTPUTS)
    config, targets = config_of(**encoding), track_targets(track)
    notes = reading.notes
    with ExitStack() as stack:
        target = stack.enter_context(uploaded(output, overwrite=force))
        stream_path = Path(target.local)
        source = stack.enter_context(local_copy(source_of(inputs), notes))
        files = files_of_source(source, reading.topology)
        check_output_path(stream_path, overwrite=force, inputs=files)
        require(extras_to_read(files, reading))
        progress = stack.enter_context(progress_bar())
        keeps_order = config.order in ("keep", "vertices")
        reading = replace(reading, progress=progress, matches_frames=not keeps_order)
        pieces: list[tuple[Callable[[], MeshSequence], Path]]
        if split:
            segments = find_segments(source, loading_for(config.memory_bytes, reading))
            has_several = len(segments) > 1
            pieces = [
                (part.open, part.path(stream_path) if has_several else stream_path)
                for part in segments
            ]
        else:
            open_input = partial(open_for_encoding, source, config.memory_bytes, reading)
            pieces = [(open_input, stream_path)]
        for _, path in pieces:
            check_output_path(path, overwrite=force, inputs=files)
        results = [
            encode_file(
                open_piece(),
                path,
                config,
                notes,
                tracks=targets,
                force=force,
                progress=progress,
                name=target.name(path),
            )
            for open_piece, path in pieces
        ]
        reports = []
        for registration in reading.registrations:  # one at most: of the only piece
            from meshreel.registration.report import Report  # imports SciPy

            with open_reel(stream_path) as reel:
                reports.append(Report.measured(registration, reel, progress))
    print_notes(notes)
    if as_json:
        outputs = [result.figures() for result in results]
        figures = {"outputs": outputs} if split else outputs[0]
        for report in reports:
            figures |= report.figures()
        print_json({**figures, "notes": notes})
        return
    for result in results:
        result.show()
    for report, result in zip(reports, results, strict=False):
        print_table("relative to the raw capture", report.rows(result.stream.size_bytes))
