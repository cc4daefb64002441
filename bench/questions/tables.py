"""Answers to the open questions of the paper as tables."""

from collections.abc import Sequence

from meshreel.paper.sweeps import BITS, MODES
from meshreel.rendering.documents import NONE, Table
from questions.answers import RATES, Answer, shown_knee
from questions.search import BLOCK_COUNTS, ERRORS

Answers = Sequence[tuple[str, Answer]]
"""Names of sequences and their answers to one question."""


def rows_table(answers: Answers) -> Table:
    """Question 1: the best rows and bits by rate."""
    header = (
        "sequence", "error", *(f"rows x bits at {rate:g} bpvf" for rate in RATES),
        "exponent of rows over rate", "knee over the rate", f"knee over the rows at {BITS} bits",
        f"{MODES} rows, {BITS} bits: rate", f"{MODES} rows, best bits: rate",
        f"{BITS} bits, best rows: rate",
    )  # fmt: skip
    rows = [
        (
            name,
            label,
            *(
                NONE if best is None else f"{best['modes']} x {best['bits']}"
                for best in one["best"]
            ),
            NONE if one["growth"] is None else f"{one['growth']:.2f}",
            _knee_text(one["knee"], "{rate_bpvf:.2f} bpvf, {modes} rows"),
            _knee_text(one["row_knee"], "{modes} rows"),
            *(_percent(one[part]) for part in ("table", "table_rows", "table_bits")),
        )
        for name, answer in answers
        for label, one in zip(("KG", "STED"), (answer[error] for error in ERRORS), strict=True)
    ]
    return Table("The ideal number of rows", header, tuple(rows))


def _knee_text(found: Answer | None, text: str) -> str:
    if found is None:
        return NONE
    words = text.format(**found) if shown_knee(found) else "none"
    return f"{words} ({found['distance']:.2f})"


def _percent(value: float | None) -> str:
    return NONE if value is None else f"{value:+.1f} %"


def blocks_table(answers: Answers) -> Table:
    """Question 2: BD-rates by number of blocks."""
    counts = BLOCK_COUNTS[1:]
    header = ("sequence", "best", *(f"{n} blocks" for n in counts), "blocks of about 25 frames")
    rows = [
        (
            name,
            NONE if answer["best"] is None else str(answer["best"]),
            *(_percent(answer["rates"].get(str(n))) for n in counts),
            f"{_percent(answer['rates'].get(str(answer['usual'])))} ({answer['usual']})",
        )
        for name, answer in answers
    ]
    return Table("The ideal number of blocks", header, tuple(rows))
