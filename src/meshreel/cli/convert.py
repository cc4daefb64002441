"""`meshreel convert`: an animation in, the same in another format out."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from meshreel.cli.completing import input_files
from meshreel.cli.encode_options import UnitOption
from meshreel.cli.read_options import (
    AllowOutsideOption,
    AttributesOption,
    DatasetOption,
    FpsOption,
    MergeOption,
    ObjectOption,
    SkipBadOption,
    SplitOption,
    TopologyOption,
)
from meshreel.cli.write_options import (
    ForceOption,
    FramesOption,
    GltfErrorOption,
    NormalsOption,
    OutputOption,
    TargetsOption,
)
from meshreel.surface_selection import ALL

if TYPE_CHECKING:
    from meshreel.sequence import FrameSource


def convert_command(
    inputs: Annotated[
        list[str],
        typer.Argument(
            metavar="INPUT",
            autocompletion=input_files,
            help="A file that holds an animation, a folder or a quoted glob of frames, or the "
            "frame files.",
        ),
    ],
    output: OutputOption,
    frames: FramesOption = None,
    fps: FpsOption = None,
    object: ObjectOption = None,
    merge: MergeOption = False,
    skip_bad: SkipBadOption = False,
    allow_outside: AllowOutsideOption = False,
    topology: TopologyOption = None,
    dataset: DatasetOption = None,
    attributes: AttributesOption = ALL,
    split: SplitOption = False,
    targets: TargetsOption = None,
    max_error: GltfErrorOption = None,
    unit: UnitOption = None,
    normals: NormalsOption = None,
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was done as JSON.")] = False,
) -> None:
    """Write an animated mesh in another format; nothing is lost that the format can hold.

    A .reel is coded at the default quality; `meshreel encode` has the choices.

    Examples:

    - `meshreel convert walk.abc -o walk.usdc`

    - `meshreel convert character.glb -o walk.abc --fps 30 --merge`

    - `meshreel convert cache.mdd --topology rest.obj -o cache.abc`

    - `meshreel convert walk.npz -o walk.glb --max-error 0.05`
    """
    from meshreel.cli.console import print_json, print_notes, progress_bar
    from meshreel.cli.write_options import (
        checked_bound,
        frame_slice,
        print_written,
        written_figures,
    )
    from meshreel.codec.decoder import frame_range
    from meshreel.formats.load import loading_for, open_for_encoding
    from meshreel.formats.options import ReadOptions, WriteOptions
    from meshreel.formats.reel import origin_of_file
    from meshreel.formats.save import save_part
    from meshreel.formats.sources import natural_order
    from meshreel.formats.stretches import find_stretches
    from meshreel.formats.targets import check_save_target

    bound = checked_bound(max_error, unit)
    check_save_target(output, overwrite=force)
    chosen = frame_slice(frames)
    if split and chosen is not None:
        raise typer.BadParameter("--split and --frames exclude each other; give one")
    ordered = natural_order(Path(path) for path in inputs)
    source = inputs[0] if len(inputs) == 1 else ordered
    notes: list[str] = []
    done: list[dict[str, Any]] = []
    with progress_bar() as progress:
        reading = ReadOptions(
            fps, object, merge, topology, dataset,
            progress=progress, notes=notes, attributes=attributes,
            skip_bad=skip_bad, allow_outside=allow_outside,
        )  # fmt: skip

        def write(sequence: "FrameSource", target: str | Path) -> None:
            wanted = frame_range(chosen, sequence.n_frames)
            origin = origin_of_file(inputs[0]) if len(inputs) == 1 else None
            written = save_part(
                sequence,
                wanted,
                target,
                overwrite=force,
                options=WriteOptions(targets, bound, normals, origin),
                progress=progress,
                notes=notes,
            )
            done.append(written_figures(written, sequence, len(wanted)))

        if split:
            stretches = find_stretches(source, loading_for(None, reading))
            for one in stretches:
                write(one.open(), one.path(Path(output)) if len(stretches) > 1 else output)
        else:
            write(open_for_encoding(source, None, reading), output)
    print_notes(notes)
    if as_json:
        print_json({**({"stretches": done} if split else done[0]), "notes": notes})
        return
    for figures in done:
        print_written(figures)
