"""Draw the picture of the paper's method in docs/paper.md: Fig. 1, with our modules.

    python docs/paper_pipeline.py

Writes docs/images/paper-pipeline.png. A test checks the modules and equations in it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from meshreel.rendering.plots import blank_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Point = tuple[float, float]

# In inches, from the upper left corner.
WIDTH, HEIGHT = 10.0, 7.12
COLUMNS = 0.15, 2.55, 4.95, 7.35
STEP_WIDTH, STEP_HEIGHT = 2.1, 0.82
ENCODER, ENCODER_ROWS = (0.05, 2.95), (0.62, 1.98)
STREAM, STORED_TOP, STORED_BOTTOM = (3.15, 4.34), 3.53, 4.26
DECODER, DECODER_ROWS = (4.54, 7.07), (4.87, 6.13)
ANCHORS_X, DICTIONARY_X = 2.1, 9.78  # of arrows to the stream

ENCODER_COLOR, STREAM_COLOR, DECODER_COLOR = "#E6EFF7", "#E0EFE6", "#FBEEE0"
EDGE_COLOR, TEXT_COLOR, EQUATION_COLOR = "#5B6B7A", "#1D2A36", "#0072B2"
MAX_LETTERS = 34  # of a module on a line
MODULE_STYLE: dict[str, Any] = {"size": 7, "family": "monospace", "color": "#0F6B4F"}


@dataclass(frozen=True)
class Step:
    """A box of the diagram.

    Attributes
    ----------
    column : int
    top : float
        In inches.
    formula : str
        In the notation of Matplotlib.
    modules : tuple of str
        Files within the package.
    equations : tuple of str
        As in the first column of `docs/equations.md`.
    n_columns : int
        Number of columns that the box covers.
    """

    column: int
    top: float
    title: str
    formula: str
    modules: tuple[str, ...]
    equations: tuple[str, ...] = ()
    n_columns: int = 1

    @property
    def left(self) -> float:
        """Left edge, in inches."""
        return COLUMNS[self.column]

    @property
    def right(self) -> float:
        """Right edge, in inches."""
        return COLUMNS[self.column + self.n_columns - 1] + STEP_WIDTH

    @property
    def center(self) -> tuple[float, float]:
        """Center, in inches."""
        return (self.left + self.right) / 2, self.top + STEP_HEIGHT / 2

    @property
    def bottom(self) -> float:
        """Lower edge, in inches."""
        return self.top + STEP_HEIGHT


_L, _BASIS, _QUANTIZER = "paper/laplacian.py", "paper/basis.py", "paper/quantization.py"
_PCA, _MATRICES = "codec/subspace/pca.py", "codec/subspace/trajectories.py"
_SYSTEM = "paper/reconstruction_system.py"
_DEFINITION, _PROJECTION = ("Eq. 1", "Eq. 2", "Eq. 3"), ("Eq. 4", "Eq. 6", "Eq. 8", "Eq. 9")
_UPPER, _LOWER = ENCODER_ROWS
_DECODER_UPPER, _DECODER_LOWER = DECODER_ROWS

STEPS = {
    "A": Step(0, _UPPER, "coordinate matrix", r"$A$: $k_f$ frames, $n$ vertices", (_MATRICES,)),
    "R": Step(1, _UPPER, "autocorrelation", r"$R[i] = A A^T$", (_PCA,), ("Eq. 7",)),
    "first U": Step(2, _UPPER, "first block", r"$R[1] = U \Lambda U^T$", (_PCA,), ("Eq. 5",)),
    "next U": Step(
        3,
        _UPPER,
        "later blocks",
        r"$U \leftarrow QR(R[i]\;U)$, repeated",
        (_BASIS,),
        ("Alg. 1",),
    ),
    "anchors": Step(0, _LOWER, "anchors", r"$A^T$ at $n_c$ of $n$ vertices", ("paper/anchors.py",)),
    "L": Step(1, _LOWER, "Laplacian", r"$L = D - C$", (_L,), _DEFINITION),
    "deltas": Step(
        2, _LOWER, "projected deltas", r"$\hat{U} = U^T (L A^T)^T$", (_BASIS, _L), _PROJECTION
    ),
    "Q": Step(
        3, _LOWER, "quantization", r"$\dot{U}$: first $k_l$ rows", (_QUANTIZER,), ("Eq. 10",)
    ),
    "decoded L": Step(1, _DECODER_UPPER, "Laplacian", r"$L = D - C$", (_L,), _DEFINITION),
    "decoded deltas": Step(
        2,
        _DECODER_UPPER,
        "dequantization",
        r"$\dot{U}$: other rows are 0",
        (_QUANTIZER,),
        ("Eq. 10",),
    ),
    "decoded U": Step(
        3, _DECODER_UPPER, "dictionary", "$U[i] = U[i-1] + $ difference", ("paper/blocks.py",)
    ),
    "solution": Step(
        0,
        _DECODER_LOWER,
        "least squares with anchors",
        r"$[\,L;\;I_{n_c}]\;X = [\,\dot{U}^T;\;Q(A^T)\,]$",
        (_SYSTEM,),
        ("Eq. 11", "Eq. 12"),
        n_columns=2,
    ),
    "expansion": Step(2, _DECODER_LOWER, "expansion", r"$\tilde{A} = U X^T$", (_BASIS,)),
    "positions": Step(3, _DECODER_LOWER, "vertex positions", "of the block", (_MATRICES,)),
}
"""Boxes by name."""

_RIGHT = [left + STEP_WIDTH for left in COLUMNS]

STORED = (
    (COLUMNS[0], _RIGHT[0], "anchors", "vertices, and\npositions in all frames", "$q_a$"),
    (COLUMNS[1], _RIGHT[1], "connectivity", "once; not counted\nby the paper", ""),
    (COLUMNS[2], 7.95, "coefficients", "of each block,\nentropy-coded", "$q$"),
    (8.1, 9.9, "dictionary", "$U[1]$, then differences\n$U[i] - U[i-1]$", "$q_d$"),
)
"""Cells of the stream: left and right edge, name, contents, and letter in Eq. 13."""


def draw_pipeline(path: Path) -> None:
    """Draw encoder, stream and decoder with modules and equations, as a PNG image."""
    figure = blank_figure(WIDTH, HEIGHT)
    figure.set_layout_engine("none")
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(0, WIDTH), ylim=(HEIGHT, 0))
    axes.set_axis_off()
    _draw_lane(axes, ENCODER, ENCODER_COLOR, "Encoder")
    _write(axes, 1.05, ENCODER[0] + 0.21, "for each block $i$; $x$, $y$ and $z$ separately")
    _draw_lane(axes, STREAM, STREAM_COLOR, "Stream")
    _write(axes, 1.0, STREAM[0] + 0.21, "paper/blocks.py", **MODULE_STYLE)
    _write(axes, 5.0, STREAM[0] + 0.21, "Eq. 13: $q_s = q + q_a + q_d$")
    _draw_lane(axes, DECODER, DECODER_COLOR, "Decoder")
    _write(axes, 1.05, DECODER[0] + 0.21, "for each block $i$")
    _draw_stored(axes)
    _draw_tracking_frame(axes)
    for step in STEPS.values():
        _draw_step(axes, step)
    _draw_encoder_arrows(axes)
    _draw_decoder_arrows(axes)
    save_figure(figure, path, overwrite=True, dpi=240)


def equations_text(equations: tuple[str, ...]) -> str:
    """Short form of equations, such as "Eqs. 1-3" with a dash."""
    if len(equations) < 2:
        return "".join(equations)
    numbers = [int(name.removeprefix("Eq. ")) for name in equations]
    if len(numbers) > 2 and numbers[-1] - numbers[0] == len(numbers) - 1:
        return f"Eqs. {numbers[0]}\N{EN DASH}{numbers[-1]}"
    return f"Eqs. {', '.join(map(str, numbers))}"


def _write(axes: "Axes", x: float, y: float, text: str, **style: Any) -> None:
    """Write text that starts at a point, vertically centered unless the style differs."""
    axes.text(x, y, text, **{"size": 8.5, "color": TEXT_COLOR, "va": "center", **style})


def _draw_lane(axes: "Axes", edges: tuple[float, float], color: str, name: str) -> None:
    _draw_box(axes, 0.05, edges[0], WIDTH - 0.05, edges[1], facecolor=color, edgecolor=color)
    _write(axes, COLUMNS[0], edges[0] + 0.2, name, size=11, weight="bold")


def _draw_stored(axes: "Axes") -> None:
    for left, right, name, contents, letter in STORED:
        _draw_box(axes, left, STORED_TOP, right, STORED_BOTTOM)
        _write(axes, left + 0.1, STORED_TOP + 0.16, name, size=9, weight="bold")
        _write(axes, left + 0.1, STORED_TOP + 0.47, contents, size=8)
        _write(
            axes, right - 0.1, STORED_TOP + 0.17, letter, size=10, color=EQUATION_COLOR, ha="right"
        )


def _draw_tracking_frame(axes: "Axes") -> None:
    first, last = STEPS["first U"], STEPS["next U"]
    edges = first.left - 0.1, first.top - 0.42, last.right + 0.1, last.bottom + 0.1
    _draw_box(axes, *edges, facecolor="none", linestyle=(0, (4, 3)))
    _write(axes, first.left, first.top - 0.25, "dictionary $U[i]$, eigen-trajectories as columns")


def _draw_step(axes: "Axes", step: Step) -> None:
    """Draw a box with title, formula and modules, and its equations on the upper edge."""
    _draw_box(axes, step.left, step.top, step.right, step.bottom)
    modules = "\n".join(map(_broken, step.modules))
    middle, raised = step.center[0], 0.05 * modules.count("\n")
    _write(axes, step.left + 0.1, step.top + 0.17, step.title, size=9, weight="bold")
    _write(axes, middle, step.top + 0.43 - raised, step.formula, size=10, ha="center")
    _write(axes, middle, step.bottom - 0.05, modules, va="bottom", ha="center", **MODULE_STYLE)
    if step.equations:
        box = {"boxstyle": "round,pad=0.25", "facecolor": EQUATION_COLOR, "edgecolor": "none"}
        tag = {"size": 7.5, "color": "#FFFFFF", "ha": "right", "zorder": 4, "bbox": box}
        _write(axes, step.right - 0.1, step.top + 0.01, equations_text(step.equations), **tag)


def _broken(module: str) -> str:
    """A path that fits in a box: a long one is broken before the name of the file."""
    folder, _, name = module.rpartition("/")
    return f"{folder}/\n{name}" if len(module) > MAX_LETTERS else module


def _draw_box(
    axes: "Axes", left: float, top: float, right: float, bottom: float, **style: Any
) -> None:
    from matplotlib.patches import FancyBboxPatch

    style = {"facecolor": "#FFFFFF", "edgecolor": EDGE_COLOR, "linewidth": 0.9, **style}
    shape = "round,pad=0,rounding_size=0.06"
    axes.add_patch(FancyBboxPatch((left, top), right - left, bottom - top, boxstyle=shape, **style))


def _draw_encoder_arrows(axes: "Axes") -> None:
    coordinates, laplacian, deltas, last = (STEPS[name] for name in ("A", "L", "deltas", "next U"))
    for names, label in {
        ("A", "R"): "",
        ("R", "first U"): "",
        ("first U", "next U"): "$U[1]$",
    }.items():
        _arrow_right(axes, *names, label)
    start, end, above = last.right - 0.8, last.left + 0.45, last.top - 0.2
    _arrow(axes, [(start, last.top), (start, above), (end, above), (end, last.top)], "$U[i-1]$")
    x = coordinates.left + 0.6
    _arrow_down(axes, x, coordinates.bottom, x, deltas.top)
    _arrow_down(
        axes, coordinates.right - 0.5, coordinates.bottom, deltas.left + 0.4, deltas.top, "$A$"
    )
    x = deltas.left + 1.0
    _arrow_down(axes, x, last.bottom + 0.1, x, deltas.top, "$U[i]$")
    _arrow_right(axes, "L", "deltas", "$L$")
    _arrow_right(axes, "deltas", "Q", r"$\hat{U}$")
    stored_from = {ANCHORS_X: "", laplacian.center[0]: "faces", last.left + 0.3: ""}
    for x, label in stored_from.items():
        _arrow_down(axes, x, deltas.bottom, x, STORED_TOP, label)
    row = last.center[1]
    _arrow(axes, [(last.right + 0.1, row), (DICTIONARY_X, row), (DICTIONARY_X, STORED_TOP)])


def _draw_decoder_arrows(axes: "Axes") -> None:
    laplacian, deltas, dictionary = (STEPS[f"decoded {name}"] for name in ("L", "deltas", "U"))
    solution, expansion = STEPS["solution"], STEPS["expansion"]
    _arrow_down(axes, ANCHORS_X, STORED_BOTTOM, ANCHORS_X, solution.top, "$Q(A^T)$")
    for x in (laplacian.center[0], deltas.center[0], dictionary.center[0] + 0.5):
        _arrow_down(axes, x, STORED_BOTTOM, x, dictionary.top)
    x = laplacian.left + 0.4
    _arrow_down(axes, x, laplacian.bottom, x, solution.top, "$L$")
    x = laplacian.center[0]
    _arrow_down(axes, deltas.left + 0.5, deltas.bottom, x, solution.top, r"$\dot{U}$")
    x = expansion.right - 0.4
    _arrow_down(axes, dictionary.left + 0.5, dictionary.bottom, x, expansion.top, "$U[i]$")
    _arrow_right(axes, "solution", "expansion", "$X$")
    _arrow_right(axes, "expansion", "positions", r"$\tilde{A}$")


def _arrow_right(axes: "Axes", start: str, end: str, label: str = "") -> None:
    """Draw an arrow between two neighboring steps."""
    row = STEPS[start].center[1]
    _arrow(axes, [(STEPS[start].right, row), (STEPS[end].left, row)], label)


def _arrow_down(
    axes: "Axes", x: float, y: float, end_x: float, end_y: float, label: str = ""
) -> None:
    """Draw an arrow down, half way sideways if necessary."""
    middle = (y + end_y) / 2
    is_straight = x == end_x
    sideways = [] if is_straight else [(x, middle), (end_x, middle)]
    _arrow(axes, [(x, y), *sideways, (end_x, end_y)], label)


def _arrow(axes: "Axes", points: Sequence[Point], label: str = "") -> None:
    """Draw a polyline with a head, and a label at the middle of its longest part."""
    *line, end = points
    axes.plot(*zip(*line, strict=True), color=EDGE_COLOR, lw=1.1)
    head = {"arrowstyle": "-|>", "color": EDGE_COLOR, "lw": 1.1, "shrinkA": 0, "shrinkB": 0}
    axes.annotate("", end, line[-1], arrowprops=head)
    start, end = max(pairwise(points), key=lambda part: math.dist(*part))
    x, y = (start[0] + end[0]) / 2, (start[1] + end[1]) / 2
    if start[0] == end[0]:
        _write(axes, x + 0.06, y, label)
    else:
        _write(axes, x, y - 0.04, label, ha="center", va="bottom")


if __name__ == "__main__":
    draw_pipeline(Path(__file__).parent / "images" / "paper-pipeline.png")
