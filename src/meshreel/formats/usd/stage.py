"""A stage: a USD file with all that it refers to, composed."""

from pathlib import Path
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.usd.diagnostics import usd_errors

DEFAULT_RATE = 24.0
"""Time codes per second where a file does not say, by the standard."""

MIN_RATE, MAX_RATE = 1e-3, 1e6
"""What time codes per second can be; the most are microseconds."""

MAX_SHOWN_RATE = 120.0
"""Where a stage has more time codes a second, and does not say how many frames, a code is none."""

MAX_LISTED = 3


def open_stage(path: Path, notes: list[str]) -> Any:
    """The ``Usd.Stage`` of a file, as it is on disk now.

    Parameters
    ----------
    path : Path
    notes : list of str
        Gains a sentence if anything that the file refers to is missing, and one if its axes or
        units are not those that are written: y upwards, metres.

    Raises
    ------
    FormatError
        If USD cannot read it.
    """
    name = str(path.absolute())
    with usd_errors("USD cannot read it, so it is damaged or of another kind"):
        layer = USD.load("Sdf").Layer.Find(name)
        if layer and not layer.dirty:  # kept by someone since an earlier state of the file
            layer.Reload()
        stage = USD.load("Usd").Stage.Open(name)
        _note_missing(stage, notes)
        _note_axes(stage, notes)
    return stage


def codes_per_second(stage: Any, notes: list[str]) -> float:
    """Time codes per second of a stage, above 0."""
    rate = float(stage.GetTimeCodesPerSecond())
    if MIN_RATE <= rate <= MAX_RATE:
        return rate
    notes.append(
        f"the file says {rate:g} time codes per second, not {MIN_RATE:g} to {MAX_RATE:g}; "
        f"taken as {DEFAULT_RATE:g}"
    )
    return DEFAULT_RATE


def codes_per_frame(stage: Any, rate: float) -> float:
    """Time codes from one frame to the next, as players show a stage of so many codes a second.

    Where the stage does not say it is one, unless codes are finer than any frames: then there are
    as many frames a second as the standard takes.
    """
    shown = float(stage.GetFramesPerSecond())
    if stage.HasAuthoredMetadata("framesPerSecond") and MIN_RATE <= shown <= MAX_RATE:
        return rate / shown
    return 1.0 if rate <= MAX_SHOWN_RATE else rate / DEFAULT_RATE


def layer_number(layer: Any, key: str) -> float | None:
    """A number of the metadata of a layer; None if it does not say.

    Asked of the stage, USD refuses a float where its schema has a double.

    Raises
    ------
    FormatError
        If it is no number.
    """
    if not layer.pseudoRoot.HasInfo(key):
        return None
    given = layer.pseudoRoot.GetInfo(key)
    if not isinstance(given, int | float):
        raise FormatError(f"has {str(given)[:40]!r} as {key}, which is no number; correct it")
    return float(given)


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
