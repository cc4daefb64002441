"""A stage: a USD file with all that it refers to, composed."""

from pathlib import Path
from typing import Any

from meshreel.formats.extras import USD
from meshreel.formats.options import ReadOptions
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.layers import (
    DAMAGED,
    DEFAULT_RATE,
    MAX_RATE,
    MIN_RATE,
    check_used_layers,
    checked_layers,
    layer_number,
)

MAX_SHOWN_RATE = 120.0
"""Where a stage has more time codes a second, and does not say how many frames, a code is none."""

MAX_LISTED = 3


def open_stage(path: Path, options: ReadOptions) -> Any:
    """The ``Usd.Stage`` of a file, as it is on disk now.

    Parameters
    ----------
    path : Path
    options : ReadOptions
        Its notes gain a sentence if anything that the file refers to is missing, and one if its
        axes or units are not those that are written: y upwards, metres.

    Raises
    ------
    FormatError
        If USD cannot read it, it has a rate that cannot be, or names layers where they may not be.
    """
    layers = checked_layers(path, allow_outside=options.allow_outside)
    with usd_errors(DAMAGED):
        stage = USD.load("Usd").Stage.Open(layers[0])
        _note_missing(stage, options.notes)
        _note_axes(stage, options.notes)
    if not options.allow_outside:
        check_used_layers(stage, path)
    return stage


def codes_per_frame(stage: Any, rate: float) -> float:
    """Time codes from one frame to the next, as players show a stage of so many codes a second.

    Where the stage does not say it is one, unless codes are finer than any frames: then there are
    as many frames a second as the standard takes.
    """
    shown = layer_number(stage.GetRootLayer(), "framesPerSecond")
    if shown is not None and MIN_RATE <= shown <= MAX_RATE:
        return rate / shown
    return 1.0 if rate <= MAX_SHOWN_RATE else rate / DEFAULT_RATE


def _note_missing(stage: Any, notes: list[str]) -> None:
    found = [" ".join(str(error).split()) for error in stage.GetCompositionErrors()]
    if found:
        more = f" and {len(found) - MAX_LISTED} more" if len(found) > MAX_LISTED else ""
        listed = "; ".join(one.rstrip(".") for one in found[:MAX_LISTED])
        notes.append(f"what the file refers to is not all there: {listed}{more}")


def _note_axes(stage: Any, notes: list[str]) -> None:
    geometry = USD.load("UsdGeom")
    said = []
    if geometry.GetStageUpAxis(stage) == geometry.Tokens.z:
        said.append("z points upwards")
    metres = layer_number(stage.GetRootLayer(), geometry.Tokens.metersPerUnit)
    if metres not in (None, 1):
        said.append(f"a unit is {metres:g} m")
    if said:
        notes.append(f"positions stay in the axes and units of the file, where {', '.join(said)}")
