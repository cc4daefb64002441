"""A mesh sequence to the bytes of a stream."""

from dataclasses import dataclass

from meshreel.codec.config import EncoderConfig
from meshreel.codec.option import takes_fields
from meshreel.codec.source import Source
from meshreel.codec.surface.uv_grid import check_uvs
from meshreel.codec.track_bounds import TrackTargets, kept_bounds
from meshreel.model.sequence import FrameSource
from meshreel.model.surface_selection import ALL, Names, select
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress, silent


@dataclass(frozen=True, kw_only=True)
class EncodeCall(EncoderConfig):
    """All that `encode` takes besides a sequence, as its docstring describes it."""

    attributes: Names = ALL
    tracks: TrackTargets | None = None
    progress: Progress = silent
    engine: Engine | None = None


@takes_fields(EncodeCall)
def encode(sequence: FrameSource, call: EncodeCall) -> bytes:
    """The bytes of a `.reel` stream that holds the sequence.

    What `reel` is to meet is one of `quality`, `max_error`, `kg`, `sted`, `bpvf`, `size` and
    `step`; without any it is quality 80. The paper's methods take numbers of modes and bits.

    Parameters
    ----------
    sequence : MeshSequence, or FrameSource
        Frames that are not in memory are read block by block. `meshreel.encode` also takes what
        `meshreel.load` reads, such as a path, and warns of what reading leaves out.
    options
        The fields of `EncoderConfig`.
    attributes : str or sequence of str, default "all"
        Which attributes and groups of the surface to keep: "all", "none", or names; a kind such
        as "uv" or "color" names all of it. Polygons and parts are kept.
    tracks : mapping of str to str or float, optional
        How exact tracks are to come back, by their names: "0.1%" of the range, "500Pa" or 500 in
        units of the track, "0.5deg" (normals), "8bit" (colours), "exact", "drop". No value is
        farther from the original; promised. Default: normals 0.5deg, colours 8bit, texture
        coordinates half a texel of 4096, integers exact, all others 0.1%. Positions come back finer
        than asked where velocities and normals make the file smaller so. `reel` only.
    progress : callable, optional
        Called with the stage and the share done, 0..1.
    engine : Engine, optional
        Workers that code the blocks of `reel`, each of which needs the first one only; the
        bytes are the same. Not while an error is searched for (`kg`, `sted`), and of no use to
        other methods.

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
    sequence: FrameSource,
    attributes: Names = ALL,
    tracks: TrackTargets | None = None,
    progress: Progress = silent,
    engine: Engine | None = None,
) -> bytes:
    """The bytes of a stream, as `encode` gives them, of options that are checked already.

    Raises
    ------
    InvalidInputError
        If the mesh is too large for the method, or no stream meets the target.
    """
    surface = select(sequence.surface, attributes)
    if config.uv_bits is not None:
        check_uvs(surface, config.uv_bits)
    progress("encoding connectivity", 0.0)
    source = Source(sequence, config, surface, kept_bounds(config, sequence.tracks, tracks))
    return config.method_row.encode(source, progress, engine)
