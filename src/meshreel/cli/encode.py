"""`meshreel encode`: frames in, one .reel out."""

from pathlib import Path
from typing import Annotated

import typer

from meshreel.codec.config import (
    DEFAULT_ALLOCATION,
    DEFAULT_ANCHORS,
    DEFAULT_ENERGY,
    DEFAULT_ITERATIONS,
    DEFAULT_LAPLACIAN,
    DEFAULT_METHOD,
    DEFAULT_ORDER,
    EncoderConfig,
)
from meshreel.codec.methods import METHODS, Allocation, Laplacian, Order
from meshreel.codec.targets import DEFAULT_EFFORT, DEFAULT_QUALITY, Tune

METHOD_NAMES = ", ".join(row.name for row in METHODS)
LAPLACIAN_NAMES = ", ".join(row.name.lower() for row in Laplacian)
ALLOCATION_NAMES = ", ".join(row.value for row in Allocation)
TUNE_NAMES = ", ".join(tune.value for tune in Tune)
TARGETS = "What to meet (give one)"
PAPER = "The paper's methods"
ORDER_NAMES = ", ".join(row.name.lower() for row in Order)


def encode_command(
    inputs: Annotated[
        list[str],
        typer.Argument(
            metavar="INPUT",
            help="An .npz file, a folder or a quoted glob of frames, or the frame files "
            "(.obj, .ply, .off, .stl); put in natural order.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", help="The .reel to write. Default: the input's name, in this folder."
        ),
    ] = None,
    quality: Annotated[
        float | None,
        typer.Option(
            help="1 to 100; every 12 points halve the error. "
            f"[default: {DEFAULT_QUALITY:g}, if nothing else is asked for]",
            show_default=False,
            rich_help_panel=TARGETS,
        ),
    ] = None,
    max_error: Annotated[
        float | None,
        typer.Option(
            metavar="PERCENT",
            help="No vertex of any frame farther from the original than this share of the "
            "bounding box's diagonal. Promised.",
            rich_help_panel=TARGETS,
        ),
    ] = None,
    kg: Annotated[
        float | None,
        typer.Option(
            metavar="PERCENT",
            help="Smallest file of at most this KG error.",
            rich_help_panel=TARGETS,
        ),
    ] = None,
    sted: Annotated[
        float | None,
        typer.Option(help="Smallest file of at most this STED.", rich_help_panel=TARGETS),
    ] = None,
    bpvf: Annotated[
        float | None,
        typer.Option(
            help="Best quality within so many bits for each vertex and frame.",
            rich_help_panel=TARGETS,
        ),
    ] = None,
    size: Annotated[
        float | None,
        typer.Option(
            metavar="BYTES", help="Best quality within so many bytes.", rich_help_panel=TARGETS
        ),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(
            help="Step of rounding as it acts on a position, in diagonals of the bounding box.",
            rich_help_panel=TARGETS,
        ),
    ] = None,
    tune: Annotated[
        str | None,
        typer.Option(
            help=f"What bits are spent on: {TUNE_NAMES}. visual: how the surface looks; geometry: "
            "where vertices are. [default: what the target needs, else visual]",
            show_default=False,
        ),
    ] = None,
    effort: Annotated[
        int | None,
        typer.Option(
            help=f"1 to 9: time against size. [default: {DEFAULT_EFFORT}]", show_default=False
        ),
    ] = None,
    method: Annotated[str, typer.Option(help=f"How to code: {METHOD_NAMES}.")] = DEFAULT_METHOD,
    modes: Annotated[
        int | None,
        typer.Option(
            help="Modes to keep, 1 or more: of reel at most so many, else of each axis.",
        ),
    ] = None,
    energy: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=PAPER,
            help="Share of the shape's energy to keep, up to 1; chooses the number of modes. "
            f"[default: {DEFAULT_ENERGY}]",
            show_default=False,
        ),
    ] = None,
    bits: Annotated[
        str | None,
        typer.Option(
            rich_help_panel=PAPER,
            metavar="N[,N...]",
            help="Bits of the largest coefficient, 2 to 24; or of each row, 0 to leave it out. "
            "[default: 9; pca: 16]",
            show_default=False,
        ),
    ] = None,
    allocation: Annotated[
        str,
        typer.Option(
            rich_help_panel=PAPER,
            help=f"How one number of bits is spread over the rows: {ALLOCATION_NAMES}.",
        ),
    ] = DEFAULT_ALLOCATION,
    anchors: Annotated[
        float | None,
        typer.Option(
            rich_help_panel=PAPER,
            help="Share of the vertices sent as anchors, 0 to 1, where the method has them. "
            f"[default: {DEFAULT_ANCHORS}]",
            show_default=False,
        ),
    ] = None,
    laplacian: Annotated[
        str,
        typer.Option(
            rich_help_panel=PAPER, help=f"The matrix that makes deltas: {LAPLACIAN_NAMES}."
        ),
    ] = DEFAULT_LAPLACIAN,
    order: Annotated[
        str,
        typer.Option(
            help=f"What to keep of the order of vertices and faces: {ORDER_NAMES}. "
            "keep: both; vertices: of the vertices; drop: neither, for the smallest file."
        ),
    ] = DEFAULT_ORDER,
    block_frames: Annotated[
        int | None,
        typer.Option(
            help="Frames coded together; fewer take less memory and more bytes. Default: all, as "
            "far as memory allows (blocks: 25)."
        ),
    ] = None,
    iterations: Annotated[
        int,
        typer.Option(
            rich_help_panel=PAPER, help="Orthogonal iterations from block to block (blocks)."
        ),
    ] = DEFAULT_ITERATIONS,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second. Default: what the input says.")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", "-f", help="Replace the output if it exists.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Compress an animated mesh into one .reel file.

    Examples:

    - `meshreel encode walk.npz`

    - `meshreel encode frames/ -o walk.reel --fps 25`

    - `meshreel encode 'sim/*.obj' -o sim.reel --max-error 0.1`

    - `meshreel encode walk.npz --size 100000 --order drop --effort 9`

    - `meshreel encode walk.npz --method pca-qp --modes 30 --bits 10`
    """
    from meshreel.atomic_write import check_output_path, replace_when_done
    from meshreel.cli.console import print_json, print_notes, print_table, progress_bar
    from meshreel.cli.figures import achieved_rows, size_figures, size_rows
    from meshreel.codec.achieved import measure_stream
    from meshreel.codec.encoder import encode
    from meshreel.codec.inspect import info
    from meshreel.formats.load import load
    from meshreel.formats.sources import natural_order

    target = output or Path(f"{_stem(inputs[0])}.reel")
    check_output_path(target, overwrite=force)
    config = EncoderConfig(
        method=method,
        n_modes=modes,
        energy=energy,
        bits=_bits(bits),
        allocation=allocation,
        anchors=anchors,
        laplacian=laplacian,
        order=order,
        block_frames=block_frames,
        n_iterations=iterations,
        quality=quality,
        max_error=max_error,
        kg=kg,
        sted=sted,
        bpvf=bpvf,
        size=size,
        step=step,
        tune=tune,
        effort=effort,
    )
    notes: list[str] = []
    with progress_bar() as progress:
        frames = natural_order(Path(path) for path in inputs)
        source = inputs[0] if len(inputs) == 1 else frames
        sequence = load(source, fps=fps, progress=progress, notes=notes)
        data = encode(sequence, **vars(config), progress=progress)
        with replace_when_done(target, overwrite=force) as temporary:
            temporary.write_bytes(data)
        achieved = measure_stream(
            sequence, data, order=order, with_sted=sted is not None, progress=progress
        )
    print_notes(notes)
    stream = info(data)
    if as_json:
        figures = {**size_figures(stream), **vars(achieved)}
        print_json({"output": str(target), "notes": notes, **figures})
    else:
        print_table(str(target), {**size_rows(stream), **achieved_rows(achieved, stream)})


def _bits(text: str | None) -> int | list[int] | None:
    """One number, or one for each row, from '8' or '8,8,6'."""
    if text is None:
        return None
    try:
        numbers = [int(number) for number in text.split(",")]
    except ValueError:
        raise typer.BadParameter(
            f"--bits takes a whole number, or several as in 8,8,6; got {text!r}"
        ) from None
    return numbers if len(numbers) > 1 else numbers[0]


def _stem(source: str) -> str:
    """The name of an output for this input: of a file its stem, of a glob its folder's."""
    path = Path(source).resolve()
    if any(mark in path.name for mark in "*?["):
        return path.parent.name
    return path.name if path.is_dir() else path.stem
