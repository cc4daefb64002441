"""Figures of a speed run as Markdown."""

from collections.abc import Iterable
from typing import Any

from meshreel.evaluation.machine import machine_line

TASKS = ("encode", "decode", "decode_one_frame")
BOUNDED = ("encode", "decode")
UNSTEADY = 1.5
"""Slowest by fastest run, above which a table says so."""
HEADER = ["", "bytes", "encode s", "decode s", "one frame s", "encode / Draco", "decode / Draco",
          "encode / floor", "decode / floor", "within bounds"]  # fmt: skip
MEMORY_HEADER = ["MiB", "before encoding", "peak", "before decoding", "peak"]


def report(result: dict[str, Any], about: dict[str, Any]) -> str:
    """The tables of one sequence, behind a line on what was measured and where."""
    parts = [heading(result, about), table(HEADER, (row(result, n) for n in result["seconds"]))]
    bounds = about["bounds_by_draco"]
    parts += [bound_line(name, result, bounds) for name in result["within_bounds"]]
    parts += unsteady_lines(result["runs_s"])
    if "memory_mib" in result:
        peaks = result["memory_mib"]
        parts.append(table(MEMORY_HEADER, (memory_row(name, peaks[name]) for name in peaks)))
    return "\n\n".join(parts) + "\n"


def heading(result: dict[str, Any], about: dict[str, Any]) -> str:
    """Sequence, runs, machine and threads."""
    machine = about["machine"]
    return (
        f"**{result['sequence']}**: {result['n_frames']} frames, {result['n_verts']} vertices, "
        f"{result['n_faces']} faces. Medians of {about['repeats']} runs in turn; floors of "
        f"{about['n_modes_of_floor']} modes. {machine_line(machine)}; threads of BLAS: "
        f"{machine['blas_threads']}."
    )


def table(header: list[str], rows: Iterable[list[str]]) -> str:
    """Markdown, the first column to the left and the others to the right."""
    lines = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def row(result: dict[str, Any], name: str) -> list[str]:
    """The cells of one coder, or of the floors."""
    within = result["within_bounds"].get(name, {})
    ratios = [result[by].get(name, {}) for by in ("by_draco", "by_floor")]
    return [
        name,
        str(result["size_bytes"].get(name, "-")),
        *(cell(result["seconds"][name], task, ".4f") for task in TASKS),
        *(cell(ratio, task, ".2f") for ratio in ratios for task in BOUNDED),
        ", ".join("yes" if within[task] else f"no ({task})" for task in within) or "-",
    ]


def cell(figures: dict[str, float], key: str, how: str) -> str:
    """A figure, or a dash where there is none."""
    return format(figures[key], how) if key in figures else "-"


def bound_line(name: str, result: dict[str, Any], bounds: dict[str, dict[str, float]]) -> str:
    """Bounds, ratios and a yes or no for each."""
    said = [
        f"{task} {result['by_draco'][name][task]:.2f} of at most {most:g}: "
        f"{'yes' if result['within_bounds'][name][task] else 'no'}"
        for task, most in bounds[name].items()
    ]
    return f"{name}, in times of Draco: " + "; ".join(said) + "."


def unsteady_lines(runs_s: dict[str, dict[str, list[float]]]) -> list[str]:
    """A sentence on the runs that differ so much that something else disturbed them, if any do."""
    said = [
        f"{name}, {task}: {min(own[task]):.4f} to {max(own[task]):.4f} s"
        for name, own in runs_s.items()
        for task in BOUNDED
        if max(own[task]) > UNSTEADY * min(own[task])
    ]
    return [f"Unsteady, not to be relied on: {'; '.join(said)}."] if said else []


def memory_row(name: str, peaks: dict[str, dict[str, float]]) -> list[str]:
    """The cells of one coder."""
    return [name, *(f"{peaks[task][when]:.0f}" for task in BOUNDED for when in ("before", "peak"))]
