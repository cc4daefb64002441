"""Options of methods that round: how many modes there are, how near texture coordinates come."""

from meshreel.codec.option import COUNT, Option, Range

UV_BITS_RANGE = Range(4, 24, is_whole=True)
"""A float32 of up to 1 holds every number of a grid of 24 bits."""

N_MODES = Option(
    "n_modes",
    int,
    "Modes to keep, 1 or more: of reel at most so many, else of each axis.",
    range=COUNT,
    flag="--modes",
    more="Those of an axis are eigen-trajectories (the paper's k_l); at most as many as a "
    "block has frames are used. Excludes `energy`. With `gft`, graph frequencies; default 5 % "
    "of the vertices.",
)
UV_BITS = Option(
    "uv_bits",
    int,
    "Round texture coordinates to a grid of 2^N steps to the width of a texture, N of "
    f"{UV_BITS_RANGE.words}; 12 is a texel of a 4096 texture. Default: exact.",
    range=UV_BITS_RANGE,
    metavar="N",
)

ROUNDING = (N_MODES, UV_BITS)
