"""Profile of the stages of a command, as a table and for JSON."""

from typing import Any

from rich.console import Console
from rich.table import Table

from meshreel.runtime.profiling import Profile, StageTime

NOTE = (
    "Indented stages are parts of the stage above. Other threads run in parallel to these seconds."
)


def print_profile(profile: Profile) -> None:
    """Print the profile on stdout."""
    table = Table(title="seconds by stage", title_justify="left", title_style="bold")
    table.add_column("stage", no_wrap=True)
    for name in ("seconds", "share", "other threads", "calls"):
        table.add_column(name, justify="right")
    for time in profile.stages:
        table.add_row(*_cells(time, profile.wall_s))
    table.add_row("(everything else)", *_seconds_and_share(profile.unnamed_s, profile.wall_s))
    table.add_section()
    table.add_row("total", *_seconds_and_share(profile.wall_s, profile.wall_s))
    console = Console()
    console.print(table)
    console.print(NOTE, highlight=False)


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
