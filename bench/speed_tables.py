"""Results of a speed run as Markdown."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from meshreel.evaluation.runs.timing import machine_line
from speed_bounds import RATIO_NAMES, Verdict
from speed_timing import is_unsteady

CODING = ("encode", "decode")
SINGLE_FRAMES = ("first_frame", "random_frame", "next_frame")

RATIOS = [("by_draco", "encode"), ("by_draco", "decode"), ("by_floor", "encode"),
          ("by_floor", "decode"), ("by_serial", "decode")]  # fmt: skip
RATIO_HEADER = [RATIO_NAMES[by].format(task=task) for by, task in RATIOS]
SECONDS_HEADER = ["seconds", "bytes", "encode", "decode", "first frame", "random frame",
                  "next frame"]  # fmt: skip
MEMORY_HEADER = ["MiB", "before encoding", "peak", "before decoding", "peak"]
SUMMARY_HEADER = ["case", "encode s", "decode s", "first frame s", "random frame s",
                  *RATIO_HEADER, "peak MiB, encode", "peak MiB, decode"]  # fmt: skip


def machine_text(about: Mapping[str, Any]) -> str:
    """Description of the machine and of the columns."""
    return (
        f"{machine_line(about['machine'])}. Threads: {about['threads']}. Floors of "
        f"{about['n_modes_of_floor']} modes for each axis; ratios are to the faster of the two. "
        "First frame: from the stored stream to its first frame; random frame: the middle frame of "
        "a newly opened stream; next frame: the frame after it."
    )


def case_report(result: Mapping[str, Any]) -> str:
    """The tables of one sequence."""
    names = list(result["seconds"])
    serial = result.get("serial")
    rows = [seconds_row(result, name) for name in names]
    parts = [case_heading(result), table(SECONDS_HEADER, rows + serial_rows(serial))]
    coders = [name for name in names if name in result["size_bytes"]]
    parts.append(table(["times", *RATIO_HEADER], ([n, *ratio_cells(result, n)] for n in coders)))
    if "memory_mib" in result:
        peaks = result["memory_mib"]
        parts.append(table(MEMORY_HEADER, (memory_row(name, peaks[name]) for name in peaks)))
    parts += serial_lines(serial) + unsteady_lines(result["runs_s"])
    return "\n\n".join(parts) + "\n"


def case_heading(result: Mapping[str, Any]) -> str:
    """Sequence and rounds."""
    return (
        f"## {result['sequence']}\n\n{result['n_frames']} frames, {result['n_verts']} vertices, "
        f"{result['n_faces']} faces. Medians of {result['n_rounds']} rounds, all in turn."
    )


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table with a left-aligned first column and right-aligned others."""
    lines = [header, ["---"] + ["---:"] * (len(header) - 1), *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def seconds_row(result: Mapping[str, Any], name: str) -> list[str]:
    """The cells of one coder, or of the floors."""
    seconds = result["seconds"][name]
    size = str(result["size_bytes"].get(name, "-"))
    return [name, size, *(cell(seconds, task, ".4f") for task in CODING + SINGLE_FRAMES)]


def ratio_cells(result: Mapping[str, Any], name: str) -> list[str]:
    """Slow-downs relative to Draco and the floors, speed-up over the serial method."""
    return [cell(result.get(by, {}).get(name, {}), task, ".2f") for by, task in RATIOS]


def cell(figures: Mapping[str, float], key: str, how: str) -> str:
    """A formatted value, or a dash if it is missing."""
    return format(figures[key], how) if key in figures else "-"


def serial_rows(serial: Mapping[str, Any] | None) -> list[list[str]]:
    """The row of the paper's serial decoding, if it was timed."""
    if serial is None:
        return []
    mark = "" if serial["n_timed"] == serial["n_frames"] else "~"
    decode = f"{mark}{serial['decode_s']:.1f}"
    return [[f"paper, serial ({serial['method']})", "-", "-", decode, "-", "-", "-"]]


def serial_lines(serial: Mapping[str, Any] | None) -> list[str]:
    """A note on the timing of the paper's serial decoding."""
    if serial is None:
        return []
    n_timed, n_frames = serial["n_timed"], serial["n_frames"]
    how = f"extrapolated from {n_timed} of {n_frames}" if n_timed < n_frames else "all"
    return [f"The paper's serial decoding solves for each frame; timed once: {how} frames."]


def unsteady_lines(runs_s: Mapping[str, Mapping[str, list[float]]]) -> list[str]:
    """A note on unsteady runs, if any."""
    said = [
        f"{name}, {task}: {min(runs[task]):.4f} to {max(runs[task]):.4f} s"
        for name, runs in runs_s.items()
        for task in CODING
        if is_unsteady(runs[task])
    ]
    return [f"Unsteady, not to be relied on: {'; '.join(said)}."] if said else []


def memory_row(name: str, peaks: Mapping[str, Mapping[str, float]]) -> list[str]:
    """The cells of one coder."""
    return [name, *(f"{peaks[task][when]:.0f}" for task in CODING for when in ("before", "peak"))]


def growth_report(growth: Mapping[str, Any]) -> str:
    """Seconds by size."""
    rows = [
        [label, *(f"{growth['seconds'][task][i]:.4f}" for task in CODING)]
        for i, label in enumerate(growth["runs_s"])
    ]
    for key in ("exponents", "steepest_exponents"):
        name = key.replace("_", " ").removesuffix("s")
        rows.append([name, *(f"{growth[key][task]:.3f}" for task in CODING)])
    parts = [
        f"## Growth with {growth['of']}: {growth['coder']}\n\n"
        f"{', '.join(growth['sequences'])}. Medians of {growth['n_rounds']} rounds, all sizes in "
        f"turn. Seconds are proportional to {growth['of']} to the power of the exponent (least "
        "squares on logarithms); the steepest is that from one size to the next.",
        table(["vertices x frames", "encode s", "decode s"], rows),
        *unsteady_lines(growth["runs_s"]),
    ]
    return "\n\n".join(parts) + "\n"


def summary(results: Sequence[Mapping[str, Any]], verdicts: Sequence[Verdict], coder: str) -> str:
    """All cases of one coder in a table, and every bound with its verdict."""
    rows = [summary_row(result, coder) for result in results if coder in result["seconds"]]
    parts = [f"## Summary: {coder}", table(SUMMARY_HEADER, rows)] if rows else ["## Summary"]
    if verdicts:
        parts.append(table(["bound", "value", "allowed", "holds"], map(verdict_row, verdicts)))
    return "\n\n".join(parts) + "\n"


def summary_row(result: Mapping[str, Any], coder: str) -> list[str]:
    """The cells of one case."""
    seconds, peaks = result["seconds"][coder], result.get("memory_mib", {}).get(coder)
    return [
        f"{result['sequence']} ({result['n_verts']} x {result['n_frames']})",
        *(cell(seconds, task, ".3f") for task in (*CODING, *SINGLE_FRAMES[:2])),
        *ratio_cells(result, coder),
        *(f"{peaks[task]['peak']:.0f}" if peaks else "-" for task in CODING),
    ]


def verdict_row(verdict: Verdict) -> list[str]:
    """The cells of one bound."""
    allowed = f">= {verdict.minimum:g}" if verdict.maximum is None else f"<= {verdict.maximum:g}"
    holds = ("yes" if verdict.holds else "NO") + ("" if verdict.is_steady else ", unsteady")
    return [verdict.title, f"{verdict.value:.3f}", allowed, holds]
