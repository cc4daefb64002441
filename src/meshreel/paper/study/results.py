"""Results of one sequence, for tables, figures and findings."""

from dataclasses import asdict, dataclass, field
from typing import Any

from meshreel.evaluation.rate_distortion import Overlap, Point, compare_at_equal_rate
from meshreel.evaluation.runs.store import Result, done
from meshreel.paper.sweeps import ANCHORS, COEFFICIENTS, Setting


@dataclass(frozen=True)
class PaperResults:
    """All measurements of one sequence.

    Attributes
    ----------
    slug : str
        Prefix of the names of its figures.
    sequence : dict
        Name, shape and hash.
    variants, rows, sweep : list of results
        For the tables, for Fig. 3, and for the rate-distortion plots.
    alternatives : list of results
        Variants that change one choice that the paper leaves open.
    claims : dict of str to result
        Results of the runs in `claims`: "dictionaries", "quiet blocks", "long sequence".
    decompositions : result or None
        Seconds of an eigen-decomposition, if `gft` was run.
    """

    slug: str
    sequence: dict[str, Any]
    variants: list[Result] = field(default_factory=list)
    rows: list[Result] = field(default_factory=list)
    sweep: list[Result] = field(default_factory=list)
    alternatives: list[Result] = field(default_factory=list)
    claims: dict[str, Result] = field(default_factory=dict)
    decompositions: Result | None = None

    @property
    def name(self) -> str:
        """The name of the sequence in tables and figures."""
        return str(self.sequence["name"]) or self.slug

    def as_dict(self) -> dict[str, Any]:
        """The sequence and the values of its tables, in plain types."""
        return {
            **self.sequence,
            "variants": [summary(result) for result in self.variants],
            "alternatives": [summary(result) for result in self.alternatives],
        }

    def variant(self, label: str) -> Result | None:
        """The variant or alternative with this label; None if it was not run or failed."""
        results = done([*self.variants, *self.alternatives])
        return next((result for result in results if label_of_result(result) == label), None)

    def points(self, figure: str) -> dict[str, list[Point]]:
        """Points (rate without order, error) by label, by ascending rate.

        Excludes variants with non-default anchors, choices other than coefficients of anchors, and
        `pca-qs`, which has the quality of `pca-qp`.
        """
        curves: dict[str, set[Point]] = {}
        for result in done([*self.sweep, *self.variants, *self.rows]):
            setting, error = setting_of_result(result), result["quality"][figure]
            is_default = setting.anchors in (0, ANCHORS) and setting.choices in ("", COEFFICIENTS)
            if error is not None and is_default and setting.method != "pca-qs":
                points = curves.setdefault(setting.label, set())
                points.add((result["rate_order_dropped_bpvf"], error))
        return {label: sorted(points) for label, points in curves.items()}

    def at_equal_rate(self, figure: str, label: str, other: str) -> Overlap | None:
        """Errors of a variant relative to another at equal rate; None without common rates."""
        points = self.points(figure)
        return compare_at_equal_rate(points.get(label, []), points.get(other, []))


def method_of_result(result: Result) -> str:
    """The method of a result."""
    return str(result["identity"]["setting"]["method"])


def label_of_result(result: Result) -> str:
    """The label of a result in tables and figures."""
    return setting_of_result(result).label


def setting_of_result(result: Result) -> Setting:
    """The setting of a result."""
    return Setting(**result["identity"]["setting"])


def summary(result: Result) -> dict[str, Any]:
    """The setting of a result and its values in tables."""
    setting = {"label": label_of_result(result), **asdict(setting_of_result(result))}
    if "refused" in result:
        return {**setting, "refused": result["refused"]}
    return {
        **setting,
        "rates": result["rates"],
        "rate_bpvf": result["rate_bpvf"],
        "rate_order_dropped_bpvf": result["rate_order_dropped_bpvf"],
        "encode_s": result["seconds"]["encode"],
        "decode_s": result["seconds"]["decode"],
        "encode_processor_s": result["seconds"]["encode_processor"],
        "decode_processor_s": result["seconds"]["decode_processor"],
        **{name: value for name, value in result["quality"].items() if name != "nmsve"},
    }
