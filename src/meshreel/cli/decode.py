"""`meshreel decode`: a .reel in, frames out."""

from pathlib import Path
from typing import Annotated

import typer


def decode_command(
    source: Annotated[Path, typer.Argument(metavar="FILE.reel", help="The stream to decode.")],
    output: Annotated[
        str,
        typer.Option(
            "--output", "-o", help="An .npz file, or a pattern such as out/frame_%04d.obj."
        ),
    ],
    frames: Annotated[
        str | None, typer.Option(metavar="A:B", help="Only frames A to B - 1. Default: all.")
    ] = None,
    modes: Annotated[
        int | None,
        typer.Option(help="Stop after so many modes: a coarser animation. Default: all."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", "-f", help="Replace outputs that exist.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print what was done as JSON.")] = False,
    profile: Annotated[bool, typer.Option("--profile", help="Print seconds by stage.")] = False,
) -> None:
    """Give back the animation that a .reel file holds.

    Examples:

    - `meshreel decode walk.reel -o walk.npz`

    - `meshreel decode walk.reel -o out/frame_%04d.obj --frames 10:20`

    - `meshreel decode walk.reel -o preview.npz --modes 8`
    """
    from meshreel.cli.console import print_json, print_notes, print_table, progress_bar
    from meshreel.cli.profile import print_profile, profile_figures
    from meshreel.formats.naming import errors_naming
    from meshreel.formats.reel import open
    from meshreel.formats.save import save_frames
    from meshreel.formats.targets import check_save_target
    from meshreel.profiling import profiled

    chosen = _frame_slice(frames)
    check_save_target(output, overwrite=force)
    with (
        progress_bar() as progress,
        profiled() as times,
        open(source, n_modes=modes) as reel,
        errors_naming(source),
    ):
        wanted = reel.frame_range(chosen)
        written = save_frames(
            (run for _, run in reel.pieces(wanted)),
            reel.faces,
            output,
            n_frames=len(wanted),
            fps=reel.fps,
            name=reel.name,
            overwrite=force,
            progress=progress,
        )
    if not reel.is_whole:
        print_notes([f"{source} is cut off: these are the frames of its whole blocks"])
    if as_json:
        print_json(
            {
                "outputs": [str(path) for path in written],
                "n_frames": len(wanted),
                "n_verts": reel.n_verts,
                "n_faces": reel.n_faces,
                "fps": reel.fps,
                "is_whole": reel.is_whole,
                **({"profile": profile_figures(times)} if profile else {}),
            }
        )
        return
    where = str(written[0]) if len(written) == 1 else f"{written[0]} to {written[-1].name}"
    print_table(
        where,
        {
            "sequence": f"{len(wanted)} frames, {reel.n_verts} vertices, {reel.n_faces} faces",
            "files": str(len(written)),
        },
    )
    if profile:
        print_profile(times)


def _frame_slice(text: str | None) -> slice | None:
    """The slice that 'A:B', 'A:', ':B' or 'A' names."""
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        start = int(first) if first else None
        stop = int(last) if last else None
    except ValueError:
        raise typer.BadParameter(f"--frames takes A:B with whole numbers; got {text!r}") from None
    if not colon:
        if start is None:
            raise typer.BadParameter("--frames takes A:B; got nothing")
        return slice(start, start + 1 or None)
    return slice(start, stop)
