"""Opening of the stage of a USD file, after checks of its layers; USD errors become `FormatError`.

Composition opens every layer that another one names, and does not terminate for some invalid rates.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.file_errors import check_input_file
from meshreel.formats.file_references import is_within, outside_error
from meshreel.formats.options import Reading
from meshreel.model.notes import NoteKind, Notes
from meshreel.runtime.extras import USD

NOT_UTF8 = "it contains text that is not UTF-8"


@contextmanager
def usd_errors(subject: str) -> Iterator[None]:
    """Raise errors of USD within the context as `FormatError`, and suppress its output.

    Parameters
    ----------
    subject : str
        Start of the message, such as "USD cannot read the file".
    """
    tf = USD.load("Tf")
    # While it exists, it receives the messages instead of the terminal.
    delegate = USD.load("UsdUtils").CoalescingDiagnosticDelegate()
    try:
        yield
    except UnicodeDecodeError:
        raise FormatError(f"{subject}: {NOT_UTF8}") from None
    except (tf.ErrorException, tf.CppException) as error:
        raise FormatError(f"{subject}: {_reason(error)}") from None
    finally:
        del delegate


def _reason(error: Exception) -> str:
    try:
        reasons = [str(getattr(arg, "commentary", arg)) for arg in error.args]
    except UnicodeDecodeError:  # the message quotes the file
        return NOT_UTF8
    # The message of a C++ exception continues with a stack trace.
    return reasons[0].partition("\n")[0] if reasons else "USD gives no reason"


DEFAULT_RATE = 24.0
"""Time codes per second of a file that does not declare them, by the standard."""

MIN_RATE, MAX_RATE = 1e-3, 1e6
"""Limits of time codes per second; the largest ones are microseconds."""

MAX_FRAME_RATE = 120.0
"""Time codes per second above which a code is not a frame, unless the stage has a frame rate."""

MAX_LAYERS = 10_000

DAMAGED = "USD cannot read it, so it is damaged or not a USD file"


def checked_layers(path: Path, *, allow_outside: bool) -> list[Any]:
    """Return every layer that composition of a file may open; missing layers are skipped.

    This includes layers of unselected variants and of value clips. Keep the list while the stage
    is opened, so that layers are not read twice. Layers that were already open are reloaded.

    Parameters
    ----------
    allow_outside : bool
        Whether layers may be outside of the folder of the file.

    Raises
    ------
    FormatError
        If the file cannot be read, a layer has an invalid rate or is outside of the folder, or
        there are too many layers.
    """
    folder = None if allow_outside else path.absolute().parent
    layers: dict[str, Any] = {}
    pending = [str(path.absolute())]
    while pending:
        name = pending.pop()
        if name in layers:
            continue
        if len(layers) == MAX_LAYERS:
            raise FormatError(f"refers to more than {MAX_LAYERS} layers; flatten it into one file")
        layers[name] = layer = _open_layer(name, is_needed=not layers)
        if layer is None:
            if len(layers) == 1:
                raise FormatError(DAMAGED)
            continue
        try:
            codes_per_second(layer)
        except FormatError as error:
            raise FormatError(f"{error} ({Path(name).name})") from None
        pending += _referenced_layers(layer, name, folder)
    return [layer for layer in layers.values() if layer is not None]


def codes_per_second(layer: Any) -> float:
    """Return the time codes per second of a layer: as declared, or its frame rate, or 24.

    Raises
    ------
    FormatError
        If the rate is out of range.
    """
    for key in ("timeCodesPerSecond", "framesPerSecond"):
        rate = layer_number(layer, key)
        if rate is None:
            continue
        if not MIN_RATE <= rate <= MAX_RATE:
            raise FormatError(
                f"has {rate:g} as {key}; expected {MIN_RATE:g} to {MAX_RATE:g}; correct it"
            )
        return rate
    return DEFAULT_RATE


def layer_number(layer: Any, key: str) -> float | None:
    """Return a number in the metadata of a layer, or None if it is not declared.

    The stage would reject a float where the schema has a double.

    Raises
    ------
    FormatError
        If the value is not a number.
    """
    if not layer.pseudoRoot.HasInfo(key):
        return None
    value = layer.pseudoRoot.GetInfo(key)
    if not isinstance(value, int | float):
        raise FormatError(f"has {str(value)[:40]!r} as {key}, which is not a number; correct it")
    return float(value)


def _open_layer(name: str, *, is_needed: bool) -> Any | None:
    """Return the current layer on disk; None if it is not needed and cannot be read."""
    layers = USD.load("Sdf").Layer
    with suppress(*(() if is_needed else (FormatError,))), usd_errors(DAMAGED):
        layer = layers.Find(name)
        if layer and not layer.dirty:  # the file may have changed since
            layer.Reload()
        return layer or layers.FindOrOpen(name)
    return None


def _referenced_layers(layer: Any, name: str, folder: Path | None) -> Iterator[str]:
    """Yield the paths of sublayers, references, payloads and clips of a layer that exist.

    If a folder is given, all of them must be in it or below, even missing ones.
    """
    sdf, resolver = USD.load("Sdf"), USD.load("Ar").GetResolver()
    with usd_errors(DAMAGED):
        references = USD.load("UsdUtils").ExtractExternalReferences(name)
    for reference in (reference for kind in references for reference in kind):
        asset, _ = sdf.Layer.SplitIdentifier(reference)
        if sdf.FileFormat.FindByExtension(asset) is None:
            continue  # an image, or another file that composing does not open
        with usd_errors(DAMAGED):
            anchored = sdf.ComputeAssetPathRelativeToLayer(layer, asset)
            # Paths without ./ are also searched in the working directory.
            resolved = str(resolver.Resolve(anchored))
        if folder is not None:
            missing = outer_file(name).parent / outer_file(anchored)
            if not is_within(outer_file(resolved) if resolved else missing, folder):
                raise outside_error(reference)
        if resolved:
            check_input_file(outer_file(resolved))
            yield resolved


def outer_file(path: str) -> Path:
    """Return the file of an asset that may be in a package, as in ``a.usdz[b.usdc]``."""
    return Path(USD.load("Ar").SplitPackageRelativePathOuter(path)[0])


def open_stage(path: Path, reading: Reading) -> Any:
    """Return the ``Usd.Stage`` of the current file on disk.

    Parameters
    ----------
    reading : Reading
        Their notes gain a sentence if referenced files are missing, and one if axes or units
        differ from y up and meters.

    Raises
    ------
    FormatError
        If USD cannot read the file, a rate is invalid, or layers are outside of its folder.
    """
    layers = checked_layers(path, allow_outside=reading.allow_outside)
    reading.referenced.update(Path(layer.realPath).resolve() for layer in layers)
    with usd_errors(DAMAGED):
        stage = USD.load("Usd").Stage.Open(layers[0])
        texts = (" ".join(str(error).split()).rstrip(".") for error in stage.GetCompositionErrors())
        subject = "the file refers to missing or invalid data"
        reading.notes.list_names(NoteKind.UNKNOWN, subject, texts)
        _note_axes(stage, reading.notes)
    # Variables of asset path expressions are known only after the library has opened the layers.
    for layer in () if reading.allow_outside else stage.GetUsedLayers():
        if not layer.anonymous and layer != stage.GetRootLayer():
            name = layer.realPath or layer.identifier
            if not is_within(outer_file(name), path.absolute().parent):
                raise outside_error(name)
    return stage


def codes_per_frame(stage: Any, rate: float) -> float:
    """Return the time codes per frame of a stage with `rate` time codes per second.

    Without a frame rate, it is one code per frame, unless codes are much finer than frames: then
    the default frame rate applies.
    """
    fps = layer_number(stage.GetRootLayer(), "framesPerSecond")
    if fps is not None and MIN_RATE <= fps <= MAX_RATE:
        return rate / fps
    return 1.0 if rate <= MAX_FRAME_RATE else rate / DEFAULT_RATE


def _note_axes(stage: Any, notes: Notes) -> None:
    geometry = USD.load("UsdGeom")
    differences = []
    if geometry.GetStageUpAxis(stage) == geometry.Tokens.z:
        differences.append("z points up")
    meters = layer_number(stage.GetRootLayer(), geometry.Tokens.metersPerUnit)
    if meters not in (None, 1):
        differences.append(f"a unit is {meters:g} m")
    if differences:
        text = ", ".join(differences)
        notes.result(f"positions stay in the axes and units of the file, where {text}")
