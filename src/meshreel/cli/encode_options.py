"""Options that say how to encode, for every command that does."""

from typing import Annotated

import typer

from meshreel.cli.completing import names_of
from meshreel.codec.choices import Laplacian, Order
from meshreel.codec.error_bounds import METRES
from meshreel.codec.methods import METHOD_NAMES
from meshreel.codec.surface.uv_grid import MAX_UV_BITS, MIN_UV_BITS
from meshreel.codec.targets import DEFAULT_QUALITY
from meshreel.paper.settings import DEFAULT_ANCHORS, DEFAULT_ENERGY
from meshreel.paper.variants import Allocation
from meshreel.reel.encoding.effort import DEFAULT_EFFORT, Tune

METHODS = ", ".join(METHOD_NAMES)
LAPLACIAN_NAMES = ", ".join(row.name.lower() for row in Laplacian)
ALLOCATION_NAMES = ", ".join(row.value for row in Allocation)
TUNE_NAMES = ", ".join(tune.value for tune in Tune)
TARGETS = "What to meet (give one)"
PAPER = "The paper's methods"
OF_ALL_FRAMES = "of the diagonal of the bounding box of all frames"
ORDER_NAMES = ", ".join(row.name.lower() for row in Order)

QualityOption = Annotated[
    float | None,
    typer.Option(
        help="1 to 100; every 12 points halve the error, which is relative to the model's "
        "size: the diagonal of a frame's bounding box, the mean of all frames. "
        f"[default: {DEFAULT_QUALITY:g}, if nothing else is asked for]",
        show_default=False,
        rich_help_panel=TARGETS,
    ),
]
MaxErrorOption = Annotated[
    str | None,
    typer.Option(
        metavar="BOUND",
        help="No vertex of any frame farther from the original than this. Promised. 0.1 or 0.1%: "
        f"percent {OF_ALL_FRAMES}; 0.5u: model units; 0.5mm: a length, see --unit.",
        rich_help_panel=TARGETS,
    ),
]
UnitOption = Annotated[
    str | None,
    typer.Option(
        metavar="|".join(METRES),
        autocompletion=names_of(METRES),
        help="How long one unit of the model is, for a --max-error that is a length.",
        rich_help_panel=TARGETS,
    ),
]
KgOption = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        help="Smallest file of at most this KG error, a share of the shape's extent.",
        rich_help_panel=TARGETS,
    ),
]
StedOption = Annotated[
    float | None,
    typer.Option(help="Smallest file of at most this STED.", rich_help_panel=TARGETS),
]
BpvfOption = Annotated[
    float | None,
    typer.Option(
        help="Best quality within so many bits for each vertex and frame.",
        rich_help_panel=TARGETS,
    ),
]
SizeOption = Annotated[
    str | None,
    typer.Option(
        metavar="SIZE",
        help="Best quality within this size, as in 100kB, 1MiB or 100000 (bytes).",
        rich_help_panel=TARGETS,
    ),
]
StepOption = Annotated[
    float | None,
    typer.Option(
        help="Step of rounding as it acts on a position, in diagonals of the bounding box of all "
        "frames.",
        rich_help_panel=TARGETS,
    ),
]
TuneOption = Annotated[
    str | None,
    typer.Option(
        autocompletion=names_of(tune.value for tune in Tune),
        help=f"What bits are spent on: {TUNE_NAMES}. visual: how the surface looks; geometry: "
        "where vertices are. [default: what the target needs, else visual]",
        show_default=False,
    ),
]
EffortOption = Annotated[
    int | None,
    typer.Option(
        help=f"1 to 9: time against size. [default: {DEFAULT_EFFORT}]", show_default=False
    ),
]
MethodOption = Annotated[
    str,
    typer.Option(autocompletion=names_of(METHOD_NAMES), help=f"How to code: {METHODS}."),
]
ModesOption = Annotated[
    int | None,
    typer.Option(
        help="Modes to keep, 1 or more: of reel at most so many, else of each axis.",
    ),
]
EnergyOption = Annotated[
    float | None,
    typer.Option(
        rich_help_panel=PAPER,
        help="Share of the shape's energy to keep, up to 1; chooses the number of modes. "
        f"[default: {DEFAULT_ENERGY}]",
        show_default=False,
    ),
]
BitsOption = Annotated[
    str | None,
    typer.Option(
        rich_help_panel=PAPER,
        metavar="N[,N...]",
        help="Bits of the largest coefficient, 2 to 24; or of each row, 0 to leave it out. "
        "[default: 9; pca: 16]",
        show_default=False,
    ),
]
AllocationOption = Annotated[
    str,
    typer.Option(
        rich_help_panel=PAPER,
        autocompletion=names_of(row.value for row in Allocation),
        help=f"How one number of bits is spread over the rows: {ALLOCATION_NAMES}.",
    ),
]
AnchorsOption = Annotated[
    float | None,
    typer.Option(
        rich_help_panel=PAPER,
        help="Share of the vertices sent as anchors, 0 to 1, where the method has them. "
        f"[default: {DEFAULT_ANCHORS}]",
        show_default=False,
    ),
]
LaplacianOption = Annotated[
    str,
    typer.Option(
        rich_help_panel=PAPER,
        autocompletion=names_of(row.name.lower() for row in Laplacian),
        help=f"The matrix that makes deltas: {LAPLACIAN_NAMES}.",
    ),
]
OrderOption = Annotated[
    str,
    typer.Option(
        autocompletion=names_of(row.name.lower() for row in Order),
        help=f"What to keep of the order of vertices and faces: {ORDER_NAMES}. "
        "keep: both; vertices: of the vertices; drop: neither, for the smallest file.",
    ),
]
BlockFramesOption = Annotated[
    int | None,
    typer.Option(
        help="Frames coded together; fewer take less memory and more bytes. Default: all, as "
        "far as memory allows (blocks: 25)."
    ),
]
MemoryOption = Annotated[
    str | None,
    typer.Option(
        metavar="SIZE",
        help="Memory that encoding may take, as in 500MB or 1GiB; blocks of frames are cut to fit, "
        "and frames stay in their files. Default: blocks of up to 67 million positions.",
    ),
]
IterationsOption = Annotated[
    int,
    typer.Option(rich_help_panel=PAPER, help="Orthogonal iterations from block to block (blocks)."),
]
UvBitsOption = Annotated[
    int | None,
    typer.Option(
        metavar="N",
        help=f"Round texture coordinates to a grid of 2^N steps to the width of a texture, N of "
        f"{MIN_UV_BITS} to {MAX_UV_BITS}; 12 is a texel of a 4096 texture. Default: exact.",
    ),
]
