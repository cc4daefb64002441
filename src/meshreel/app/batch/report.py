"""The report of a batch: a page with ratios, errors and failures."""

import math
from collections.abc import Sequence
from html import escape

from meshreel.app.batch.manifest import (
    DONE,
    FAILED,
    MADE_BY,
    MANIFEST_NAME,
    Manifest,
    Record,
    summary_of,
)
from meshreel.app.batch.out_folder import OutFolder
from meshreel.errors import InvalidInputError
from meshreel.rendering.documents import (
    NONE,
    Bullets,
    Drawing,
    Heading,
    Paragraph,
    Part,
    Table,
    significant,
    to_html,
)
from meshreel.runtime.counting import counted, size_text

REPORT_NAME = "report.html"

N_LISTED = 10
"""Number of inputs in the lists of extremes."""

WIDTH, HEIGHT = 760, 330
LEFT, RIGHT, TOP, BOTTOM = 58, 30, 12, 34
"""Size of the diagram and its margins, in pixels."""

LEGIBLE_WIDTH = 560
"""Width in pixels below which the diagram scrolls, for its text would be illegible."""

BLUE, RED, GREY = "#2f6f9f", "#b3402a", "#c9ced8"

Named = tuple[str, Record]


def check_report(folder: OutFolder, *, force: bool) -> None:
    """Refuse a folder in which another file has the report's name, unless `force`."""
    if force or not folder.has(REPORT_NAME):
        return
    if f'content="{MADE_BY}"'.encode() not in folder.read(REPORT_NAME)[:1000]:
        raise InvalidInputError(
            f"{folder.called(REPORT_NAME)} is not a report of {MADE_BY}; move it away, name "
            "another folder for the outputs, or use --force"
        )


def write_report(manifest: Manifest) -> None:
    """Write the page atomically, next to the manifest."""
    page = to_html(report_parts(manifest), f"Batch of {manifest.input_dir}", MADE_BY)
    manifest.folder.write(REPORT_NAME, page.encode(), overwrite=True)


def report_parts(manifest: Manifest) -> list[Part | Drawing]:
    """The parts of the page, most important first."""
    records = list(manifest.records.items())
    done = [(name, one) for name, one in records if one.state == DONE]
    failed = [(name, one) for name, one in records if one.state == FAILED]
    parts: list[Part | Drawing] = [
        Heading(1, f"Batch of {manifest.input_dir}"),
        Paragraph(f"By `{MADE_BY}`; the figures are those of `{MANIFEST_NAME}`."),
        _outcomes(records),
        _summary(records),
    ]
    if failed:
        parts += [
            Heading(2, f"{counted(len(failed), 'failure')}"),
            Bullets(tuple(f"**{name}**: {one.error}" for name, one in failed)),
        ]
    if done:
        by_ratio = sorted(done, key=lambda one: one[1].ratio or 0.0)
        by_error = sorted(done, key=lambda one: -(one[1].max_error_percent or 0.0))
        parts += [
            Heading(2, "Ratio and error"),
            _scatter(done),
            _listed("Least compressed", by_ratio[:N_LISTED]),
            _listed("Largest errors", by_error[:N_LISTED]),
        ]
    noted = [(name, note) for name, one in done for note in one.notes]
    if noted:
        parts += [
            Heading(2, "Notes"),
            Bullets(tuple(f"**{name}**: {note}" for name, note in noted)),
        ]
    if done:
        parts += [Heading(2, "All encoded inputs"), _listed("", done)]
    return parts


def _summary(records: Sequence[Named]) -> Table:
    found = summary_of(one for _, one in records)
    rows = {
        "encoded": str(found.done),
        "failed": str(found.failed),
        "not started, or stopped": str(found.pending),
        "raw": size_text(found.raw_size_bytes),
        "streams": size_text(found.size_bytes),
        "smaller": _times(found.ratio),
        "largest KG error": _percent(found.kg_error_percent),
        "largest vertex error, of the diagonal": _percent(found.max_error_percent),
        "seconds of all workers": significant(sum(one.seconds or 0.0 for _, one in records)),
    }
    return Table("", ("all", ""), tuple(rows.items()))


def _listed(title: str, records: Sequence[Named]) -> Table:
    header = ("input", "raw", "stream", "smaller", "KG error", "largest error", "s")
    rows = tuple(
        (
            f"`{name}`",
            size_text(one.raw_size_bytes or 0),
            size_text(one.size_bytes or 0),
            _times(one.ratio),
            _percent(one.kg_error_percent),
            _percent(one.max_error_percent),
            significant(one.seconds),
        )
        for name, one in records
    )
    return Table(title, header, rows)


def _times(ratio: float | None) -> str:
    return NONE if ratio is None else f"{ratio:.1f} x"


def _percent(error: float | None) -> str:
    return NONE if error is None else f"{significant(error)} %"


def _outcomes(records: Sequence[Named]) -> Drawing:
    """A bar with the shares of done, failed and pending inputs."""
    found = summary_of(one for _, one in records)
    shares = [(found.done, BLUE, "encoded"), (found.failed, RED, "failed"),
              (found.pending, GREY, "not done")]  # fmt: skip
    x, bars = 0.0, []
    for number, color, word in shares:
        # A minimum width, so that one failure among thousands is visible.
        width = max(4.0, WIDTH * number / max(1, len(records))) if number else 0.0
        bars.append(
            f'<rect x="{x:.1f}" width="{width:.1f}" height="22" fill="{color}">'
            f"<title>{number} {word}</title></rect>"
        )
        x += width
    svg = f'<svg viewBox="0 0 {x:.1f} 22" width="{WIDTH}" height="22">{"".join(bars)}</svg>'
    words = ", ".join(f"{number} {word}" for number, _, word in shares)
    return Drawing(svg, counted(len(records), "input"), words)


def _scatter(done: Sequence[Named]) -> Drawing:
    """A point for each input: its KG error and its ratio, on logarithmic axes."""
    points = [
        (max(one.kg_error_percent or 0.0, 1e-6), one.ratio or 1.0, name) for name, one in done
    ]
    low, high = _decades([error for error, _, _ in points])
    least, most = _decades([ratio for _, ratio, _ in points])

    def x(error: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (math.log10(error) - low) / (high - low)

    def y(ratio: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (1 - (math.log10(ratio) - least) / (most - least))

    lines = [
        f'<path d="M{x(10.0**one):.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="#e4e7ec"/>'
        f'<text x="{x(10.0**one):.1f}" y="{HEIGHT - 12}" text-anchor="middle">'
        f"{10.0**one:g} %</text>"
        for one in range(low, high + 1)
    ] + [
        f'<path d="M{LEFT} {y(10.0**one):.1f}H{WIDTH - RIGHT}" stroke="#e4e7ec"/>'
        f'<text x="{LEFT - 6}" y="{y(10.0**one) + 4:.1f}" text-anchor="end">{10.0**one:g} x</text>'
        for one in range(least, most + 1)
    ]
    dots = [
        f'<circle cx="{x(error):.1f}" cy="{y(ratio):.1f}" r="3.5" fill="{BLUE}" '
        f'fill-opacity="0.45"><title>{escape(name)}: {ratio:.1f} x, {error:.3g} %</title></circle>'
        for error, ratio, name in points
    ]
    svg = (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'style="min-width: {LEGIBLE_WIDTH}px" font-size="12" fill="#5c6370">'
        f"{''.join(lines)}{''.join(dots)}</svg>"
    )
    caption = "Vertical: compression ratio to float32. Horizontal: KG error. Hover for names."
    return Drawing(svg, "All encoded inputs", caption)


def _decades(values: Sequence[float]) -> tuple[int, int]:
    """Exponents of the powers of ten that enclose positive values; at least one decade apart."""
    low, high = math.floor(math.log10(min(values))), math.ceil(math.log10(max(values)))
    return low, max(high, low + 1)
