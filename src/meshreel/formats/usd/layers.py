"""The layers of a USD file, looked at before the library composes them.

Composing opens whatever a layer names, and never ends where a layer has no usable rate.
"""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.file_errors import refuse_pipe
from meshreel.formats.named_files import is_within, outside_error
from meshreel.formats.usd.diagnostics import usd_errors

DEFAULT_RATE = 24.0
"""Time codes per second where a file does not say, by the standard."""

MIN_RATE, MAX_RATE = 1e-3, 1e6
"""Least and most time codes per second; the most are microseconds."""

MAX_LAYERS = 10_000

DAMAGED = "USD cannot read it, so it is damaged or of another kind"


def checked_layers(path: Path, *, allow_outside: bool) -> list[Any]:
    """Every layer that composing a file may open; what is not there is passed over.

    Those of variants that are not chosen are among them, and those of value clips. Whoever holds
    the list spares the library to read them again. Layers that were open before are read anew.

    Parameters
    ----------
    allow_outside : bool
        Whether layers may be outside of the folder of the file.

    Raises
    ------
    FormatError
        If the file cannot be read, a layer has a rate that cannot be or is where it may not be,
        or there are too many.
    """
    folder = None if allow_outside else path.absolute().parent
    found: dict[str, Any] = {}
    pending = [str(path.absolute())]
    while pending:
        name = pending.pop()
        if name in found:
            continue
        if len(found) == MAX_LAYERS:
            raise FormatError(f"names more than {MAX_LAYERS} layers; flatten it to one file")
        found[name] = layer = _opened(name, is_needed=not found)
        if layer is None:
            if len(found) == 1:
                raise FormatError(DAMAGED)
            continue
        try:
            codes_per_second(layer)
        except FormatError as error:
            raise FormatError(f"{error} ({Path(name).name})") from None
        pending += _named_layers(layer, name, folder)
    return [layer for layer in found.values() if layer is not None]


def codes_per_second(layer: Any) -> float:
    """Time codes per second of a layer: what it says, or its frames per second, or 24.

    Raises
    ------
    FormatError
        If it is out of all bounds.
    """
    for key in ("timeCodesPerSecond", "framesPerSecond"):
        rate = layer_number(layer, key)
        if rate is None:
            continue
        if not MIN_RATE <= rate <= MAX_RATE:
            raise FormatError(
                f"has {rate:g} as {key}; allowed are {MIN_RATE:g} to {MAX_RATE:g}; correct it"
            )
        return rate
    return DEFAULT_RATE


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


def _opened(name: str, *, is_needed: bool) -> Any | None:
    """The layer, as it is on disk now; None if it cannot be read, and need not be."""
    layers = USD.load("Sdf").Layer
    with suppress(*(() if is_needed else (FormatError,))), usd_errors(DAMAGED):
        layer = layers.Find(name)
        if layer and not layer.dirty:  # kept by someone since an earlier state of the file
            layer.Reload()
        return layer or layers.FindOrOpen(name)
    return None


def check_used_layers(stage: Any, path: Path) -> None:
    """Refuse a stage that is composed of layers outside of the folder of its file.

    All but one kind of names are looked at before: expressions, whose variables another layer may
    set, are only known when the library has opened what they name.

    Raises
    ------
    FormatError
        Naming the layer.
    """
    for layer in stage.GetUsedLayers():
        if not layer.anonymous and layer != stage.GetRootLayer():
            _check_within(layer.realPath or layer.identifier, path.absolute().parent)


def _named_layers(layer: Any, name: str, folder: Path | None) -> Iterator[str]:
    """Where the layers are that a layer names as sublayers, references, payloads and clips.

    They must be in the folder, if one is given, or below; also those that are not there.
    """
    sdf, resolver = USD.load("Sdf"), USD.load("Ar").GetResolver()
    with usd_errors(DAMAGED):
        named = USD.load("UsdUtils").ExtractExternalReferences(name)
    for given in (one for kind in named for one in kind):
        asset, _ = sdf.Layer.SplitIdentifier(given)
        if sdf.FileFormat.FindByExtension(asset) is None:
            continue  # an image, or another file that composing does not open
        with usd_errors(DAMAGED):
            anchored = sdf.ComputeAssetPathRelativeToLayer(layer, asset)
            # What has no ./ in front is also looked for where the program runs.
            resolved = str(resolver.Resolve(anchored))
        if folder is not None:
            _check_within(resolved or _beside(name, anchored), folder, given)
        if resolved:
            refuse_pipe(_file_of(resolved))
            yield resolved


def _beside(name: str, asset: str) -> str:
    """Where an asset would be that a layer names, if it were there."""
    return str(Path(_file_of(name)).parent / _file_of(asset))


def _check_within(place: str, folder: Path, given: str = "") -> None:
    if not is_within(Path(_file_of(place)), folder):
        raise outside_error(given or place)


def _file_of(place: str) -> str:
    """The file of a layer that may be in a package, as in ``a.usdz[b.usdc]``."""
    return str(USD.load("Ar").SplitPackageRelativePathOuter(place)[0])
