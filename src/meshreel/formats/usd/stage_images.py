"""Images that a stage refers to, in its package or next to its file, as unchanged bytes."""

from pathlib import Path, PurePosixPath
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.file_references import is_within, outside_error
from meshreel.formats.surfaces.images import image_type
from meshreel.model.materials import Image
from meshreel.runtime.extras import USD


class StageImages:
    """Images of a stage, each read once.

    Parameters
    ----------
    folder : Path or None
        Folder of the stage's file, which must contain the images; None allows any location.

    Attributes
    ----------
    images : list of Image
        The images read so far.
    """

    def __init__(self, folder: Path | None) -> None:
        self.images: list[Image] = []
        self._folder = None if folder is None else folder.resolve()
        self._indices: dict[str, int] = {}

    def index(self, asset: Any) -> int:
        """Return the index of an asset path in `images`, after reading it if necessary.

        Raises
        ------
        FormatError
            If the image cannot be read.
        """
        authored = str(getattr(asset, "path", ""))
        resolved = str(getattr(asset, "resolvedPath", ""))
        if resolved not in self._indices:
            if not resolved:
                raise FormatError(_why_unresolved(authored))
            self.images.append(self._image(authored, resolved))
            self._indices[resolved] = len(self.images) - 1
        return self._indices[resolved]

    def _image(self, authored: str, resolved: str) -> Image:
        resolver = USD.load("Ar")
        outer = resolved
        if resolver.IsPackageRelativePath(resolved):
            outer, _ = resolver.SplitPackageRelativePathOuter(resolved)
        if self._folder and not is_within(Path(outer), self._folder):
            raise outside_error(authored)
        if not Path(outer).is_file():
            raise FormatError(f"{authored[:200]!r} is not a file")
        opened = resolver.GetResolver().OpenAsset(resolver.ResolvedPath(resolved))
        if not opened:
            raise FormatError(f"{authored[:200]!r} cannot be read")
        data, name = bytes(opened.GetBuffer()), PurePosixPath(authored.rstrip("]"))
        return Image(name.stem, image_type(data, name.name), data)


def _why_unresolved(authored: str) -> str:
    if not authored:
        return "it names no file"
    if "<UDIM>" in authored:
        return f"{authored[:200]!r} consists of many tiles"
    return f"{authored[:200]!r} does not exist"
