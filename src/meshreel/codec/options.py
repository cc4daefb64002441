"""All options of encoding: those that every method takes, and those of the methods' own rooms.

The command line and the site read these rows. Fields of `EncoderConfig` and the signature of
`encode` are in their source; `python docs/option_texts.py --write` writes them from the rows.
"""

from collections.abc import Iterable
from difflib import get_close_matches
from functools import cache

from meshreel.codec.choices import Order
from meshreel.codec.methods import METHOD_NAMES, own_options
from meshreel.codec.option import COUNT, Option, Range
from meshreel.errors import InvalidInputError

DEFAULT_METHOD = "reel"
LOSSLESS_METHOD = "lossless"
DEFAULT_ORDER = "keep"

SHARED = (
    Option(
        "method",
        str,
        "How to code.",
        default=DEFAULT_METHOD,
        names=METHOD_NAMES,
        more="`reel`: our own, several times smaller than the others, which are variants of the "
        "paper. `pca-qp`: deltas on the eigen-trajectories of each axis, least squares with "
        "anchors. `pca`, `pca-q`: without anchors, the first at 16 bits. `v2v`: vertices instead "
        "of deltas. `pca-qs`: as `pca-qp`, decoded one frame after another. `blocks`: "
        "eigen-trajectories of short blocks, tracked. `gft`: each frame's deltas on the low "
        "frequencies of the graph. `lossless`: every bit comes back. `grid`: positions are rounded "
        "to a grid that keeps max_error=, and coded as `lossless` does.",
    ),
    Option(
        "order",
        str,
        "What to keep of the order of vertices and faces. keep: both; vertices: of the vertices; "
        "drop: neither, for the smallest file.",
        default=DEFAULT_ORDER,
        names=tuple(order.name.lower() for order in Order),
    ),
    Option(
        "block_frames",
        int,
        "Frames coded together; fewer take less memory and more bytes. Default: all, as far as "
        "memory allows; of more than 1024 and 8 million "
        "positions, up to 512 (blocks: 25).",
        range=COUNT,
    ),
    Option(
        "memory",
        float | str,
        "Memory that encoding may take, as in 500MB or 1GiB; blocks of frames are cut to fit, and "
        "frames stay in their files. Default: blocks of up to 268 million positions.",
        range=Range(0, is_open=True),
        unit="in bytes",
        metavar="SIZE",
        more="This program counts, too. Blocks of the default size take some 6 GB. Those of "
        "`lossless` and `grid` are of up to 4 million positions, or 64 frames.",
    ),
)
"""Options that every method takes."""


@cache
def all_options() -> tuple[Option, ...]:
    """Every option: those of the default method first, then the shared, then those of others."""
    rows = [*own_options(DEFAULT_METHOD), *SHARED]
    for name in METHOD_NAMES:
        rows += [row for row in own_options(name) if row not in rows]
    return tuple(rows)


def options_of(method: str) -> tuple[Option, ...]:
    """The options that a method of `METHOD_NAMES` takes."""
    return tuple(row for row in all_options() if row in (*SHARED, *own_options(method)))


@cache
def methods_taking(option: Option) -> tuple[str, ...]:
    """Names of the methods that take an option."""
    return tuple(name for name in METHOD_NAMES if option in options_of(name))


def check_names(names: Iterable[str], known: Iterable[str]) -> None:
    """Nothing if there are options of these names.

    Parameters
    ----------
    names, known : iterable of str
        What was given, and what there is.

    Raises
    ------
    InvalidInputError
        If one is not there; names the nearest that is, or all if none is near.
    """
    allowed = list(known)
    for name in names:
        if name not in allowed:
            near = get_close_matches(name, allowed, 1)
            advice = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(allowed)}"
            raise InvalidInputError(f"option {name!r} is unknown; {advice}")
