"""The player as files that need no server of ours: one page, or a page with its parts beside it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshreel.app.viewer.api import Api
from meshreel.app.viewer.original_stream import OriginalStream, original_stream
from meshreel.app.viewer.page import SCRIPT_NAME, Page, base64_of, built_page
from meshreel.app.viewer.textures import Texture
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.outputs.checks import check_output_paths
from meshreel.runtime.progress import Progress, silent


@dataclass(frozen=True)
class Part:
    """Something that a page plays: what it is of, a name for a file, and the bytes."""

    what: str
    file_name: str
    data: bytes
    media_type: str = ""


def export_page(
    api: Api,
    path: Path,
    *,
    page: Page | None = None,
    texture: Texture | None = None,
    split: bool = False,
    overwrite: bool = False,
    progress: Progress = silent,
    notes: list[str] | None = None,
) -> dict[str, int]:
    """Write the player of a file as one HTML file, or with its parts beside it.

    Parameters
    ----------
    api : Api
        If it has an original, frames and tracks of that go along, encoded anew:
        `meshreel.app.viewer.original_stream`.
    path : Path
        The page. All files appear when all are written.
    page : Page, optional
        The player; default that of the package.
    texture : Texture, optional
        To be shown on the mesh.
    split : bool, default False
        Whether script, stream, original and texture are files beside the page. Files that hold
        the same bytes already are kept.
    overwrite : bool, default False
    progress : callable, optional
    notes : list of str, optional
        Gets what a person has to know of the page.

    Returns
    -------
    dict of str to int
        Bytes of the "player", of the "animation", and of "original", "tracks of the original" and
        "texture" if there are some, as they lie in the page or beside it.

    Raises
    ------
    InvalidInputError
        If the page is not built or has no place for data, a file exists, or the original is too
        large for a page.
    """
    player = built_page() if page is None else page
    original = original_stream(api, progress) if api.measuring is not None else None
    parts = _parts(api, path.stem, original, texture)
    facts = api.facts()  # with errors, which are measured by now
    if original is not None:
        _keep_carried(facts["original"], original.names)
        if notes is not None and original.left_out:
            names = ", ".join(original.left_out)
            notes.append(f"tracks of the original too large for a page, and left out: {names}")
    if not split:
        carried = {part.what: _carried(part, base64=base64_of(part.data)) for part in parts}
        files = {path: player.whole({"facts": facts, **_renamed(carried)}).encode()}
        sizes = {part.what: len(base64_of(part.data)) for part in parts}
    else:
        carried = {part.what: _carried(part, url=part.file_name) for part in parts}
        html = player.split({"facts": facts, **_renamed(carried)})
        files = {path: html.encode(), path.parent / SCRIPT_NAME: player.script.encode()}
        files |= {path.parent / part.file_name: part.data for part in parts}
        sizes = {part.what: len(part.data) for part in parts}
    total = sum(map(len, files.values()))
    _write(files, path, overwrite=overwrite)
    rest = total - sum(sizes.values())
    if original is not None and original.tracks_bytes:
        of_tracks = round(sizes["original"] * original.tracks_bytes / len(original.data))
        sizes["original"] -= of_tracks
        sizes["tracks of the original"] = of_tracks
    return {"player": rest, **sizes}


def split_files(path: Path, *, original: bool, texture: Texture | None) -> list[Path]:
    """The files that a page is split into, the page first."""
    names = [SCRIPT_NAME, f"{path.stem}.reel"]
    names += [f"{path.stem}-original.reel"] if original else []
    names += [texture.path.name] if texture else []
    return [path, *(path.parent / name for name in names)]


def _keep_carried(told: dict[str, Any], names: list[str]) -> None:
    """Has the page offer tracks of the original that it carries only."""
    told["tracks"] = names
    told["track_heats"] = [heat for heat in told["track_heats"] if heat["track"] in names]


def _parts(
    api: Api, stem: str, original: OriginalStream | None, texture: Texture | None
) -> list[Part]:
    stream = api.reel.stored(0, api.reel.size_bytes)
    parts = [Part("animation", f"{stem}.reel", stream)]
    if original is not None:
        parts.append(Part("original", f"{stem}-original.reel", original.data))
    if texture is not None:
        data = texture.path.read_bytes()
        parts.append(Part("texture", texture.path.name, data, texture.media_type))
    return parts


def _carried(part: Part, **where: str) -> dict[str, Any]:
    return {**where, **({"mediaType": part.media_type} if part.media_type else {})}


def _renamed(carried: dict[str, Any]) -> dict[str, Any]:
    """By the names that the page has for them."""
    return {"stream" if what == "animation" else what: part for what, part in carried.items()}


def _write(files: dict[Path, bytes], page: Path, *, overwrite: bool) -> None:
    """Write files that do not hold these bytes already; the page itself is always written."""
    new = {path: data for path, data in files.items() if path == page or not _holds(path, data)}
    check_output_paths(list(new), overwrite=overwrite)
    with replace_all_when_done(list(new), overwrite=overwrite) as temporaries:
        for temporary, data in zip(temporaries, new.values(), strict=True):
            temporary.write_bytes(data)


def _holds(path: Path, data: bytes) -> bool:
    return path.is_file() and path.stat().st_size == len(data) and path.read_bytes() == data
