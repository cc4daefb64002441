"""Profile of the stages of a command, as a table and for JSON."""

from typing import Any

from meshreel.app.cli.console import print_columns
from meshreel.app.cli.messages import print_line
from meshreel.runtime.profiling import Profile, StageTime

HEADINGS = ("stage", "seconds", "share", "other threads", "calls")
NOTE = (
    "Indented stages are parts of the stage above. Other threads run in parallel to these seconds."
)


def print_profile(profile: Profile) -> None:
    """Print the profile on stdout."""
    rows = [_cells(time, profile.wall_s) for time in profile.stages]
    for name, seconds in (("(everything else)", profile.unnamed_s), ("total", profile.wall_s)):
        rows.append([name, *_seconds_and_share(seconds, profile.wall_s), "", ""])
    print_columns("seconds by stage", HEADINGS, rows)
    print_line(NOTE)


def profile_figures(profile: Profile) -> dict[str, Any]:
    """The profile for JSON."""
    return {
        "wall_s": profile.wall_s,
        "stages": [
            {
                "stage": list(time.path),
                "in_other_thread": time.in_other_thread,
                "seconds": time.seconds,
                "calls": time.n_calls,
            }
            for time in profile.stages
        ],
    }


def _cells(time: StageTime, wall_s: float) -> list[str]:
    name = "  " * (len(time.path) - 1) + time.path[-1]
    if time.in_other_thread:
        return [name, "", "", f"{time.seconds:.3f}", str(time.n_calls)]
    return [name, *_seconds_and_share(time.seconds, wall_s), "", str(time.n_calls)]


def _seconds_and_share(seconds: float, wall_s: float) -> list[str]:
    return [f"{seconds:.3f}", f"{seconds / wall_s:.0%}"]
