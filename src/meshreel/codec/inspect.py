"""Description of a stream, without decoding more than its first frame."""

from collections import Counter
from collections.abc import Hashable, Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

from meshreel.codec.bitstream.layout import SURFACE_SECTIONS, Section
from meshreel.codec.displaced import motion_notes
from meshreel.codec.memory import DEFAULT_LIMIT, MemoryLimit
from meshreel.codec.method_names import LOSSLESS
from meshreel.codec.open_stream import OpenStream, timing_of, whole_file
from meshreel.codec.surface.codes import DOMAINS
from meshreel.codec.tracks import KINDS
from meshreel.kernel.files import OpenFile
from meshreel.kernel.mp4 import MediaTrack
from meshreel.model.notes import Note, NoteKind
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface_description import SURFACE_TEXTS, describe_surface
from meshreel.model.timing import duration_s
from meshreel.model.tracks import TrackKind, describe_values, error_bound_of, error_unit
from meshreel.runtime.counting import change_text, counted

CONNECTIVITY = (Section.CONNECTIVITY, Section.EDIT, Section.CELLS, Section.REFERENCE)
POSITIONS = (Section.ANCHOR_VERTICES, Section.SHAPE, Section.ERROR_BOUND)
"""Sections of the positions, except their blocks."""

DERIVED = ("image_bytes", "ratio", "rate_bpvf", "duration_s")
"""Properties of `StreamInfo` in its JSON."""


@dataclass(frozen=True)
class TrackInfo:
    """A track of a stream.

    Attributes
    ----------
    number_type : str
        For example "float32".
    is_exact : bool
        Whether its numbers are lossless.
    bound : float
        Guaranteed largest error of a value relative to the original, in its unit; in degrees for
        normals. 0: none, or the track is exact, of an original.
    size_bytes : int
        Size of its sections in all blocks, and of its section TRACK.
    raw_size_bytes : int
        Size of the decoded values.
    """

    name: str
    kind: str
    domain: str
    unit: str
    number_type: str
    n_columns: int
    is_exact: bool
    bound: float
    size_bytes: int
    raw_size_bytes: int

    def __str__(self) -> str:
        accuracy = "exact" if self.is_exact else "no bound"
        if self.bound:
            unit = error_unit(TrackKind(self.kind), self.unit)
            accuracy = f"within {self.bound:.4g} {unit}".rstrip()
        values = self.kind, self.domain, self.n_columns, self.number_type, self.unit
        return f"{self.name}: {describe_values(*values)}, {accuracy}"


@dataclass(frozen=True)
class SegmentInfo:
    """A segment: an animated mesh of constant connectivity.

    Attributes
    ----------
    first_frame : int
        Its number in the stream.
    """

    first_frame: int
    n_frames: int
    n_verts: int
    n_faces: int
    size_bytes: int


@dataclass(frozen=True)
class StreamInfo:
    """Header, modes and sizes of a stream, or of one of its segments.

    For several segments, frames and bytes are sums, vertices, faces, polygons, diagonal and error
    bounds are the maxima, tuples of blocks are concatenated, and attributes, parts, materials,
    images and tracks that are alike in several segments are listed once.

    Attributes
    ----------
    n_frames, n_verts, n_faces : int
    fps : float
        0 = unknown.
    name, method, laplacian, order : str
    vertex_type : str
        "float32" or "float64".
    n_modes : tuple of int
        Modes of each block (per axis, if axes have separate modes); 0 in a lossless stream.
    block_frames : tuple of int
        Frames of each block.
    size_bytes : int
        Size of the whole stream.
    raw_size_bytes : int
        Size of the decoded arrays.
    budget_bytes : dict of str to int
        Bytes of the header and of each kind of section; they sum to `size_bytes`.
    part_bytes : dict of str to int
        Bytes of "positions", "connectivity", "order" (of vertices and faces), "surface" (polygons,
        attributes, groups, parts, materials), "images", each "track NAME" and the "container", with
        truncated blocks; they sum to `size_bytes`. Parts of 0 bytes are omitted.
    block_bytes : tuple of int
        Size of the sections of the positions in each block.
    error_bound_percent : float or None
        Guaranteed largest distance of vertices from the original, in percent of the diagonal. If
        the source was decoded from a lossy file that guarantees a bound, this includes that bound.
    is_lossless : bool
        Whether positions are those of the source.
    is_whole : bool
        False if the end is missing: the other attributes then describe the complete blocks.
    start_s : float
        Time of the first frame, in seconds.
    times : tuple of float, or None
        Time of each frame in seconds, if they are not evenly spaced; `fps` is then the mean rate.
    n_polygons : int
        Number of faces before triangulation.
    cells : tuple of str
        Cells of a volume mesh by type, for example "15360 hexahedra"; their surface are the faces.
    attributes : tuple of str
        Attributes and groups of the mesh, for example "uv 'st' of corners".
    parts : tuple of str
        Names of the merged meshes.
    diagonal : float
        Diagonal of the bounding box of all frames (of the first block in a live recording), the
        unit of relative errors, in model units.
    materials : tuple of str
        Names of materials with their textures, for example "skin: base color image 0".
    images : tuple of str
        Descriptions of images, for example "0: 'shade', image/png, 92 bytes".
    tracks : tuple of TrackInfo
        Tracks other than the positions.
    segments : tuple of SegmentInfo
        At least one.
    media : tuple of MediaTrack
        Video and sound beside the stream in an MP4 file.
    """

    n_frames: int
    n_verts: int
    n_faces: int
    fps: float
    name: str
    method: str
    laplacian: str
    order: str
    vertex_type: str
    n_modes: tuple[int, ...]
    block_frames: tuple[int, ...]
    size_bytes: int
    raw_size_bytes: int
    budget_bytes: dict[str, int]
    part_bytes: dict[str, int]
    block_bytes: tuple[int, ...]
    error_bound_percent: float | None
    is_lossless: bool
    is_whole: bool
    start_s: float
    times: tuple[float, ...] | None
    n_polygons: int
    cells: tuple[str, ...]
    attributes: tuple[str, ...]
    parts: tuple[str, ...]
    diagonal: float
    materials: tuple[str, ...]
    images: tuple[str, ...]
    tracks: tuple[TrackInfo, ...]
    segments: tuple[SegmentInfo, ...]
    media: tuple[MediaTrack, ...] = ()

    @property
    def image_bytes(self) -> int:
        """Bytes of the images of materials."""
        return self.part_bytes.get("images", 0)

    @property
    def geometry_bytes(self) -> int:
        """Bytes of the stream without images."""
        return self.size_bytes - self.image_bytes

    @property
    def ratio(self) -> float:
        """Raw size divided by the size of the stream without images."""
        return self.raw_size_bytes / self.geometry_bytes

    @property
    def rate_bpvf(self) -> float:
        """Bits of the stream without images, per vertex and frame."""
        n_positions = sum(segment.n_verts * segment.n_frames for segment in self.segments)
        return 8 * self.geometry_bytes / n_positions

    @property
    def duration_s(self) -> float | None:
        """Duration in seconds, as `meshreel.model.timing.duration_s`."""
        return duration_s(self.n_frames, self.fps, self.times)

    def __repr__(self) -> str:
        name = f" {self.name!r}" if self.name else ""
        cut = "" if self.is_whole else ", cut off"
        change = change_text(self.raw_size_bytes, self.geometry_bytes)
        images_text = f" with {self.image_bytes} of images" if self.image_bytes else ""
        segments_text = f" in {len(self.segments)} segments" if len(self.segments) > 1 else ""
        return (
            f"<StreamInfo{name}: {counted(self.n_frames, 'frame')}{segments_text}, "
            f"{counted(self.n_verts, 'vertex')}, {counted(self.n_faces, 'face')}, "
            f"{self.fps:g} fps, {self.vertex_type}; {self.method}, "
            f"{self.size_bytes} bytes{images_text}, {change}, {self.rate_bpvf:.3g} bpvf{cut}>"
        )

    def as_dict(self) -> dict[str, Any]:
        """The attributes as plain types, for JSON."""
        derived = {name: getattr(self, name) for name in DERIVED}
        return {**asdict(self), **derived}


def info(data: bytes, segment: int | None = None) -> StreamInfo:
    """Describe a `.reel` stream: contents, and bytes by section.

    Parameters
    ----------
    data : bytes
    segment : int, optional
        Describe this segment alone.

    Raises
    ------
    InvalidInputError
        If the segment does not exist.
    CorruptStreamError, TruncatedStreamError, UnsupportedVersionError
        If the bytes are not a complete stream that this build reads.
    """
    return file_info(whole_file(bytes(data)), segment)


def bound_notes(
    sequence: MeshSequence, data: bytes, error_percent: float | None = None
) -> list[Note]:
    """Return notes on the bounds of a stream, if its source is lossy itself or moved by a track.

    `error_percent` is the measured error of positions; by default that of the bound.
    """
    if sequence.is_original:
        return []
    sources: dict[str, list[Any]] = {"positions": [*sequence.segments]}
    for segment in sequence.segments:
        for name, track in segment.tracks.items():
            sources.setdefault(f"track {name}", []).append(track)
    bounds = {name: error_bound_of(*parts) for name, parts in sources.items()}
    stream = info(data)
    stated = {f"track {track.name}" for track in stream.tracks if track.is_exact or track.bound}
    if stream.is_lossless or stream.error_bound_percent:
        stated.add("positions")
    added = [name for name in bounds if name in stated and bounds[name]]
    unknown = [name for name in bounds if name in stated and bounds[name] is None]
    texts = {
        "bounds include the error of the source, which is lossy itself": added,
        "bounds are relative to the source, which is lossy itself and guarantees none": unknown,
    }
    notes = [Note(NoteKind.RESULT, text, names) for text, names in texts.items() if names]
    percent = stream.error_bound_percent if error_percent is None else error_percent
    return notes + motion_notes(sequence, (percent or 0.0) / 100 * stream.diagonal)


def file_info(
    file: OpenFile,
    segment: int | None = None,
    limit: MemoryLimit = DEFAULT_LIMIT,
    *,
    is_remote: bool = False,
) -> StreamInfo:
    """Describe a file, or one of its segments; parameters and errors as in `stream_info`."""
    if segment is not None or file.info.n_segments == 1:
        return stream_info(OpenStream(file, limit, segment), is_remote=is_remote)
    segments: list[StreamInfo] = []
    surfaces: dict[Hashable, SurfaceProperties] = {}  # shared surfaces are decoded once
    for number in range(file.info.n_segments):
        opened = OpenStream(file, limit, number)
        segments.append(stream_info(opened, is_remote=is_remote, surfaces=surfaces))
        opened.file.close()
    return _combined(file, segments)


def _combined(file: OpenFile, segments: list[StreamInfo]) -> StreamInfo:
    """Combine the descriptions of all segments of a file."""

    def largest(name: str) -> Any:
        return max(getattr(segment, name) for segment in segments)

    def joined(name: str) -> Any:
        return tuple(item for segment in segments for item in getattr(segment, name))

    def distinct(name: str) -> Any:
        return tuple(dict.fromkeys(joined(name)))

    def joined_names(name: str) -> Any:
        return ", ".join(dict.fromkeys(getattr(segment, name) for segment in segments))

    budget, parts = Counter[str](), Counter[str]()
    for segment in segments:
        budget.update(segment.budget_bytes)
        parts.update(segment.part_bytes)
    size_bytes = file.info.size_bytes
    end_bytes = size_bytes - sum(segment.size_bytes for segment in segments)  # index and end marker
    budget["framing"] += end_bytes
    parts["container"] += end_bytes
    bounds = [segment.error_bound_percent for segment in segments]
    known_bounds = [bound for bound in bounds if bound is not None]
    timing = timing_of(file)
    return replace(
        segments[0],
        n_frames=file.info.n_frames,
        fps=timing.fps,
        times=timing.uneven_times,
        **{name: largest(name) for name in ("n_verts", "n_faces", "n_polygons", "diagonal")},
        **{name: joined_names(name) for name in ("method", "laplacian", "order", "vertex_type")},
        **{name: joined(name) for name in ("n_modes", "block_frames", "block_bytes")},
        **{name: distinct(name) for name in SURFACE_TEXTS},
        tracks=_combined_tracks(joined("tracks")),
        size_bytes=size_bytes,
        raw_size_bytes=sum(segment.raw_size_bytes for segment in segments),
        budget_bytes=dict(budget),
        part_bytes=dict(parts),
        error_bound_percent=max(known_bounds) if len(known_bounds) == len(bounds) else None,
        is_lossless=all(segment.is_lossless for segment in segments),
        is_whole=file.info.is_whole,
        segments=joined("segments"),
    )


def _combined_tracks(tracks: Iterable[TrackInfo]) -> tuple[TrackInfo, ...]:
    """Combine the descriptions of tracks that differ only in accuracy and bytes."""
    groups: dict[TrackInfo, list[TrackInfo]] = {}
    for track in tracks:
        key = replace(track, is_exact=False, bound=0.0, size_bytes=0, raw_size_bytes=0)
        groups.setdefault(key, []).append(track)
    return tuple(
        replace(
            key,
            is_exact=all(track.is_exact for track in group),
            bound=max(track.bound for track in group),
            size_bytes=sum(track.size_bytes for track in group),
            raw_size_bytes=sum(track.raw_size_bytes for track in group),
        )
        for key, group in groups.items()
    )


SurfaceProperties = dict[str, Any]
"""Attributes of `StreamInfo` that describe the surface, with its size."""


def stream_info(
    opened: OpenStream,
    *,
    is_remote: bool = False,
    surfaces: dict[Hashable, SurfaceProperties] | None = None,
) -> StreamInfo:
    """Describe a stream: contents, and bytes by section.

    Parameters
    ----------
    is_remote : bool, default False
        Read only short sections and the heads of others, without verifying checksums.
    surfaces : dict, optional
        Surfaces of earlier segments of the same file by their `mesh_key`; new ones are added.
    """
    file = opened.file
    # Raises if a section is in the wrong group, on which the sizes of blocks rely.
    groups = [
        [file.group(number, track, is_checked=False) for number in range(opened.n_blocks)]
        for track in range(1 + len(opened.tracks))
    ]
    header_bytes = file.info.size_bytes - file.offset
    section_bytes, track_bytes, block_bytes = Counter[Section](), list[int](), list[int]()
    position_ends = [block.offset + block.size_bytes for block in file.blocks]
    for entry in file.sections(is_checked=not is_remote):
        header_bytes = min(header_bytes, entry.offset - file.offset)
        if entry.is_known:
            section = Section(entry.id)
            section_bytes[section] += entry.size_bytes
            if section is Section.TRACK:
                track_bytes.append(entry.size_bytes)
            elif section is Section.BLOCK:
                block_bytes.append(0)
            number = len(block_bytes) - 1
            if number >= 0 and entry.offset < position_ends[number]:
                block_bytes[number] += entry.payload_bytes
    budget = {"header": header_bytes}
    for section, size_bytes in section_bytes.items():
        if section not in (Section.BLOCK, Section.INDEX, Section.END):
            budget[section.name.lower().replace("_", " ")] = size_bytes
    budget["framing"] = opened.size_bytes - sum(budget.values())

    surfaces = {} if surfaces is None else surfaces
    if opened.mesh_key not in surfaces:
        surfaces[opened.mesh_key] = {
            "raw_size_bytes": opened.surface.size_bytes,
            "n_polygons": opened.surface.n_faces(opened.n_faces),
            **describe_surface(opened.surface),
        }
    surface = surfaces[opened.mesh_key]
    n_coordinates = opened.n_frames * opened.n_verts * 3
    tracks = _tracks(opened, track_bytes)
    raw_bytes = n_coordinates * opened.dtype.itemsize + opened.n_faces * 12
    raw_bytes += surface["raw_size_bytes"] + sum(track.raw_size_bytes for track in tracks)
    return StreamInfo(
        **{**surface, "raw_size_bytes": raw_bytes},
        n_frames=opened.n_frames,
        n_verts=opened.n_verts,
        n_faces=opened.n_faces,
        fps=opened.timing.fps,
        name=opened.name,
        method=opened.method,
        laplacian=opened.laplacian.name.lower(),
        order=opened.order_kept.name.lower(),
        vertex_type=str(opened.dtype),
        n_modes=tuple(group.n_modes for group in groups[0]),
        block_frames=tuple(block.n_frames for block in file.blocks),
        size_bytes=opened.size_bytes,
        budget_bytes=budget,
        part_bytes=_parts(opened, section_bytes, tracks),
        block_bytes=tuple(block_bytes),
        error_bound_percent=opened.error_bound_percent,
        is_lossless=opened.method == LOSSLESS,
        is_whole=opened.is_whole,
        start_s=opened.timing.start_s,
        times=opened.timing.uneven_times,
        diagonal=opened.frame.scale,
        tracks=tracks,
        media=file.media,
        segments=(
            SegmentInfo(
                file.first_frame, opened.n_frames, opened.n_verts, opened.n_faces, opened.size_bytes
            ),
        ),
    )


def _tracks(opened: OpenStream, section_bytes: list[int]) -> tuple[TrackInfo, ...]:
    """Describe the tracks; `section_bytes` are the sizes of their sections TRACK."""
    infos = []
    for number, track in enumerate(opened.tracks, start=1):
        groups = (opened.file.block(block, number).size_bytes for block in range(opened.n_blocks))
        value_bytes = track.n_columns * track.dtype.itemsize
        infos.append(
            TrackInfo(
                name=track.name,
                kind=str(KINDS[track.kind]),
                domain=str(DOMAINS[track.domain]),
                unit=track.unit,
                number_type=str(track.dtype),
                n_columns=track.n_columns,
                is_exact=track.is_exact,
                bound=track.bound,
                size_bytes=sum(groups) + section_bytes[number - 1],
                raw_size_bytes=opened.n_frames * track.n_items * value_bytes,
            )
        )
    return tuple(infos)


def _parts(
    opened: OpenStream, section_bytes: Counter[Section], tracks: Iterable[TrackInfo]
) -> dict[str, int]:
    """Return the bytes of the parts of a stream; all others are the container."""
    blocks = sum(entry.size_bytes for entry in opened.file.blocks)
    images = section_bytes[Section.IMAGE]
    parts = {
        "positions": blocks + sum(section_bytes[section] for section in POSITIONS),
        "connectivity": sum(section_bytes[section] for section in CONNECTIVITY),
        "order": section_bytes[Section.ORDER],
        "surface": sum(section_bytes[section] for section in SURFACE_SECTIONS) - images,
        "images": images,
        **{f"track {track.name}": track.size_bytes for track in tracks},
    }
    parts["container"] = opened.size_bytes - sum(parts.values())
    return {name: size_bytes for name, size_bytes in parts.items() if size_bytes}
