"""Images that a stage refers to: in its package or beside its file, their bytes as they are."""

from pathlib import Path, PurePosixPath
from typing import Any

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.named_files import is_within, outside_error
from meshreel.formats.surfaces.images import image_type
from meshreel.model.materials import Image


class StageImages:
    """Images of a stage, each read once.

    Parameters
    ----------
    folder : Path or None
        That of the stage's file; images are read from there and below. None: from anywhere.

    Attributes
    ----------
    images : list of Image
        Those read so far.
    """

    def __init__(self, folder: Path | None) -> None:
        self.images: list[Image] = []
        self._folder = None if folder is None else folder.resolve()
        self._numbers: dict[str, int] = {}

    def number(self, asset: Any) -> int:
        """Which one of `images` an asset path means.

        Raises
        ------
        FormatError
            If it cannot be had.
        """
        authored = str(getattr(asset, "path", ""))
        resolved = str(getattr(asset, "resolvedPath", ""))
        if resolved not in self._numbers:
            if not resolved:
                raise FormatError(_why_unresolved(authored))
            self.images.append(self._image(authored, resolved))
            self._numbers[resolved] = len(self.images) - 1
        return self._numbers[resolved]

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
        return "no file is named"
    if "<UDIM>" in authored:
        return f"{authored[:200]!r} is of many tiles"
    return f"{authored[:200]!r} is not there"
