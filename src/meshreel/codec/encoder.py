"""Encode a mesh sequence to a stream, or its segments to streams that are joined."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshreel.codec.bitstream.container import write_stream
from meshreel.codec.bitstream.layout import Section
from meshreel.codec.config import EncoderConfig
from meshreel.codec.displaced import with_bound_of_motion
from meshreel.codec.images import reencode_images
from meshreel.codec.joining import blocks_of, header_of, join_streams, leading_of
from meshreel.codec.memory import UNLIMITED
from meshreel.codec.mesh_edits import MeshEdits
from meshreel.codec.methods import method_named
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.option import takes_fields
from meshreel.codec.options import all_options, config_of
from meshreel.codec.paper_options import PaperOptions
from meshreel.codec.reel_options import ReelOptions
from meshreel.codec.reordering import without_reordering
from meshreel.codec.source import CodedMesh, Source
from meshreel.codec.subspace.trajectories import bounding_frame
from meshreel.codec.surface.payloads import write_attribute
from meshreel.codec.surface.uv_grid import check_uvs, has_uvs
from meshreel.codec.track_bounds import Measure, TrackTargets, kept_bounds
from meshreel.errors import InvalidInputError
from meshreel.model.extent import Extent
from meshreel.model.notes import Notes
from meshreel.model.sequence import MeshSequence, tracks_of_all
from meshreel.model.surface import Domain
from meshreel.model.surface_selection import (
    ALL,
    Names,
    describe_missing,
    missing_everywhere,
    select,
)
from meshreel.model.tracks import track_by_name, value_range
from meshreel.runtime.progress import Progress, silent


@dataclass(frozen=True, kw_only=True)
class EncodeCall(PaperOptions, ReelOptions):
    """Parameters of `encode` other than the sequence; see its docstring."""

    attributes: Names = ALL
    tracks: TrackTargets | None = None
    progress: Progress = silent

    def __post_init__(self) -> None:
        """Check nothing: `config` does."""

    @property
    def config(self) -> EncoderConfig:
        """The checked options of the method."""
        return config_of(**{option.name: getattr(self, option.name) for option in all_options()})


@takes_fields(EncodeCall)
def encode(sequence: MeshSequence, call: EncodeCall) -> bytes:
    """Encode a sequence to the bytes of a `.reel` stream.

    The target of `reel` is one of `quality`, `bound`, `max_error`, `kg`, `size` and `step`, by
    default quality 80. The paper's methods take numbers of modes and bits.

    Parameters
    ----------
    sequence : MeshSequence
        Frames that are not in memory are read block by block. `meshreel.encode` also accepts inputs
        of `meshreel.load`, such as a path, and warns of contents that reading omits.
    options
        The fields of `ReelOptions` and `PaperOptions`.
    attributes : str or sequence of str, default "all"
        Which attributes and groups of the surface to keep: "all", "none", or names; a kind such
        as "uv" or "color" selects all its attributes. Polygons and parts are kept.
    tracks : mapping of str to str or float, optional
        Error bounds by track name, guaranteed for each value: "0.1%" of the range, "500Pa" or 500
        in units of the track, "0.5deg" (normals), "8bit" (colors), "exact", "drop". Default:
        integers exact, others that of `bound`. At quality 80 and for `size`, colors 8bit, texture
        coordinates half a texel of 4096, velocities 1%, normals 1deg, all others 0.2%; halved
        every 12 points. For `max_error`, `kg` and `step`, velocities 0.1%, normals 0.5deg, all
        others 0.1%. Positions may be finer than requested if velocities and normals, which they
        predict, then make the file smaller. `reel` only.
    progress : callable, optional
        Called with the stage and the completed share, 0..1.

    Returns
    -------
    bytes
        The contents of a `.reel` file, for `meshreel.decode`; `meshreel.save` writes it.

    Raises
    ------
    InvalidInputError
        If an option is out of range or has no effect, the mesh is too large for the method, or
        no stream meets the target.

    Examples
    --------
    >>> flag = meshreel.simulate_flag(30)
    >>> data = meshreel.encode(flag, max_error="0.1%")
    >>> meshreel.decode(data).n_frames
    30

    References
    ----------
    G. Arvanitis, A. S. Lalos, K. Moustakas, "Fast Spatio-temporal Compression of Dynamic 3D
    Meshes".
    """
    return encode_call(sequence, call)


def encode_call(sequence: MeshSequence, call: EncodeCall) -> bytes:
    """Encode a sequence, as `encode`."""
    config = call.config
    sequence = without_reordering(sequence, config.order)
    return encode_with(config, sequence, call.attributes, call.tracks, call.progress)


def encode_with(
    config: EncoderConfig,
    sequence: MeshSequence,
    attributes: Names = ALL,
    tracks: TrackTargets | None = None,
    progress: Progress = silent,
    notes: Notes | None = None,
) -> bytes:
    """Encode a sequence with options that are already checked, as `encode`.

    Segments that differ only in order are not joined; see `without_reordering`. Of several
    segments, errors and steps are relative to the bounding box of all frames, and percentage bounds
    of a track to its range over all segments. `notes` receive what happens to images.

    Raises
    ------
    InvalidInputError
        If no segment has an attribute or a track of a selected name, the mesh is too large for the
        method or changes, or no stream meets the target.
    """
    segments = sequence.segments
    has_several = len(segments) > 1
    if config.positions_only and has_several:
        raise InvalidInputError(
            f"method {config.method} needs constant connectivity, and the sequence has "
            f"{len(segments)} segments; use reel or lossless"
        )
    surfaces = [segment.surface for segment in segments]
    if attributes != ALL:
        if missing := missing_everywhere(surfaces, attributes):
            raise InvalidInputError(describe_missing(surfaces[0], missing))
        surfaces = [select(surface, attributes, ignore_missing=True) for surface in surfaces]
    if config.images is not None or config.max_image is not None:
        image_notes = Notes() if notes is None else notes
        reencode = reencode_images(surfaces, config.images, config.max_image, image_notes)
        surfaces = [*map(reencode, surfaces)]
    for name in tracks or ():
        track_by_name(tracks_of_all(sequence), name)  # raises if no segment has it
    if config.positions_only and surfaces[0].cells is not None:
        raise InvalidInputError(
            f"method {config.method} stores faces, and the mesh has cells; use reel or lossless"
        )
    if config.uv_bits is not None:
        for surface in list(filter(has_uvs, surfaces)) or surfaces:
            check_uvs(surface, config.uv_bits)
    progress("encoding connectivity", 0.0)
    positions_config = with_bound_of_motion(config, sequence)
    whole = sequence if has_several else None
    ranges: dict[str, float] = {}
    sources, edits = [], MeshEdits() if has_several else None
    for segment, surface in zip(segments, surfaces, strict=True):
        targets = {name: bound for name, bound in (tracks or {}).items() if name in segment.tracks}
        bounds = kept_bounds(config, segment.tracks, targets)
        for name, bound in bounds.items():
            if has_several and bound.measure is Measure.SHARE:
                if name not in ranges:
                    ranges[name] = _range_size(sequence, name)
                amount = bound.amount / 100.0 * ranges[name]
                bounds[name] = replace(bound, measure=Measure.UNITS, amount=amount)
        source = Source(segment, positions_config, surface, bounds, whole=whole)
        if edits is not None and source.mesh.may_be_edited:
            source = replace(source, edit=edits.edit_to(segment.faces, segment.n_verts))
        sources.append(source)
    streams = list(method_named(config.method).encode(sources, progress))
    if any(surface.attributes for surface in surfaces) and not config.positions_only:
        streams = list(predict_from_positions(streams, [source.mesh for source in sources]))
    if not has_several:
        return streams[0]
    return join_streams(streams, name=sequence.name, timing=sequence.timing)


def _range_size(sequence: MeshSequence, name: str) -> float:
    """Return the diagonal of the range of a track's values in all segments; 0 for a constant."""
    tracks = [segment.tracks[name] for segment in sequence.segments if name in segment.tracks]
    widths = {track.shape[2] for track in tracks}
    if len(widths) > 1:
        raise InvalidInputError(
            f"track {name!r} has {' and '.join(map(str, sorted(widths)))} numbers per value in "
            "different segments, which have no common range; give its bound in units"
        )
    low, high = zip(*map(value_range, tracks), strict=True)
    lowest, highest = map(np.nan_to_num, (np.fmin.reduce(low), np.fmax.reduce(high)))
    return bounding_frame(Extent(lowest, highest, 0.0)).scale if (highest > lowest).any() else 0.0


def predict_from_positions(
    streams: Iterable[bytes], meshes: Sequence[CodedMesh]
) -> Iterator[bytes]:
    """Yield the streams of segments, with attributes from points where that takes fewer bytes.

    The points are the decoded positions of the first frame. Attributes that several segments store
    alike remain, because these may share them.
    """
    n_stored = Counter(section for mesh in meshes for section in mesh.surface_sections)
    for stream, mesh in zip(streams, meshes, strict=True):
        surface, faces, bits = mesh.output_surface, mesh.output_faces, mesh.config.uv_bits
        stored = [section for section in mesh.surface_sections if section[0] is Section.ATTRIBUTE]
        candidates = {
            section: attribute
            for section, attribute in zip(stored, surface.attributes, strict=True)
            if n_stored[section] == 1 and attribute.domain in (Domain.VERTEX, Domain.CORNER)
        }
        if not candidates:
            yield stream
            continue
        opened = whole_stream(stream, UNLIMITED)
        positions = np.empty((1, opened.n_verts, 3), opened.dtype)
        method_named(opened.method).frames(opened, None).fill(positions, 0)
        leading = list(leading_of(opened))
        for number, section in enumerate(leading):
            if section in candidates:
                payload = write_attribute(candidates[section], surface, faces, bits, positions[0])
                if len(payload) < len(section[1]):
                    leading[number] = Section.ATTRIBUTE_FROM_POINTS, payload
        yield write_stream((header_of(opened), leading, blocks_of(opened)))
