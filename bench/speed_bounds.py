"""Bounds on speeds, and their verdicts."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from speed_coders import DEFAULT_EFFORT, DRACO, FAST_EFFORT, reel_name
from speed_timing import is_unsteady
from speed_trials import FLOORS


@dataclass(frozen=True)
class Verdict:
    """A measured value, its bounds, and whether its times are reliable."""

    title: str
    value: float
    is_steady: bool
    maximum: float | None = None
    minimum: float | None = None

    @property
    def holds(self) -> bool:
        """Whether the value is within its bounds."""
        return (self.maximum is None or self.value <= self.maximum) and (
            self.minimum is None or self.value >= self.minimum
        )

    def as_dict(self) -> dict[str, Any]:
        """The attributes for JSON."""
        return {**vars(self), "holds": self.holds}


@dataclass(frozen=True)
class Bound:
    """A bound of a coder on a sequence.

    `ratio` names the ratios of a result; `by_serial` is a speed-up over the paper's serial
    decoding, the others are times relative to another coder.
    """

    sequence: str
    coder: str
    ratio: str
    task: str
    maximum: float | None = None
    minimum: float | None = None


RATIO_NAMES = {
    "by_draco": "{task} / Draco",
    "by_floor": "{task} / floor",
    "by_serial": "paper's serial {task} / {task}",
}
OTHERS: dict[str, tuple[str, ...]] = {"by_draco": (DRACO,), "by_floor": FLOORS, "by_serial": ()}

BOUNDS = [
    Bound("samba", reel_name(DEFAULT_EFFORT), "by_draco", "encode", maximum=1 / 3),
    Bound("samba", reel_name(DEFAULT_EFFORT), "by_draco", "decode", maximum=1 / 4),
    Bound("samba", reel_name(DEFAULT_EFFORT), "by_floor", "encode", maximum=8.0),
    Bound("samba", reel_name(DEFAULT_EFFORT), "by_floor", "decode", maximum=5.0),
    Bound("samba", reel_name(DEFAULT_EFFORT), "by_serial", "decode", minimum=100.0),
    Bound("samba", reel_name(FAST_EFFORT), "by_draco", "encode", maximum=1 / 3),
    Bound("samba", reel_name(FAST_EFFORT), "by_draco", "decode", maximum=1 / 4),
]
MAX_EXPONENT = {"vertices": 1.25, "frames": 1.2}


def verdicts_on(result: Mapping[str, Any]) -> list[Verdict]:
    """Verdicts for the coders timed on a sequence."""
    return [
        Verdict(
            f"{bound.sequence}, {bound.coder}: {RATIO_NAMES[bound.ratio].format(task=bound.task)}",
            result[bound.ratio][bound.coder][bound.task],
            is_steady(result, bound),
            bound.maximum,
            bound.minimum,
        )
        for bound in BOUNDS
        if bound.sequence == result["sequence"]
        and bound.task in result.get(bound.ratio, {}).get(bound.coder, {})
    ]


def is_steady(result: Mapping[str, Any], bound: Bound) -> bool:
    """Whether the times of the coder and of at least one reference are reliable."""
    runs_s, others = result["runs_s"], OTHERS[bound.ratio]
    return not is_unsteady(runs_s[bound.coder][bound.task]) and (
        not others or not all(is_unsteady(runs_s[name][bound.task]) for name in others)
    )


def verdicts_on_growth(growth: Mapping[str, Any]) -> list[Verdict]:
    """Verdicts for the exponents of a series."""
    maximum = MAX_EXPONENT[growth["of"]]
    return [
        Verdict(
            f"{growth['coder']}: {task} grows with {growth['of']} to the power",
            exponent,
            not any(is_unsteady(runs[task]) for runs in growth["runs_s"].values()),
            maximum,
        )
        for task, exponent in growth["exponents"].items()
    ]
