"""Figures of a sequence or a file as text."""

from collections.abc import Mapping
from html import escape

from meshreel.codec.inspect import StreamInfo
from meshreel.codec.reel_file import ReelFile
from meshreel.model.sequence import MeshSequence

Rows = dict[str, str]


def sequence_rows(sequence: MeshSequence) -> Rows:
    """Figures of a sequence."""
    return {
        "frames": _frames(sequence.n_frames, sequence.fps),
        "vertices": f"{sequence.n_verts:,}",
        "faces": f"{sequence.n_faces:,}",
        "positions": f"{sequence.dtype}, {_size(sequence.raw_size_bytes)} with faces",
    }


def stream_rows(info: StreamInfo) -> Rows:
    """Figures of a stream."""
    raw = _size(info.raw_size_bytes)
    rows = {
        "frames": _frames(info.n_frames, info.fps),
        "vertices": f"{info.n_verts:,}",
        "faces": f"{info.n_faces:,}",
        "file": f"{_size(info.size_bytes)}, {info.ratio:.0f} x smaller than {raw}",
        "rate": f"{info.rate_bpvf:.3f} bits per vertex and frame",
    }
    if info.is_lossless:
        rows["error bound"] = "lossless: positions are equal bit for bit"
    elif info.max_error_percent:
        rows["error bound"] = f"{info.max_error_percent:g} % of the diagonal, at every vertex"
    if not info.is_whole:
        rows["end"] = "truncated; the figures describe the complete blocks"
    return rows


def rows_of(animation: MeshSequence | ReelFile) -> Rows:
    """Figures of a sequence or a file."""
    if isinstance(animation, ReelFile):
        return stream_rows(animation.info())
    return sequence_rows(animation)


def heading_and_rows(name: str, rows: Mapping[str, str]) -> str:
    """HTML of a name and a line of figures."""
    items = " · ".join(f"<b>{escape(row)}</b> {escape(text)}" for row, text in rows.items())
    heading = f"<b>{escape(name)}</b><br>" if name else ""
    return f'<div style="font: 13px/1.5 sans-serif; margin: 2px 0 6px">{heading}{items}</div>'


def _frames(n_frames: int, fps: float) -> str:
    return f"{n_frames:,} at {fps:g} fps" if fps else f"{n_frames:,}"


def _size(size_bytes: int) -> str:
    for unit, name in ((1e9, "GB"), (1e6, "MB"), (1e3, "kB")):
        if size_bytes >= unit:
            return f"{size_bytes / unit:.1f} {name}"
    return f"{size_bytes} bytes"
