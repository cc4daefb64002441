"""Encode a mesh sequence to a stream."""

from dataclasses import dataclass

from meshreel.codec.config import EncoderConfig
from meshreel.codec.option import takes_fields
from meshreel.codec.segments import encode_segments
from meshreel.codec.source import Source
from meshreel.codec.surface.uv_grid import check_uvs
from meshreel.codec.track_bounds import TrackTargets, kept_bounds
from meshreel.model.segments import AnySequence, SegmentedSequence
from meshreel.model.surface_selection import ALL, Names, select
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress, silent


@dataclass(frozen=True, kw_only=True)
class EncodeCall(EncoderConfig):
    """Parameters of `encode` other than the sequence; see its docstring."""

    attributes: Names = ALL
    tracks: TrackTargets | None = None
    progress: Progress = silent
    engine: Engine | None = None


@takes_fields(EncodeCall)
def encode(sequence: AnySequence, call: EncodeCall) -> bytes:
    """Encode a sequence to the bytes of a `.reel` stream.

    The target of `reel` is one of `quality`, `max_error`, `kg`, `sted`, `bpvf`, `size` and `step`,
    by default quality 80. The paper's methods take numbers of modes and bits.

    Parameters
    ----------
    sequence : MeshSequence, SegmentedSequence, or FrameSource
        Frames that are not in memory are read block by block. `meshreel.encode` also accepts inputs
        of `meshreel.load`, such as a path, and warns of contents that reading omits.
    options
        The fields of `EncoderConfig`.
    attributes : str or sequence of str, default "all"
        Which attributes and groups of the surface to keep: "all", "none", or names; a kind such
        as "uv" or "color" names all of it. Polygons and parts are kept.
    tracks : mapping of str to str or float, optional
        Error bounds by track name, guaranteed for each value: "0.1%" of the range, "500Pa" or 500
        in units of the track, "0.5deg" (normals), "8bit" (colors), "exact", "drop". Default:
        normals 0.5deg, colors 8bit, texture coordinates half a texel of 4096, integers exact, all
        others 0.1%. Positions may be finer than requested if velocities and normals, which they
        predict, then make the file smaller. `reel` only.
    progress : callable, optional
        Called with the stage and the completed share, 0..1.
    engine : Engine, optional
        Workers that encode blocks of `reel` in parallel, to the same bytes. Not used by searches
        for an error (`kg`, `sted`) or by other methods.

    Raises
    ------
    InvalidInputError
        If an option is out of range or has no effect, the mesh is too large for the method, or
        no stream meets the target.

    References
    ----------
    G. Arvanitis, A. S. Lalos, K. Moustakas, "Fast Spatio-temporal Compression of Dynamic 3D
    Meshes".
    """
    return encode_with(call, sequence, call.attributes, call.tracks, call.progress, call.engine)


def encode_with(
    config: EncoderConfig,
    sequence: AnySequence,
    attributes: Names = ALL,
    tracks: TrackTargets | None = None,
    progress: Progress = silent,
    engine: Engine | None = None,
) -> bytes:
    """Encode a sequence with options that are already checked, as `encode`.

    Raises
    ------
    InvalidInputError
        If the mesh is too large for the method, or no stream meets the target.
    """
    if isinstance(sequence, SegmentedSequence):
        if sequence.n_segments > 1:
            return encode_segments(config, sequence, attributes, tracks, progress, engine)
        (sequence,) = sequence.segments
    surface = select(sequence.surface, attributes)
    if config.uv_bits is not None:
        check_uvs(surface, config.uv_bits)
    progress("encoding connectivity", 0.0)
    source = Source(sequence, config, surface, kept_bounds(config, sequence.tracks, tracks))
    return config.method_row.encode(source, progress, engine)
