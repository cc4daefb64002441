"""A mesh sequence to the bytes of a stream."""

from collections.abc import Mapping, Sequence

from meshreel.codec.config import EncoderConfig
from meshreel.codec.options import all_options
from meshreel.codec.source import Source
from meshreel.codec.surface.uv_grid import check_uvs
from meshreel.codec.track_bounds import TrackTargets, kept_bounds
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress, silent
from meshreel.sequence import FrameSource
from meshreel.surface_selection import ALL, Names, selected


def encode(
    sequence: FrameSource,
    method: str = "reel",
    *,
    quality: float | None = None,
    max_error: float | str | None = None,
    unit: str | None = None,
    kg: float | None = None,
    sted: float | None = None,
    bpvf: float | None = None,
    size: float | str | None = None,
    step: float | None = None,
    lossless: bool = False,
    tune: str | None = None,
    effort: int | None = None,
    n_modes: int | None = None,
    uv_bits: int | None = None,
    order: str = "keep",
    block_frames: int | None = None,
    memory: float | str | None = None,
    energy: float | None = None,
    bits: int | Sequence[int] | None = None,
    allocation: str = "energy",
    anchors: float | Sequence[int] | None = None,
    choices: str | Mapping[str, object] | None = None,
    laplacian: str = "normalized",
    n_iterations: int = 4,
    attributes: Names = ALL,
    tracks: TrackTargets | None = None,
    progress: Progress = silent,
    engine: Engine | None = None,
) -> bytes:
    """The bytes of a `.reel` stream that holds the sequence.

    What `reel` is to meet is one of `quality`, `max_error`, `kg`, `sted`, `bpvf`, `size` and
    `step`; without any it is quality 80. The paper's methods take numbers of modes and bits.

    Parameters
    ----------
    sequence : MeshSequence, or FrameSource
        Frames that are not in memory are read block by block. `meshreel.encode` also takes what
        `meshreel.load` reads, such as a path, and warns of what reading leaves out.
    method : str, default "reel"
        One of "pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft", "reel", "lossless",
        "grid". How to code. `reel`: our own, several times smaller than the others, which are
        variants of the paper. `pca-qp`: deltas on the eigen-trajectories of each axis, least
        squares with anchors. `pca`, `pca-q`: without anchors, the first at 16 bits. `v2v`: vertices
        instead of deltas. `pca-qs`: as `pca-qp`, decoded one frame after another. `blocks`:
        eigen-trajectories of short blocks, tracked. `gft`: each frame's deltas on the low
        frequencies of the graph. `lossless`: every bit comes back. `grid`: positions are rounded to
        a grid that keeps max_error=, and coded as `lossless` does.
    quality : float, optional
        1 to 100; every 12 points halve the error, which is relative to the model's size, the
        diagonal of a frame's bounding box, the mean of all frames, and smaller on smooth surfaces.
        Default: 80, if nothing else is asked for.
    max_error : float or str, optional
        No vertex of any frame farther from the original than this. Promised. 0.1 or 0.1%: percent
        of the diagonal of the bounding box of all frames; 0.5u: model units; 0.5mm: a length, see
        `unit`.
    unit : {"mm", "cm", "m", "km", "in", "ft"}, optional
        How long one unit of the model is, for a `max_error` that is a length.
    kg : float, optional
        Smallest file of at most this KG error, a share of the shape's extent. In percent.
    sted : float, optional
        Smallest file of at most this STED.
    bpvf : float, optional
        Best quality within so many bits for each vertex and frame. The whole stream counts.
    size : float or str, optional
        Best quality within this size, as in 100kB, 1MiB or 100000 (bytes).
    step : float, optional
        Step of rounding as it acts on a position, in diagonals of the bounding box of all frames.
    lossless : bool, default False
        Every number comes back bit for bit: positions and tracks. The order of vertices and faces
        stays as well, unless `order` says otherwise. The same as method="lossless". `tracks` may
        still name bounds, or drop tracks.
    tune : {"visual", "geometry"}, optional
        What bits are spent on. visual: how the surface looks; geometry: where vertices are.
        Default: what the target needs, else visual. visual serves STED, geometry KG and the largest
        error.
    effort : int, optional
        1 to 9: time against size. Default: 5.
    n_modes : int, optional
        Modes to keep, 1 or more: of reel at most so many, else of each axis. Those of an axis are
        eigen-trajectories (the paper's k_l); at most as many as a block has frames are used.
        Excludes `energy`. With `gft`, graph frequencies; default 5 % of the vertices.
    uv_bits : int, optional
        Round texture coordinates to a grid of 2^N steps to the width of a texture, N of 4 to 24; 12
        is a texel of a 4096 texture. Default: exact.
    order : {"keep", "vertices", "drop"}, default "keep"
        What to keep of the order of vertices and faces. keep: both; vertices: of the vertices;
        drop: neither, for the smallest file.
    block_frames : int, optional
        Frames coded together; fewer take less memory and more bytes. Default: all, as far as memory
        allows; of more than 1024 and 8 million positions, up to 512 (blocks: 25).
    memory : float or str, optional
        Memory that encoding may take, as in 500MB or 1GiB; blocks of frames are cut to fit, and
        frames stay in their files. Default: blocks of up to 268 million positions. This program
        counts, too. Blocks of the default size take some 6 GB. Those of `lossless` and `grid` are
        of up to 4 million positions, or 64 frames.
    energy : float, optional
        Share of the shape's energy to keep, up to 1; chooses the number of modes. Default: 0.99995.
        What is left out makes a KG error of sqrt(1 - energy), by default 0.7 %.
    bits : int or sequence of int, optional
        Bits of the largest coefficient, 2 to 24; or of each row, 0 to leave it out. Default: 9;
        pca: 16.
    allocation : {"energy", "constant"}, default "energy"
        How one number of bits is spread over the rows. energy: all share the step of the largest,
        so that bits follow a row's energy; constant: each takes that many bits of its own range.
    anchors : float or sequence of int, optional
        Share of the vertices sent as anchors, 0 to 1, where the method has them; or their numbers.
        Default: 0.01. Every connected component gets at least one: with 0 this is decoding by L
        alone (Eq. 11).
    choices : str or mapping, optional
        What the paper leaves open: values of anchor-values, anchor-set, anchor-seed, anchor-bits,
        dictionary-bits, quantize, dictionary and rotation, separated by commas. Such as
        `"anchor-values=coefficients,anchor-bits=16"`, or a mapping; `meshreel.paper.PaperChoices`
        describes each.
    laplacian : {"normalized", "combinatorial", "cotangent"}, default "normalized"
        The matrix that makes deltas. normalized: I - D^-1 C (Eq. 3), which measured better;
        combinatorial: D - C (Eq. 1); cotangent: I - D^-1 W with the cotangent weights of the first
        frame, which is sent too.
    n_iterations : int, default 4
        Orthogonal iterations from block to block (blocks).
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
    given = locals()
    config = EncoderConfig(**{option.name: given[option.name] for option in all_options()})
    return encode_with(config, sequence, attributes, tracks, progress, engine)


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
    surface = selected(sequence.surface, attributes)
    if config.uv_bits is not None:
        check_uvs(surface, config.uv_bits)
    progress("encoding connectivity", 0.0)
    source = Source(sequence, config, surface, kept_bounds(config, sequence.tracks, tracks))
    return config.method_row.encode(source, progress, engine)
