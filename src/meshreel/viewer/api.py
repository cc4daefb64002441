"""Answers to the requests of the page: JSON, and packets of arrays."""

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from meshreel.codec.inspect import StreamInfo
from meshreel.codec.reel_file import ReelFile
from meshreel.errors import InvalidInputError
from meshreel.metrics.heat import HEATS
from meshreel.surface import Domain, Kind, Surface
from meshreel.viewer.block_packets import block_packet
from meshreel.viewer.comparison import Comparison
from meshreel.viewer.extent import reach_of
from meshreel.viewer.measuring import Measured, Measuring
from meshreel.viewer.modes import n_fields
from meshreel.viewer.packets import packet
from meshreel.viewer.rounding import rounded_to, two_digits

Rows = Mapping[str, str]
"""Names and figures in words, as the command line prints them."""

KEPT_HEAT_BYTES = 1 << 26
LEAST_KEPT_HEATS = 8

SMALLEST_DIAGONAL, LARGEST_DIAGONAL = 1e-30, 1e30
"""Of what can be drawn: graphics cards count in float32."""

JSON = "application/json"
BINARY = "application/octet-stream"


@dataclass(frozen=True)
class Answer:
    """The answer to a path: its content type, and the bytes."""

    content_type: str
    body: bytes


class Api:
    """Answers of one player. Blocks and heat maps are made when they are asked for.

    Several threads may share one.

    Parameters
    ----------
    reel : ReelFile
    name : str
        To show, if the stream has none of its own.
    rows_of : callable
        Gives figures of the stream in words.
    comparison : Comparison, optional
        With the original.
    measured_rows : callable, optional
        Gives the errors of all frames in words.
    allowed_error : float, default 0
        How far rounding may move a vertex, in diagonals: as in `block_packet`, and of the original
        too, whose heat maps have two digits then. 0: all is as fine as it can be.

    Raises
    ------
    InvalidInputError
        If the model is too large or too small to be drawn.
    CorruptStreamError
        If the first block is damaged.
    """

    def __init__(
        self,
        reel: ReelFile,
        name: str,
        rows_of: Callable[[StreamInfo], Rows],
        comparison: Comparison | None = None,
        measured_rows: Callable[[Measured], Rows] = lambda _: {},
        allowed_error: float = 0.0,
    ) -> None:
        diagonal = reel.frame.scale
        if not SMALLEST_DIAGONAL <= diagonal <= LARGEST_DIAGONAL:
            raise InvalidInputError(
                f"the model is {diagonal:.3g} units large; the player draws from "
                f"{SMALLEST_DIAGONAL:g} to {LARGEST_DIAGONAL:g}: scale it before it is encoded"
            )
        self.reel, self.comparison, self.info = reel, comparison, reel.info()
        self._name, self._rows, self._measured_rows = name, rows_of(self.info), measured_rows
        self._allowed_error = allowed_error
        self._reach = reach_of(reel)
        self.measuring = None if comparison is None else Measuring(comparison)
        n_kept = max(LEAST_KEPT_HEATS, KEPT_HEAT_BYTES // (4 * reel.n_verts))
        self._heat = lru_cache(maxsize=n_kept)(self._new_heat)

    def answer(self, path: str) -> Answer | None:
        """The answer to a path such as "api/block/0"; None if there is no such thing.

        Raises
        ------
        MeshReelError, OSError
            If a frame or block cannot be decoded or read.
        """
        if path == "api/reel":
            return _json(self.described())
        if path == "api/faces":
            return Answer(BINARY, self.faces())
        if path == "api/plots" and self.measuring:
            return _json(self.plots())
        found = re.fullmatch(r"api/(block|original|heat/([a-z]+))/([0-9]{1,9})", path)
        body = found and self._numbered(found[1], found[2] or "", int(found[3]))
        return Answer(BINARY, body) if body else None

    def _numbered(self, what: str, kind: str, number: int) -> bytes | None:
        if what == "block":
            return self.block(number) if number < len(self.reel.starts) - 1 else None
        if self.comparison is None or number >= self.reel.n_frames:
            return None
        if what == "original":
            return self.original(number)
        return self._heat(kind, number) if kind in HEATS else None

    def described(self) -> dict[str, Any]:
        """Facts of the file that the page needs before anything else."""
        reel, reach = self.reel, self._reach
        origin = np.array(reel.frame.origin)
        return {
            "name": reel.name or self._name,
            "n_frames": reel.n_frames,
            "n_verts": reel.n_verts,
            "n_faces": reel.n_faces,
            "fps": reel.fps,
            "start_s": reel.start_s,
            "origin": list(reel.frame.origin),
            "low": reach.low.tolist(),
            "high": reach.high.tolist(),
            "swept": (reach.swept - origin).tolist(),
            "diagonal": reel.frame.scale,
            "up": "y",
            "is_whole": reel.is_whole,
            "blocks": self._blocks(),
            "rows": [list(row) for row in self._rows.items()],
            "budget": [list(row) for row in self.info.budget_bytes.items()],
            "original": self._original(),
        }

    def plots(self) -> dict[str, Any]:
        """Errors of all frames, once they are measured, and how far that is."""
        assert self.measuring is not None  # asked for only with an original
        measuring = self.measuring
        is_ready, figures = measuring.is_ready, measuring.figures
        rows = self._measured_rows(figures.measured) if is_ready else {}
        return {
            "ready": is_ready,
            "share": measuring.share,
            "error": measuring.error,
            "heats": figures.described_heats(),
            "plots": figures.plots() if is_ready else [],
            "rows": [list(row) for row in rows.items()],
            "worst_frame": figures.worst_frame if is_ready else None,
        }

    def faces(self) -> bytes:
        """Triangles, and colours of vertices if there are some."""
        arrays: dict[str, npt.NDArray[Any]] = {"faces": self.reel.faces.astype(np.uint32)}
        colors = vertex_colors(self.reel.surface)
        return packet(arrays if colors is None else {**arrays, "colors": colors})

    def block(self, number: int) -> bytes:
        """A block of frames."""
        return block_packet(self.reel.block(number), self._allowed_error)

    def original(self, number: int) -> bytes:
        """Positions of a frame of the original."""
        assert self.comparison is not None  # asked for only with an original
        positions = self.comparison.original.frame(number) - np.array(self.reel.frame.origin)
        if self._allowed_error:
            positions = rounded_to(positions, self._allowed_error * self.reel.frame.scale)
        return packet({"positions": positions.astype(np.float32)})

    def heat(self, kind: str, number: int) -> bytes:
        """Values of a heat map at the vertices of a frame."""
        return self._heat(kind, number)

    def _new_heat(self, kind: str, number: int) -> bytes:
        assert self.comparison is not None  # asked for only with an original
        values = self.comparison.heat(kind, self.comparison.pair(number)).astype(np.float32)
        return packet({"values": two_digits(values) if self._allowed_error else values})

    def _blocks(self) -> list[dict[str, int]]:
        info = self.info
        return [
            {
                "start": start,
                "n_frames": info.block_frames[number],
                "n_modes": n_fields(info, number),
                "size_bytes": info.block_bytes[number],
            }
            for number, start in enumerate(self.reel.starts[:-1])
        ]

    def _original(self) -> dict[str, Any] | None:
        if self.comparison is None:
            return None
        errors = self.plots()
        return {
            "name": self.comparison.original.name,
            "diagonal": self.comparison.reference.diagonal,
            **{key: errors[key] for key in ("heats", "plots", "rows", "worst_frame")},
        }


def vertex_colors(surface: Surface) -> npt.NDArray[np.uint8] | None:
    """Colours of shape (V, 3) or (V, 4), of the first attribute that gives some to vertices."""
    for one in surface.attributes:
        if one.kind is Kind.COLOR and one.domain is Domain.VERTEX:
            values = one.per_item()
            if values.dtype != np.uint8:
                values = np.rint(255 * np.nan_to_num(values).clip(0, 1))
            return values.astype(np.uint8)
    return None


def _json(value: Mapping[str, Any]) -> Answer:
    return Answer(JSON, json.dumps(finite(value), allow_nan=False).encode())


def finite(value: Any) -> Any:
    """The value as JSON can hold it: numbers that are not finite become null."""
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [finite(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
