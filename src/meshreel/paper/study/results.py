"""Results of one sequence, for tables, figures and findings."""

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from meshreel.paper.sweeps import Setting
from meshreel.runtime.counting import counted, duration_text, size_text
from meshreel.studies.rate_distortion import Point
from meshreel.studies.runs import Result, usable

RATE, ENTROPY_RATE = "rate_order_dropped_bpvf", "rate_order_dropped_entropy_bpvf"
"""Figures of a result: the rate of the file without order, and the same if coefficients took their
zero-order entropy."""

ERRORS = {
    "KG": "quality.kg_error_percent",
    "STED": "quality.sted",
    "NMSVE": "quality.nmsve_mean",
}
"""The compared errors: keys of a result, separated by dots, by name."""

MAX_KG_PERCENT = 30.0
"""Streams with a larger KG error are not compared: STED, a deviation of relative edge lengths, is
nearly 0 where few graph frequencies collapse components to points.
"""


@dataclass(frozen=True)
class RateSweep:
    """The points of a rate-distortion curve."""

    label: str
    """That of its settings with the anchors and blocks of the tables."""
    results: list[Result]
    """In the order of their runs, also refused ones."""
    moved_percent: float | None
    """By how much the last round moved the envelope of the error that moved most; None if the sweep
    was cut short.
    """
    window: tuple[float, float] = (0.0, math.inf)
    """Rates of the points that were refined."""

    @property
    def text(self) -> str:
        """The number of points, and how far they are from settled."""
        moved = self.moved_percent
        settled = "cut short" if moved is None else f"the last round moved it {moved:.1f} %"
        return f"`{self.label}` {counted(len(usable(self.results)), 'point')} ({settled})"


@dataclass(frozen=True)
class PaperResults:
    """All measurements of one sequence."""

    slug: str
    """Prefix of the names of its figures."""
    sequence: dict[str, Any]
    """Name, shape and hash."""
    variants: list[Result] = field(default_factory=list)
    rows: list[Result] = field(default_factory=list)
    """For the tables, and for Fig. 3."""
    sweeps: list[RateSweep] = field(default_factory=list)
    """Rate-distortion curves, one for each label."""
    alternatives: list[Result] = field(default_factory=list)
    """Variants that change one choice that the paper leaves open."""
    claims: dict[str, Result] = field(default_factory=dict)
    """Finished runs in `claims`: "sparsity", "dictionaries", "quiet blocks",
    "long sequence".
    """
    decompositions: Result | None = None
    """Result or None. Seconds of an eigen-decomposition with the frequencies of `gft`, if it was
    run.
    """
    full_decomposition: Result | None = None
    """Result or None. Seconds and memory of one with all frequencies, if `gft` was run; or its
    refusal.
    """
    is_quick: bool = False
    """Whether the study was a quick one, whose sweeps do not settle."""

    @property
    def name(self) -> str:
        """The name of the sequence in tables and figures."""
        return str(self.sequence["name"]) or self.slug

    @property
    def measured(self) -> list[Result]:
        """The variants, which record their machine."""
        return self.variants

    @property
    def full_basis(self) -> Result | None:
        """The full decomposition, unless it was refused or not run."""
        full = self.full_decomposition
        return None if full is None or "refused" in full else full

    def as_dict(self) -> dict[str, Any]:
        """The sequence and the values of its tables, in plain types."""
        return {
            **self.sequence,
            "variants": [summary(result) for result in self.variants],
            "alternatives": [summary(result) for result in self.alternatives],
            "sweeps": [
                {
                    "label": sweep.label,
                    "n_points": len(usable(sweep.results)),
                    "moved_percent": sweep.moved_percent,
                }
                for sweep in self.sweeps
            ],
        }

    def variant(self, label: str) -> Result | None:
        """The variant or alternative with this label; None if it was not run or failed."""
        results = usable([*self.variants, *self.alternatives])
        return next((result for result in results if label_of_result(result) == label), None)

    def points(self, figure: str, rate: str = RATE) -> dict[str, list[Point]]:
        """Points (rate, error) of each sweep within its window, by ascending rate.

        Parameters
        ----------
        figure : str
            As for `value_of`.
        """
        curves = {}
        for sweep in self.sweeps:
            low, high = sweep.window
            found = [each for each in comparable(sweep.results) if low <= each[RATE] <= high]
            pairs = [(each[rate], value_of(each, figure)) for each in found]
            curves[sweep.label] = sorted(pair for pair in pairs if math.isfinite(pair[1]))
        return {label: points for label, points in curves.items() if points}

    def sweep_text(self, *labels: str) -> str:
        """The sweeps with these labels as a sentence."""
        texts = [sweep.text for sweep in self.sweeps if sweep.label in labels]
        return f"Sweeps: {', '.join(texts)}." if texts else ""


@dataclass(frozen=True)
class FullBasis:
    """Cost of `gft` with all frequencies and a decomposition for each frame, as in the paper."""

    n_verts: int
    n_frames: int
    """Size of the sequence."""
    seconds_each: float
    processor_seconds_each: float
    """Of one decomposition."""
    memory_bytes: float
    source: str
    """The measurement from which it is extrapolated."""

    @property
    def seconds(self) -> float:
        """Wall-clock seconds of the decompositions of all frames."""
        return self.n_frames * self.seconds_each

    @property
    def processor_seconds(self) -> float:
        """Processor seconds of the decompositions of all frames."""
        return self.n_frames * self.processor_seconds_each

    @property
    def text(self) -> str:
        """The cost as a sentence that calls it an extrapolation."""
        return (
            f"Extrapolated from {self.source}: {self.n_verts:,} vertices take "
            f"{duration_text(self.seconds_each)} and {size_text(self.memory_bytes)} for one "
            f"decomposition, {duration_text(self.seconds)} with one for each of {self.n_frames:,} "
            "frames."
        )


def extrapolated_basis(measured: Result, n_verts: int, n_frames: int) -> FullBasis:
    """Extrapolate the result of a full decomposition to other numbers of vertices and frames.

    The time of one decomposition is proportional to V^3, its memory to V^2.
    """
    ratio = n_verts / measured["n_verts"]
    source = f"one decomposition of {measured['n_verts']:,} vertices, {measured['seconds']:.3g} s"
    return FullBasis(
        n_verts,
        n_frames,
        measured["seconds"] * ratio**3,
        measured["processor_seconds"] * ratio**3,
        measured["memory_bytes"] * ratio**2,
        source if ratio == 1 else f"{source}, with V^3",
    )


def comparable(results: Iterable[Result]) -> list[Result]:
    """The results of streams that keep the shape."""
    return [each for each in usable(results) if value_of(each, "KG") <= MAX_KG_PERCENT]


def value_of(result: Result, keys: str) -> float:
    """A figure of a result, by its name in `ERRORS` or its keys; infinite if it is not finite."""
    value: Any = result
    for key in ERRORS.get(keys, keys).split("."):
        value = value[key]
    return float("inf") if value is None else float(value)


def method_of_result(result: Result) -> str:
    """The method of a result."""
    return str(result["identity"]["setting"]["method"])


def label_of_result(result: Result) -> str:
    """The label of a result in tables and figures."""
    return setting_of_result(result).label


def setting_of_result(result: Result) -> Setting:
    """The setting of a result."""
    names = {each.name for each in fields(Setting)}
    setting = result["identity"]["setting"]
    return Setting(**{name: setting[name] for name in setting if name in names})


def summary(result: Result) -> dict[str, Any]:
    """The setting of a result and its values in tables."""
    setting = {"label": label_of_result(result), **asdict(setting_of_result(result))}
    if "refused" in result:
        return {**setting, "refused": result["refused"]}
    seconds = {
        f"{part}_s": result["seconds"][part]
        for part in ("encode", "decode", "encode_processor", "decode_processor")
    }
    quality = {name: value for name, value in result["quality"].items() if name != "nmsve"}
    rates = {name: result[name] for name in ("rates", "rate_bpvf", RATE)}
    return {**setting, **rates, **seconds, **quality}
