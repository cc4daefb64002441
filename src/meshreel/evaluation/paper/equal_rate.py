"""Methods compared where both have streams of the same rate."""

from meshreel.evaluation.paper.results import PaperResults
from meshreel.evaluation.rate_distortion import compare_at_equal_rate

FIGURES = (("kg_error_percent", "KG"), ("sted", "STED"), ("nmsve_mean", "NMSVE"))
"""Errors that are compared, and their names."""


def error_ratio(results: PaperResults, figure: str, method: str, other: str) -> float | None:
    """Error of a method by that of another at equal rate; None where no rate is common."""
    points = results.points(figure)
    overlap = compare_at_equal_rate(points.get(method, []), points.get(other, []))
    return None if overlap is None else overlap.error_ratio


def ratios_text(results: PaperResults, method: str, other: str) -> str:
    """Error ratios with the rates they are over, by figure; says where no rate is common."""
    found: list[str] = []
    for figure, name in FIGURES:
        points = results.points(figure)
        overlap = compare_at_equal_rate(points.get(method, []), points.get(other, []))
        if overlap is None:
            found.append(f"{name} has no rates in common")
            continue
        rates = f"{overlap.low_bpvf:.2g} to {overlap.high_bpvf:.2g} bpvf"
        found.append(f"{name} {overlap.error_ratio:.2f} ({rates})")
    if all("no rates" in text for text in found):
        return "no rates in common, not compared"
    return ", ".join(found)
