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
    DEFAULT_STEP,
    EncoderConfig,
)
from meshreel.codec.methods import METHODS, Allocation, Laplacian, Order

METHOD_NAMES = ", ".join(row.name for row in METHODS)
LAPLACIAN_NAMES = ", ".join(row.name.lower() for row in Laplacian)
ALLOCATION_NAMES = ", ".join(row.value for row in Allocation)
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
    method: Annotated[str, typer.Option(help=f"How to code: {METHOD_NAMES}.")] = DEFAULT_METHOD,
    modes: Annotated[
        int | None, typer.Option(help="Eigen-trajectories to keep of each axis, 1 or more.")
    ] = None,
    energy: Annotated[
        float | None,
        typer.Option(
            help="Share of the shape's energy to keep, up to 1; chooses the number of modes. "
            f"[default: {DEFAULT_ENERGY}]",
            show_default=False,
        ),
    ] = None,
    bits: Annotated[
        str | None,
        typer.Option(
            metavar="N[,N...]",
            help="Bits of the largest coefficient, 2 to 24; or of each row, 0 to leave it out. "
            "[default: 9; pca: 16]",
            show_default=False,
        ),
    ] = None,
    allocation: Annotated[
        str,
        typer.Option(help=f"How one number of bits is spread over the rows: {ALLOCATION_NAMES}."),
    ] = DEFAULT_ALLOCATION,
    anchors: Annotated[
        float | None,
        typer.Option(
            help="Share of the vertices sent as anchors, 0 to 1, where the method has them. "
            f"[default: {DEFAULT_ANCHORS}]",
            show_default=False,
        ),
    ] = None,
    laplacian: Annotated[
        str, typer.Option(help=f"The matrix that makes deltas: {LAPLACIAN_NAMES}.")
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
            help="Frames coded together; fewer take less memory. Default: all (blocks: 25)"
        ),
    ] = None,
    iterations: Annotated[
        int, typer.Option(help="Orthogonal iterations from block to block (blocks).")
    ] = DEFAULT_ITERATIONS,
    step: Annotated[
        float | None,
        typer.Option(
            help=f"Step of reel as it acts on a position, in diagonals. [default: {DEFAULT_STEP}]",
            show_default=False,
        ),
    ] = None,
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

    - `meshreel encode 'sim/*.obj' -o sim.reel --modes 30 --bits 10 --order drop`
    """
    from meshreel.atomic_write import check_output_path, replace_when_done
    from meshreel.cli.console import print_json, print_notes, print_table, progress_bar
    from meshreel.cli.figures import size_figures, size_rows
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
        step=step,
    )
    notes: list[str] = []
    with progress_bar() as progress:
        frames = natural_order(Path(path) for path in inputs)
        source = inputs[0] if len(inputs) == 1 else frames
        sequence = load(source, fps=fps, progress=progress, notes=notes)
        data = encode(sequence, **vars(config), progress=progress)
        with replace_when_done(target, overwrite=force) as temporary:
            temporary.write_bytes(data)
    print_notes(notes)
    stream = info(data)
    if as_json:
        print_json({"output": str(target), "notes": notes, **size_figures(stream)})
    else:
        print_table(str(target), size_rows(stream))


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
