"""Storage of registered frames while others are registered: temporary files, or a folder.

Neither needs much memory; a folder keeps finished runs, after which another call continues.
"""

import json
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.model.sequence import Vertices
from meshreel.registration.tracking import State
from meshreel.registration.verification import FrameErrors
from meshreel.runtime.threads import fork_safe_lock
from meshreel.runtime.version import __version__

IDENTITY = "registration.json"
"""Name of the file that identifies the registration that a folder belongs to."""

POSITIONS = "positions"
"""Name of the array of a segment that stays in a file, of shape (T, V, 3)."""

Arrays = dict[str, npt.NDArray[Any]]
"""The arrays of a segment by name."""


@dataclass
class Course:
    """The frames that were followed from a key in one direction.

    Attributes
    ----------
    state : State
        State of the tracker at the last of them.
    errors : list of FrameErrors
    n_folded : list of int
        Faces that fold over.
    reason : str
        Why the next frame could not be followed; empty if it was not tried.
    excess : float
        The smallest error of that frame in all attempts, in tolerances.
    """

    state: State
    errors: list[FrameErrors] = field(default_factory=list)
    n_folded: list[int] = field(default_factory=list)
    reason: str = ""
    excess: float = 0.0


class TemporaryStore:
    """Registered frames in temporary files, which vanish with the arrays read from them."""

    is_resumed = False
    """Whether an earlier run registered some of the frames."""

    def __init__(self) -> None:
        self._lock = fork_safe_lock()
        self._files: dict[str, tuple[IO[bytes], np.dtype[np.floating], tuple[int, ...]]] = {}

    def close(self) -> None:
        """Close the files of frames that were not read."""
        for file, _, _ in self._files.values():
            file.close()

    def put(self, key: str, number: int, positions: Vertices) -> None:
        """Store a registered frame of a key, at its place in the file of the key."""
        with self._lock:
            if key not in self._files:
                created = TemporaryFile(prefix="meshreel-")  # noqa: SIM115
                self._files[key] = created, positions.dtype, positions.shape
            file, _, _ = self._files[key]
            file.seek(number * positions.nbytes)
            file.write(positions.tobytes())

    def stack(self, key: str, numbers: range) -> Vertices:
        """Return consecutive frames of a key as one array of shape (T, V, 3), and drop them."""
        (file, dtype, shape) = self._files.pop(key)
        offset = numbers.start * math.prod(shape) * dtype.itemsize
        with file:
            file.flush()
            return np.asarray(np.memmap(file, dtype, "r", offset, (len(numbers), *shape)))

    def keep(self, name: str, segments: Sequence[Arrays]) -> list[Arrays]:
        """Store segments; return them with their positions in files."""
        return [
            {**arrays, POSITIONS: self._stored(f"{name}_{number}", arrays[POSITIONS])}
            for number, arrays in enumerate(segments)
        ]

    def _stored(self, name: str, positions: Vertices) -> Vertices:
        for number, frame in enumerate(positions):
            self.put(name, number, frame)
        # There are none if the first frame of a join does not follow the key.
        return self.stack(name, range(len(positions))) if len(positions) else positions

    def kept(self, name: str) -> list[Arrays] | None:
        """Return the segments that an earlier registration kept; None if it did not."""
        return None


class FolderStore(TemporaryStore):
    """Registered frames in temporary files, and finished runs in a folder, which is created.

    Parameters
    ----------
    folder : Path
    digest : str
        Digest of the raw frames and the options. A folder with the same one is reused.

    Raises
    ------
    InvalidInputError
        If the folder contains something else, or another registration.
    """

    def __init__(self, folder: Path, digest: str) -> None:
        super().__init__()
        self._folder = folder
        identity = {"version": __version__, "digest": digest}
        identity_path = folder / IDENTITY
        if not identity_path.exists():
            if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
                raise InvalidInputError(
                    f"{str(folder)!r} exists and is no folder of a registration; move it, or use "
                    "another name"
                )
            folder.mkdir(parents=True, exist_ok=True)
            with _replacing(identity_path) as partial:
                partial.write_text(json.dumps(identity))
        elif json.loads(identity_path.read_bytes()) != identity:
            raise InvalidInputError(
                f"{str(folder)!r} contains an unfinished registration of other frames, with "
                "another tolerance, or by another version; remove it, or use another name"
            )

    def keep(self, name: str, segments: Sequence[Arrays]) -> list[Arrays]:
        """Store segments; return them with their positions in files."""
        kept = super().keep(name, segments)
        others = {
            f"{number}_{key}": array
            for number, arrays in enumerate(segments)
            for key, array in arrays.items()
            if key != POSITIONS
        }
        with _replacing(self._folder / f"{name}.npz") as partial, partial.open("wb") as file:
            np.savez(file, allow_pickle=False, **others)
        return kept

    def _stored(self, name: str, positions: Vertices) -> Vertices:
        np.save(self._folder / f"{name}.npy", positions)
        return self._load(name)

    def _load(self, name: str) -> Vertices:
        return np.asarray(np.load(self._folder / f"{name}.npy", mmap_mode="r"))

    def kept(self, name: str) -> list[Arrays] | None:
        """Return the segments that an earlier registration kept; None if it did not."""
        path = self._folder / f"{name}.npz"
        if not path.exists():
            return None
        segments: dict[str, Arrays] = {}
        with np.load(path, allow_pickle=False) as archive:
            for place, array in archive.items():
                number, _, key = place.partition("_")
                arrays = segments.setdefault(number, {POSITIONS: self._load(f"{name}_{number}")})
                arrays[key] = array
        self.is_resumed = True
        return [*segments.values()]


@contextmanager
def _replacing(path: Path) -> Iterator[Path]:
    """Context manager for a path whose file replaces this one once it is complete."""
    partial = path.with_suffix(".partial")
    yield partial
    partial.replace(path)
