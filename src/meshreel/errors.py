"""Exceptions of meshreel; a message names the value, what is allowed and what to do."""

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from typing import Any, Self


@dataclass(frozen=True)
class Keyword:
    """A keyword argument that a message names; the command line shows its option instead."""

    name: str
    value: str | bool | None = None
    """What to pass, such as ``order="drop"``."""

    def __str__(self) -> str:
        if self.value is None:
            return self.name
        return f"{self.name}={self.value}" if self.value is True else f'{self.name}="{self.value}"'


class Message(str):
    """Text, and the keywords in it."""

    parts: tuple[str | Keyword, ...]

    def __new__(cls, *parts: str | Keyword) -> Self:
        """Join the parts."""
        message = super().__new__(cls, "".join(map(str, parts)))
        message.parts = parts
        return message

    def __getnewargs__(self) -> tuple[Any, ...]:
        return self.parts

    @classmethod
    def prefixed(cls, prefix: str, text: str) -> "Message":
        """The text after a prefix, with its keywords."""
        return cls(prefix, *parts_of(text))

    def naming(self, name_of: Callable[[Keyword], str]) -> str:
        """The text with other names for the keywords."""
        return "".join(name_of(part) if isinstance(part, Keyword) else part for part in self.parts)


def parts_of(text: str) -> tuple[str | Keyword, ...]:
    """The parts of a message; plain text is one."""
    return text.parts if isinstance(text, Message) else (text,)


MAX_PART = 2000
"""Maximum number of characters of a part of a message: files may contain names of any length."""


class MeshReelError(Exception):
    """Base class of all errors that meshreel raises.

    Parameters
    ----------
    *parts : str or Keyword
        The message in parts.
    message : str, optional
        The whole message instead; PyTorch's `DataLoader` passes it to re-raise a worker's error.
    path : str or Path, optional
        The faulty file, with which the message begins; `args` do not contain it.
    """

    def __init__(
        self, *parts: str | Keyword, message: str = "", path: str | PathLike[str] = ""
    ) -> None:
        shortened = (
            f"{part[: MAX_PART // 2]} ... {part[-MAX_PART // 4 :]}"
            if isinstance(part, str) and len(part) > MAX_PART
            else part
            for part in parts
        )
        super().__init__(*(shortened if parts else (message,)))
        self.path: str = str(path)

    @property
    def message(self) -> Message:
        """The message, with the path."""
        return Message(*([f"{self.path}: "] if self.path else []), *self.args)

    def __str__(self) -> str:
        return str(self.message)


class InvalidInputError(MeshReelError, ValueError):
    """An argument or a mesh sequence that cannot be used as given."""


class MissingTrackError(InvalidInputError, KeyError):
    """A track that a file or a sequence does not have."""


class MissingFrameError(MeshReelError, IndexError):
    """A frame that a file or a sequence does not have."""


class ConnectivityChangeError(InvalidInputError):
    """A sequence whose faces change where constant connectivity is needed."""


class FormatError(MeshReelError):
    """A file of another program that cannot be read or written."""


class CorruptStreamError(MeshReelError):
    """A `.reel` stream whose bytes are inconsistent or do not match their checksums."""


class TruncatedStreamError(CorruptStreamError):
    """A `.reel` stream that ends before its end marker."""


class UnsupportedVersionError(MeshReelError):
    """A `.reel` stream that needs a newer version of meshreel."""


class MemoryLimitError(MeshReelError):
    """A `.reel` stream whose decoding would exceed the memory limit."""


class SolverError(MeshReelError):
    """A reconstruction system that has no unique solution."""


class WorkerDiedError(MeshReelError):
    """Work that was abandoned because its worker processes died."""


class OutputError(MeshReelError, OSError):
    """A file that cannot be written any further, because of a full disk for instance."""


class StoreError(MeshReelError):
    """A remote file that does not exist, or cannot be read or written."""
