"""Figures of streams and of quality, as text for tables."""

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import TYPE_CHECKING

from meshreel.errors import Message
from meshreel.kernel.mp4 import MediaTrack
from meshreel.runtime.counting import change_text, counted, counts_text, size_text

if TYPE_CHECKING:
    from meshreel.app.viewer.measuring import MeasuredErrors
    from meshreel.codec.achieved import Achieved
    from meshreel.codec.inspect import StreamInfo
    from meshreel.formats.inspection import MeshInfo
    from meshreel.metrics.compare import Quality
    from meshreel.metrics.surface_distance import SurfaceDistances, SurfaceQuality
    from meshreel.metrics.track_errors import TrackErrors

Cell = str | list[str]
"""Text of a table cell, or its lines."""

STED = "shape of edges (STED)"
"""Name of the error that the default is tuned for."""

SEGMENT_HEADINGS = ("segment", "frames", "vertices", "faces", "size")
MAX_SEGMENTS = 12
"""Maximum number of segments in the table."""


def size_rows(stream: "StreamInfo", n_meshes: int | None = None) -> dict[str, str]:
    """Raw size, file size, ratio and rate; parameters as in `mesh_text`."""
    without_images = ", without images" if stream.image_bytes else ""
    return {
        "sequence": mesh_text(stream, len(stream.segments), n_meshes),
        "method": method_text(stream),
        "raw": size_text(stream.raw_size_bytes),
        **media_rows(stream),
        "ratio": change_text(stream.raw_size_bytes, stream.geometry_bytes) + without_images,
        "rate": f"{stream.rate_bpvf:.3f} bits per vertex and frame{without_images}",
    }


def _size_text(stream: "StreamInfo") -> str:
    """Size of a stream, and of its geometry and images if it has some."""
    total, images = size_text(stream.size_bytes), stream.image_bytes
    if not images:
        return total
    share = f"{size_text(images)} ({100 * images / stream.size_bytes:.0f} %)"
    return f"{total}: geometry {size_text(stream.geometry_bytes)}, images {share}"


def media_rows(stream: "StreamInfo") -> dict[str, str]:
    """Size of the file; of an MP4 file, sizes and rates of its geometry, video and sound."""
    if not stream.media:
        return {"file": _size_text(stream)}
    geometry = MediaTrack("geometry", ".reel", stream.size_bytes, stream.duration_s or 0.0)
    return {
        part.kind: f"{size_text(part.size_bytes)}, {part.mbit_per_s:.3g} Mbit/s, {part.codec}"
        for part in (geometry, *stream.media)
    }


PART_HEADINGS = ("part", "bound", "largest error", "bytes", "share")
PART_NAMES = {"order": "order of vertices and faces"}
"""Names of parts in the table, where they differ."""


def encoded_rows(
    stream: "StreamInfo", achieved: "Achieved", n_meshes: int, input_bytes: int | None
) -> "dict[str, Cell]":
    """Size of a stream relative to its input and to the raw values, and its measured errors."""
    change = change_text(stream.raw_size_bytes, stream.geometry_bytes)
    sizes = [f"{change} than the raw values, {size_text(stream.raw_size_bytes)}"]
    if stream.image_bytes:
        sizes[0] += ", without images"
    if input_bytes:
        change = change_text(input_bytes, stream.size_bytes)
        sizes.insert(0, f"{change} than the input, {size_text(input_bytes)}")
    rows, shape = size_rows(stream, n_meshes), {}
    largest = achieved.max_error_percent
    sted, angle = achieved.sted_spatial, achieved.normal_angle_mean_deg
    if sted is not None and angle is not None:
        sample = f"in {counted(achieved.n_shape_frames, 'frame')}"
        shape = {
            STED: f"{sted:.5f}: edges stretch unevenly, by {100 * sted:.2f} %; {sample}",
            "normal error": f"mean {angle:.2f} degrees, seen in shading; {sample}",
        }
    return {
        "size": [_size_text(stream), *sizes],
        **{name: rows[name] for name in ("sequence", "method", "rate")},
        "largest error": error_text(largest, stream.diagonal) if largest else "0",
        "overall error (KG error)": f"{achieved.kg_error_percent:.4f} % of the extent of the shape",
        **shape,
    }


def part_table(
    achieved: "Achieved", stream: "StreamInfo", origins: Mapping[str, str]
) -> list[Sequence[str]]:
    """Rows with columns as in `PART_HEADINGS`; `origins` is what set the bound of each track."""
    percent, allowed = achieved.max_error_percent, stream.error_bound_percent
    units = stream.diagonal / 100
    bound = f"{allowed:g} %, {allowed * units:.4g} u" if allowed else "none, see --bound"
    largest = f"{percent:.4f} %, {percent * units:.4g} u" if percent else "0"
    errors = {"positions": ("exact" if allowed == 0 else bound, largest)}
    for track in stream.tracks:
        measured = achieved.tracks[track.name]
        unit = f" {measured.unit}" if measured.unit else ""
        none = "exact" if track.is_exact else "none"
        bound = f"{track.bound:.4g}{unit}" if track.bound else none
        bound = Message.prefixed(f"{bound}, ", origins[track.name])
        largest = f"{measured.largest:.4g}{unit}" if measured.largest else "0"
        errors[f"track {track.name}"] = bound, largest
    return [
        (PART_NAMES.get(name, name), *errors.get(name, ("", "")), *_size_and_share(size, stream))
        for name, size in stream.part_bytes.items()
    ]


SECTION_HEADINGS = ("section", "bytes", "share")


def section_table(stream: "StreamInfo") -> list[Sequence[str]]:
    """Bytes by kind of section, with columns as in `SECTION_HEADINGS`."""
    return [(name, *_size_and_share(size, stream)) for name, size in stream.budget_bytes.items()]


def _size_and_share(size_bytes: int, stream: "StreamInfo") -> tuple[str, str]:
    return str(size_bytes), f"{100 * size_bytes / stream.size_bytes:.1f} %"


def track_error_rows(tracks: "dict[str, TrackErrors]") -> dict[str, str]:
    """Errors of tracks in their units."""
    rows = {}
    for name, errors in tracks.items():
        unit = f" {errors.unit}" if errors.unit else ""
        text = "exact"
        if errors.largest:
            text = f"largest error {errors.largest:.4g}{unit}, RMS {errors.rms:.4g}{unit}"
        rows[f"track {name}"] = text
    return rows


def uv_rows(error: float | None) -> dict[str, str]:
    """Error of quantized texture coordinates for a table; none if they are exact or absent."""
    if error is None:
        return {}
    return {
        "texture coordinates": f"largest error {error:.2g} of the texture width, "
        f"{error * 4096:.3g} texels at width 4096"
    }


def info_rows(stream: "StreamInfo") -> "dict[str, Cell]":
    """Contents of a stream and of its header."""
    rows: dict[str, Cell] = {
        "name": stream.name or "-",
        **size_rows(stream),
        **timing_rows(stream),
        "positions": stream.vertex_type,
        "Laplacian": stream.laplacian,
        "order": stream.order,
    }
    rows |= surface_rows(stream)
    if len(stream.segments) == 1 and len(stream.block_frames) > 1:
        rows["blocks"] = (
            f"{len(stream.block_frames)} of up to {counted(max(stream.block_frames), 'frame')}"
        )
        later = sum(stream.block_bytes[1:])
        rows["later blocks"] = (
            f"{size_text(later)}, {100 * later / stream.size_bytes:.0f} % of the file; "
            "a single block would save most of that"
        )
    if stream.tracks:
        rows["tracks"] = [f"{track}, {size_text(track.size_bytes)}" for track in stream.tracks]
    if not stream.is_whole:
        rows["end"] = "truncated; the figures describe the complete blocks"
    percent = stream.error_bound_percent
    if percent:
        length = f"{percent / 100 * stream.diagonal:.4g} model units"
        source = "; lossless, of a lossy source" if stream.is_lossless else ""
        rows["error bound"] = f"{percent:g} % of the diagonal, {length}, at every vertex{source}"
    elif stream.is_lossless:
        rows["error bound"] = "lossless: positions are equal bit for bit"
    return rows


def segment_table(stream: "StreamInfo") -> list[Sequence[str]]:
    """Rows of the table of segments, with columns as in `SEGMENT_HEADINGS`."""
    rows: list[Sequence[str]] = [
        (
            str(number),
            f"{segment.first_frame} to {segment.first_frame + segment.n_frames - 1}",
            str(segment.n_verts),
            str(segment.n_faces),
            size_text(segment.size_bytes),
        )
        for number, segment in enumerate(stream.segments[:MAX_SEGMENTS])
    ]
    if (n_more := len(stream.segments) - MAX_SEGMENTS) > 0:
        rows.append((f"and {n_more} more; --json lists all", "", "", "", ""))
    return rows


def surface_rows(info: "StreamInfo | MeshInfo") -> "dict[str, Cell]":
    """Start, polygons, attributes, parts and materials of a stream or a mesh, if any."""
    rows: dict[str, Cell] = {}
    if info.start_s:
        rows["starts at"] = f"{info.start_s:.6g} s"
    if info.n_polygons != info.n_faces:
        rows["polygons"] = f"{info.n_polygons}, cut into triangles"
    lists = {
        "attributes": info.attributes,
        "parts": info.parts,
        "materials": info.materials,
        "images": info.images,
    }
    return rows | {name: list(texts) for name, texts in lists.items() if texts}


def quality_rows(quality: "Quality") -> dict[str, str]:
    """Quality figures with their units."""
    rest = "no vertex rests"
    if quality.n_rest_pairs:
        rest = (
            f"median {quality.rest_motion_median_percent:.4f} % of the model size, "
            f"99th percentile {quality.rest_motion_p99_percent:.4f} %, over "
            f"{counted(quality.n_rest_pairs, 'pair')} of vertex and frame"
        )
    return {
        "KG error": f"{quality.kg_error_percent:.4f} %",
        STED: f"{quality.sted:.5f}  (spatial {quality.sted_spatial:.5f}, "
        f"temporal {quality.sted_temporal:.5f})",
        "NMSVE, mean": f"{quality.nmsve_mean:.3e}",
        "largest error": error_text(quality.max_error_percent, quality.diagonal),
        "RMS error": f"{quality.rms_error_percent:.4f} % of the diagonal",
        "normal error": f"mean {quality.normal_angle_mean_deg:.2f} degrees, "
        f"95th percentile {quality.normal_angle_p95_deg:.2f}",
        "motion at rest": rest,
        **track_error_rows(quality.tracks),
    }


def distance_rows(quality: "SurfaceQuality") -> dict[str, str]:
    """Distances between surfaces with their units; the larger one of both directions first."""
    worse, errors, of_vertices = quality.worse, quality.vertex_errors, {}
    if errors is not None:  # vertices correspond, although surfaces are compared
        of_vertices = {
            "KG error of vertices": f"{errors.kg_error_percent:.4f} %",
            "largest error of a vertex": f"{errors.max_error_percent:.4f} % of the diagonal",
        }
    return {
        "compared": f"surfaces: {quality.reason}",
        "surface PSNR": _psnr_text(quality.psnr_db),
        "D1 PSNR": _psnr_text(quality.d1_psnr_db),
        "D2 PSNR": _psnr_text(quality.d2_psnr_db),
        "mean distance": error_text(worse.mean_percent, quality.diagonal),
        "95th percentile": error_text(worse.p95_percent, quality.diagonal),
        "largest distance": error_text(worse.max_percent, quality.diagonal),
        "original to decoded": _distances_text(quality.to_decoded),
        "decoded to original": _distances_text(quality.to_original),
        "normal error": f"mean {worse.normal_angle_mean_deg:.2f} degrees, "
        f"95th percentile {worse.normal_angle_p95_deg:.2f}",
        **of_vertices,
        "samples": f"{counted(quality.n_samples, 'point')} per surface and frame",
        "grid of D1 and D2": f"{quality.n_grid_lines} lines along the longest side",
    }


def _psnr_text(psnr_db: float) -> str:
    """A PSNR in decibels."""
    return f"{psnr_db:.2f} dB" if isfinite(psnr_db) else "infinite: no difference"


def _distances_text(distances: "SurfaceDistances") -> str:
    """Distances of one direction, in percent of the diagonal."""
    return (
        f"mean {distances.mean_percent:.4f} %, p95 {distances.p95_percent:.4f} %, "
        f"largest {distances.max_percent:.4f} %"
    )


def error_text(percent: float, diagonal: float) -> str:
    """A distance in percent of the diagonal and in model units."""
    return f"{percent:.4f} % of the diagonal, {percent / 100 * diagonal:.4g} model units"


PLAYER_ROWS = (
    "sequence", "method", "raw", "file", "geometry", "video", "sound", "ratio", "rate",
    "frame rate", "parts", "error bound", "end",
)  # fmt: skip
"""Rows of `info_rows` that the player shows."""


def player_rows(stream: "StreamInfo") -> dict[str, str]:
    """Figures of a file for the player."""
    rows = info_rows(stream)
    shown = {name: rows[name] for name in PLAYER_ROWS if name in rows}
    return {name: row if isinstance(row, str) else "\n".join(row) for name, row in shown.items()}


def measured_rows(measured: "MeasuredErrors") -> dict[str, str]:
    """Errors of a file for the player, whose visitors may not know the abbreviations."""
    errors = measured.errors
    return {
        "largest error": f"{errors.max_error_percent:.4f} % of the diagonal",
        "RMS error": f"{errors.rms_error_percent:.4f} % of the diagonal",
        "overall error (KG error)": f"{errors.kg_error_percent:.4f} %",
        STED: f"{measured.sted_spatial:.5f} (spatial part)",
        "visual error, mean (NMSVE)": f"{measured.nmsve_mean:.3e}",
    }


def mesh_text(
    info: "StreamInfo | MeshInfo", n_segments: int = 1, n_meshes: int | None = None
) -> str:
    """Numbers of frames, segments, vertices, faces and cells.

    Parameters
    ----------
    n_meshes : int, optional
        Number of distinct meshes, shown if segments share some.
    """
    if n_segments > 1:
        is_shared = n_meshes is not None and n_meshes < n_segments
        meshes = f" with {counted(n_meshes or 0, 'distinct mesh')}" if is_shared else ""
        return (
            f"{counted(info.n_frames, 'frame')} in {n_segments} segments{meshes}, up to "
            f"{counted(info.n_verts, 'vertex')} and {counted(info.n_faces, 'face')}"
        )
    counts = counts_text(frame=info.n_frames, vertex=info.n_verts, face=info.n_faces)
    return ", ".join([counts, *info.cells])


def timing_rows(info: "StreamInfo | MeshInfo") -> "dict[str, Cell]":
    """Duration, and frame rate or times of frames that are not evenly spaced."""
    fps, times, seconds = info.fps, info.times, info.duration_s
    duration = "unknown" if seconds is None else f"{seconds:.4g} s"
    if times is None:
        return {"frame rate": f"{fps:g} fps" if fps else "unknown", "duration": duration}
    text = f"{times[0]:.6g} to {times[-1]:.6g} s, uneven; on average {fps:.6g} fps"
    return {"times": text, "duration": duration}


def method_text(stream: "StreamInfo") -> str:
    """The method of a stream, with its number of modes if it has any."""
    return f"{stream.method}, {modes_text(stream)}" if any(stream.n_modes) else stream.method


def modes_text(stream: "StreamInfo") -> str:
    """Number of modes, or its range over all blocks."""
    low, high = min(stream.n_modes), max(stream.n_modes)
    return counted(high, "mode") if low == high else f"{low} to {high} modes"
