"""The player as files that need no server of ours: one page, or a page with its parts beside it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.codec.encoder import encode
from meshreel.errors import InvalidInputError
from meshreel.runtime.outputs.atomic import replace_all_when_done
from meshreel.runtime.outputs.checks import check_output_paths
from meshreel.runtime.progress import Progress, silent
from meshreel.sequence import MeshSequence
from meshreel.viewer.api import Api
from meshreel.viewer.page import SCRIPT_NAME, Page, base64_of, built_page
from meshreel.viewer.textures import Texture

SHARE_OF_RANGE = 1 / 20
"""How far the original in a page may be off, as a share of the range of the map of distances."""

DISTANCE = "distance"
"""The heat map of distances of vertices, in percent of the diagonal."""

LEAST_PERCENT = 1e-5
"""Of the diagonal: the original is never nearer than this."""

MOST_ORIGINAL_BYTES = 1 << 30
"""Of positions of the original, which are encoded in memory."""


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
) -> dict[str, int]:
    """Write the player of a file as one HTML file, or with its parts beside it.

    Parameters
    ----------
    api : Api
        If it has an original, frames of that go along, encoded anew: `SHARE_OF_RANGE`.
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

    Returns
    -------
    dict of str to int
        Bytes of the "player", of the "animation", and of "original" and "texture" if there are
        some, as they lie in the page or beside it.

    Raises
    ------
    InvalidInputError
        If the page is not built or has no place for data, a file exists, or the original is too
        large for a page.
    """
    player = built_page() if page is None else page
    parts = _parts(api, path.stem, texture, progress)
    facts = api.facts()  # with errors, which are measured by now
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
    return {"player": total - sum(sizes.values()), **sizes}


def split_files(path: Path, *, original: bool, texture: Texture | None) -> list[Path]:
    """The files that a page is split into, the page first."""
    names = [SCRIPT_NAME, f"{path.stem}.reel"]
    names += [f"{path.stem}-original.reel"] if original else []
    names += [texture.path.name] if texture else []
    return [path, *(path.parent / name for name in names)]


def _parts(api: Api, stem: str, texture: Texture | None, progress: Progress) -> list[Part]:
    stream = api.reel.stored(0, api.reel.size_bytes)
    parts = [Part("animation", f"{stem}.reel", stream)]
    if api.measuring is not None:
        _check_size(api)
        api.measuring.run(progress)
        data = _original_stream(api, progress)
        parts.append(Part("original", f"{stem}-original.reel", data))
    if texture is not None:
        data = texture.path.read_bytes()
        parts.append(Part("texture", texture.path.name, data, texture.media_type))
    return parts


def _original_stream(api: Api, progress: Progress) -> bytes:
    """The original as a stream that is much nearer to it than the file."""
    assert api.comparison is not None  # its errors have been measured
    assert api.measuring is not None
    original, reel = api.comparison.original, api.reel
    frames = [original.frame(number) for number in range(reel.n_frames)]
    sequence = MeshSequence(np.array(frames, np.float64), reel.faces, fps=reel.fps)
    (range_percent,) = (
        heat["range"]
        for heat in api.measuring.figures.described_heats()
        if heat["kind"] == DISTANCE
    )
    near = max(LEAST_PERCENT, SHARE_OF_RANGE * range_percent)
    return encode(sequence, max_error=near, progress=progress)


def _check_size(api: Api) -> None:
    size = 24 * api.reel.n_frames * api.reel.n_verts
    if size > MOST_ORIGINAL_BYTES:
        raise InvalidInputError(
            f"the original has {size / 1e9:.1f} GB of positions, too many for a page; "
            "leave --original out, or use meshreel view"
        )


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
