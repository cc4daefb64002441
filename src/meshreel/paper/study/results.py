"""Results of one sequence, for tables, figures and findings."""

from dataclasses import asdict, dataclass, field
from typing import Any

from meshreel.paper.sweeps import ANCHORS, COEFFICIENTS, Setting
from meshreel.runtime.counting import duration_text, size_text
from meshreel.studies.rate_distortion import Point
from meshreel.studies.runs import Result, usable

RATE, ENTROPY_RATE = "rate_order_dropped_bpvf", "rate_order_dropped_entropy_bpvf"
"""Figures of a result: the rate of the file without order, and the same if coefficients took their
zero-order entropy."""


@dataclass(frozen=True)
class PaperResults:
    """All measurements of one sequence."""

    slug: str
    """Prefix of the names of its figures."""
    sequence: dict[str, Any]
    """Name, shape and hash."""
    variants: list[Result] = field(default_factory=list)
    rows: list[Result] = field(default_factory=list)
    sweep: list[Result] = field(default_factory=list)
    """For the tables, for Fig. 3, and for the rate-distortion plots."""
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
        }

    def variant(self, label: str) -> Result | None:
        """The variant or alternative with this label; None if it was not run or failed."""
        results = usable([*self.variants, *self.alternatives])
        return next((result for result in results if label_of_result(result) == label), None)

    def points(self, figure: str, rate: str = RATE) -> dict[str, list[Point]]:
        """Points (rate without order, error) by label, by ascending rate.

        Excludes variants with non-default anchors, choices other than coefficients of anchors, and
        `pca-qs`, which has the quality of `pca-qp`.
        """
        curves: dict[str, set[Point]] = {}
        for result in usable([*self.sweep, *self.variants, *self.rows]):
            setting, error = setting_of_result(result), result["quality"][figure]
            is_default = setting.anchors in (0, ANCHORS) and setting.choices in ("", COEFFICIENTS)
            if error is not None and is_default and setting.method != "pca-qs":
                curves.setdefault(setting.label, set()).add((result[rate], error))
        return {label: sorted(points) for label, points in curves.items()}


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
    seconds = {
        f"{part}_s": result["seconds"][part]
        for part in ("encode", "decode", "encode_processor", "decode_processor")
    }
    quality = {name: value for name, value in result["quality"].items() if name != "nmsve"}
    rates = {name: result[name] for name in ("rates", "rate_bpvf", RATE)}
    return {**setting, **rates, **seconds, **quality}
