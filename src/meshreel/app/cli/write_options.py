"""Options of commands that write files of other programs, and what such a command says."""

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from meshreel.app.cli.completing import layout_names, output_files, texture_kinds
from meshreel.app.cli.parameters import option
from meshreel.codec.targets import DIAGONAL_OF_ALL, GROUP

if TYPE_CHECKING:
    from meshreel.formats.options import AnySource
    from meshreel.formats.remote import Output

GLTF = "glTF output"
GLTF_AND_TEXTURES = "glTF and .vat output"
TEXTURES = "Vertex animation textures (.vat output)"

output_option = option(
    "--output",
    "-o",
    required=True,
    completion=output_files,
    help="A file for all frames (.abc, .usdc, .glb, .npz, ...: see `meshreel formats`), or a "
    "pattern such as out/frame_%04d.obj for a file a frame, whose folder is made if missing; "
    "or a folder such as walk.vat/ of vertex animation textures. Or an address that ends so "
    "(s3://, gs://).",
)
frames_option = option("--frames", metavar="A:B", help="Only frames A to B - 1. Default: all.")
start_number_option = option(
    "--start-number",
    type=int,
    metavar="N",
    help="Of a pattern, the number of the first file. Default: that of its frame.",
)
targets_option = option(
    "--targets",
    type=int,
    help="Morph targets to make the animation of. Default: as many as the error needs.",
    panel=GLTF,
)
gltf_error_option = option(
    "--max-error",
    metavar="BOUND",
    help="The largest error that there may be: from the original, of a .reel that promises its "
    "own; else what morph targets or textures add. 0.1 or 0.1%: percent "
    f"{DIAGONAL_OF_ALL}; 0.5u: model units; 0.5mm: a length, see --unit.",
    panel=GLTF_AND_TEXTURES,
)
output_error_option = option(
    "--max-error",
    metavar="BOUND",
    help="Of a .reel: no vertex of any frame is farther off. Of glTF and .vat: the largest "
    f"error that morph targets or textures may add. 0.1 or 0.1%: percent {DIAGONAL_OF_ALL}; "
    "0.5u: model units; 0.5mm: a length, see --unit.",
    panel=GROUP,
)
normals_option = option(
    "--normals/--no-normals",
    default=None,
    help="Write normals for all meshes, turned by all targets; or none, so that viewers shade "
    "faces flat. Default: smooth meshes have them, turned by as many targets as bring them "
    "within some 3.5 degrees in the mean. Of a .vat: the normals of every frame (default), or "
    "none; of the layout pca as of glTF.",
    panel=GLTF_AND_TEXTURES,
)
layout_option = option(
    "--layout",
    metavar="NAME",
    completion=layout_names,
    help="Whose shaders play the textures: openvat, openvat-unity, labs (glTF's axes), "
    "labs-unity or labs-unreal; or pca, a texture of a fraction of the size, for shaders of "
    "meshreel. Default: openvat.",
    panel=TEXTURES,
)
textures_option = option(
    "--textures",
    metavar="KIND",
    completion=texture_kinds,
    help="exr: half floats, or full ones if --max-error needs them; png: 8 bits, or 16. "
    "Default: exr, which engines read as it is. Not for the layout pca.",
    panel=TEXTURES,
)
force_option = option("--force", "-f", is_flag=True, help="Replace outputs that exist.")


def checked_bound(text: str | None, unit: str | None) -> float | str | None:
    """The bound that `--max-error` and `--unit` mean together, as `WriteOptions` takes it."""
    from meshreel.codec.error_bounds import bound_of

    if text is not None:
        return bound_of(text, unit).plain
    if unit is not None:
        raise click.UsageError("--unit is the unit of a length in --max-error; give both")
    return None


def frame_slice(text: str | None) -> slice | None:
    """The slice that 'A:B', 'A:', ':B' or 'A' names."""
    if text is None:
        return None
    first, colon, last = text.partition(":")
    try:
        start = int(first) if first else None
        stop = int(last) if last else None
    except ValueError:
        raise click.UsageError(f"--frames takes A:B with whole numbers; got {text!r}") from None
    if not colon:
        if start is None:
            raise click.UsageError("--frames takes A:B; got nothing")
        return slice(start, start + 1 or None)
    return slice(start, stop)


def is_stream(output: "str | os.PathLike[str]") -> bool:
    """Whether an output is a .reel."""
    return Path(output).suffix.lower() == ".reel"


def refuse_stream_options(context: click.Context, names: Iterable[str], output: str) -> None:
    """Refuse options of these names that were given, for they choose nothing in the output."""
    for param in context.command.params:
        source = context.get_parameter_source(param.name or "")
        if param.name in names and source is not None and source.name == "COMMANDLINE":
            raise click.UsageError(
                f"{param.opts[0]} has no effect on {output}; it is for .reel outputs"
            )


def refuse_stream(output: str) -> None:
    """Refuse an output that is a stream, where frames are to be given back.

    Raises
    ------
    InvalidInputError
        Naming the command that codes them anew.
    """
    from meshreel.errors import InvalidInputError

    if is_stream(output):
        raise InvalidInputError(
            f"{output} would be coded anew, which loses more; `meshreel convert` does that, with "
            "the options of `meshreel encode`, and says how much"
        )


def known_frames(files: Sequence[Path], chosen: slice | None) -> range | None:
    """The frames that a slice names of input files that hold one each; None if others do."""
    from meshreel.formats.registry import FRAME_FORMATS
    from meshreel.model.frame_choice import frame_range

    is_frame = files[0].suffix.lower() in FRAME_FORMATS
    return frame_range(chosen, len(files)) if is_frame else None


def chosen_frames(chosen: slice | None, n_frames: int, notes: list[str]) -> range:
    """The frames that a slice names; what of it is beyond the ends is noted.

    Raises
    ------
    InvalidInputError
        If it names no frame.
    """
    from meshreel.model.frame_choice import frame_range

    found = frame_range(chosen, n_frames)
    if chosen is not None and (note := clamped_note(chosen, n_frames)):
        notes.append(note)
    return found


def clamped_note(chosen: slice, n_frames: int) -> str | None:
    """The note on a range of frames that goes beyond the ends; None if it does not."""
    from meshreel.model.frame_choice import slice_text

    ends = [end for end in (chosen.start, chosen.stop) if end is not None]
    if all(-n_frames <= end <= n_frames for end in ends):
        return None
    start, stop, _ = chosen.indices(n_frames)
    return (
        f"--frames {slice_text(chosen)} goes beyond the ends: there are frames 0:{n_frames}, and "
        f"{start}:{stop} are taken"
    )


def written_figures(
    written: list[Path], source: "AnySource", n_frames: int, target: "Output"
) -> dict[str, Any]:
    """Figures of written files, as commands print them as JSON."""
    from meshreel.model.segments import HasSegments

    segments: Sequence[Any] = [source]
    if isinstance(source, HasSegments):
        segments = [source.segment(number) for number in range(source.n_segments)]
    return {
        "outputs": [target.name(path) for path in written],
        "n_frames": n_frames,
        "n_segments": len(segments),
        "n_verts": max(one.n_verts for one in segments),
        "n_faces": max(len(one.faces) for one in segments),
        "fps": source.fps,
        "size_bytes": sum(path.stat().st_size for path in written),
    }


def print_written(figures: dict[str, Any]) -> None:
    """The same as `written_figures`, as rows of a table."""
    from meshreel.app.cli.console import print_table
    from meshreel.formats.registry import FRAME_FORMATS
    from meshreel.runtime.counting import counted, size_text

    named = figures["outputs"]
    first, last = Path(named[0]), Path(named[-1])
    title = named[0] if first == last else f"{named[0]} to {last.name}"
    if last.parent != first.parent:
        what = "frames" if last.suffix in FRAME_FORMATS else "images"
        title = f"{named[0]}, {what} in {last.parent.name}"
    print_table(
        title,
        {
            "sequence": f"{counted(figures['n_frames'], 'frame')}, "
            f"{counted(figures['n_verts'], 'vertex')}, {counted(figures['n_faces'], 'face')}",
            "files": str(len(figures["outputs"])),
            "size": size_text(figures["size_bytes"]),
        },
    )
