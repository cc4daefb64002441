"""What the commands that write a report have in common."""

from pathlib import Path
from typing import Any, Protocol

from meshreel.cli.console import print_json, print_table


class Made(Protocol):
    """What was written."""

    @property
    def markdown(self) -> Path:
        """report.md"""

    @property
    def html(self) -> Path:
        """report.html"""

    @property
    def measured(self) -> list[tuple[Any, list[Any]]]:
        """Results and pictures of each sequence."""

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types."""


def print_report(made: Made, out: Path, notes: list[str], *, as_json: bool) -> None:
    """Where the report lies, or all its figures as JSON, with the notes on the inputs."""
    if as_json:
        print_json({**made.as_dict(), "notes": notes})
        return
    n_figures = sum(len(pictures) for _, pictures in made.measured)
    written = {"report": str(made.html), "the same, as Markdown": str(made.markdown)}
    print_table("Written", {**written, "figures": f"{n_figures} in {out / 'figures'}"})


def within(path: str) -> str:
    """A path as given, but without folders outside the current one: a report travels."""
    inside = not Path(path).is_absolute() and ".." not in Path(path).parts
    return path if inside else Path(path).name
