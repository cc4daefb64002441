"""Options that say what to take of an input, the same in every command that reads one."""

from pathlib import Path
from typing import Annotated

import typer

READING = "Input"

FpsOption = Annotated[
    float | None,
    typer.Option(help="Frames per second. Default: what the input says.", rich_help_panel=READING),
]
ObjectOption = Annotated[
    str | None,
    typer.Option(
        metavar="PATH",
        help="The one mesh to take of a file that holds several (all are listed if none is "
        "chosen).",
        rich_help_panel=READING,
    ),
]
MergeOption = Annotated[
    bool,
    typer.Option(
        "--merge",
        help="Take all meshes of a file as one; they are told apart again on the way out.",
        rich_help_panel=READING,
    ),
]
SkipBadOption = Annotated[
    bool,
    typer.Option(
        "--skip-bad",
        help="Leave out meshes of a file that cannot be read, and take the others.",
        rich_help_panel=READING,
    ),
]
AllowOutsideOption = Annotated[
    bool,
    typer.Option(
        "--allow-outside",
        help="Read files that a file names outside of its folder: USD layers, glTF buffers, "
        "files of a .pvd or .xdmf.",
        rich_help_panel=READING,
    ),
]
TopologyOption = Annotated[
    Path | None,
    typer.Option(
        metavar="MESH",
        help="A mesh file with the faces of a point cache (.pc2, .mdd). Default: the mesh of the "
        "same name beside it.",
        rich_help_panel=READING,
    ),
]
DatasetOption = Annotated[
    str | None,
    typer.Option(
        metavar="NAME",
        help="The dataset with the positions (.h5, .npz). Default: vertices.",
        rich_help_panel=READING,
    ),
]
AttributesOption = Annotated[
    str,
    typer.Option(
        metavar="all|none|NAME,...",
        help="Attributes and groups to take, by name or kind: uv, color, material, ... Polygons "
        "and parts are always taken.",
        rich_help_panel=READING,
    ),
]
SplitOption = Annotated[
    bool,
    typer.Option(
        "--split",
        help="Where the faces change within the sequence, write a file for each stretch of "
        "frames that keeps them.",
        rich_help_panel=READING,
    ),
]
