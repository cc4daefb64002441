"""Options that say how to encode, for every command that does."""

import re
from typing import Annotated

import typer

from meshreel.codec.config import DEFAULT_ANCHORS, DEFAULT_ENERGY
from meshreel.codec.methods import METHODS, Allocation, Laplacian, Order
from meshreel.codec.targets import DEFAULT_EFFORT, DEFAULT_QUALITY, Tune
from meshreel.codec.uv_grid import MAX_UV_BITS, MIN_UV_BITS

METHOD_NAMES = ", ".join(row.name for row in METHODS)
LAPLACIAN_NAMES = ", ".join(row.name.lower() for row in Laplacian)
ALLOCATION_NAMES = ", ".join(row.value for row in Allocation)
TUNE_NAMES = ", ".join(tune.value for tune in Tune)
TARGETS = "What to meet (give one)"
PAPER = "The paper's methods"
ORDER_NAMES = ", ".join(row.name.lower() for row in Order)

QualityOption = Annotated[
    float | None,
    typer.Option(
        help="1 to 100; every 12 points halve the error. "
        f"[default: {DEFAULT_QUALITY:g}, if nothing else is asked for]",
        show_default=False,
        rich_help_panel=TARGETS,
    ),
]
MaxErrorOption = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        help="No vertex of any frame farther from the original than this share of the "
        "bounding box's diagonal. Promised.",
        rich_help_panel=TARGETS,
    ),
]
KgOption = Annotated[
    float | None,
    typer.Option(
        metavar="PERCENT",
        help="Smallest file of at most this KG error.",
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
    float | None,
    typer.Option(
        metavar="BYTES", help="Best quality within so many bytes.", rich_help_panel=TARGETS
    ),
]
StepOption = Annotated[
    float | None,
    typer.Option(
        help="Step of rounding as it acts on a position, in diagonals of the bounding box.",
        rich_help_panel=TARGETS,
    ),
]
TuneOption = Annotated[
    str | None,
    typer.Option(
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
MethodOption = Annotated[str, typer.Option(help=f"How to code: {METHOD_NAMES}.")]
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
    typer.Option(rich_help_panel=PAPER, help=f"The matrix that makes deltas: {LAPLACIAN_NAMES}."),
]
OrderOption = Annotated[
    str,
    typer.Option(
        help=f"What to keep of the order of vertices and faces: {ORDER_NAMES}. "
        "keep: both; vertices: of the vertices; drop: neither, for the smallest file."
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
UNITS = {"": 1, "B": 1}
UNITS |= {f"{prefix}B": 1000**power for power, prefix in enumerate("kMGT", start=1)}
UNITS |= {f"{prefix}iB": 1024**power for power, prefix in enumerate("KMGT", start=1)}


def size_bytes_of(text: str | None) -> float | None:
    """Bytes that a size such as 500MB or 1GiB means; the case of letters does not matter."""
    if text is None:
        return None
    found = re.fullmatch(r"(\d+(?:\.\d*)?)\s*([a-zA-Z]*)", text.strip())
    factors = {unit.lower(): factor for unit, factor in UNITS.items()}
    if not found or found[2].lower() not in factors:
        raise typer.BadParameter(f"--memory takes a size such as 500MB or 1GiB; got {text!r}")
    return float(found[1]) * factors[found[2].lower()]
