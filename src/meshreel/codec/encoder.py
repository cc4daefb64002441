"""A mesh sequence to the bytes of a stream."""

from collections.abc import Sequence

from meshreel.codec.config import (
    DEFAULT_ALLOCATION,
    DEFAULT_ITERATIONS,
    DEFAULT_LAPLACIAN,
    DEFAULT_METHOD,
    DEFAULT_ORDER,
    EncoderConfig,
)
from meshreel.codec.source import Source
from meshreel.codec.surface.uv_grid import check_uvs
from meshreel.runtime.engine.engine import Engine
from meshreel.runtime.progress import Progress, silent
from meshreel.sequence import FrameSource
from meshreel.surface_selection import ALL, Names, selected


def encode(
    sequence: FrameSource,
    method: str = DEFAULT_METHOD,
    *,
    n_modes: int | None = None,
    energy: float | None = None,
    bits: int | Sequence[int] | None = None,
    allocation: str = DEFAULT_ALLOCATION,
    anchors: float | None = None,
    laplacian: str = DEFAULT_LAPLACIAN,
    order: str = DEFAULT_ORDER,
    block_frames: int | None = None,
    memory: float | str | None = None,
    n_iterations: int = DEFAULT_ITERATIONS,
    quality: float | None = None,
    max_error: float | str | None = None,
    kg: float | None = None,
    sted: float | None = None,
    bpvf: float | None = None,
    size: float | str | None = None,
    step: float | None = None,
    tune: str | None = None,
    effort: int | None = None,
    unit: str | None = None,
    uv_bits: int | None = None,
    attributes: Names = ALL,
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
    method : {"reel", "pca-qp", "pca", "pca-q", "v2v", "pca-qs", "blocks", "gft"}
        `reel`: our own, several times smaller than the others. The rest are variants of the paper
        (`paper.variants`). `pca-qp`: deltas on the eigen-trajectories of each axis, least
        squares with anchors. `pca`, `pca-q`: without anchors, the first at 16 bits. `v2v`:
        vertices instead of deltas. `pca-qs`: as `pca-qp`, decoded one frame after another.
        `blocks`: eigen-trajectories of short blocks, tracked. `gft`: each frame's deltas on the
        low frequencies of the graph.
    n_modes : int, optional
        With `reel`, at most this many modes. Else eigen-trajectories to keep of each axis (the
        paper's k_l); at most as many as a block has frames are used. Excludes `energy`. With
        `gft`, graph frequencies; default 5 % of the vertices.
    energy : float, optional
        Share of the shape's energy to keep, 0..1; it chooses the number of modes. What is left
        out makes a KG error of sqrt(1 - energy). Default 0.99995, that is 0.7 %.
    bits : int, or sequence of int, optional
        Bits of the largest coefficient, 2..24; or bits of each row, where 0 leaves the row out.
        Default 9 (`pca`: 16).
    allocation : {"energy", "constant"}
        How a single number of bits is spread over the rows: all share the step of the largest,
        so that bits follow a row's energy; or each takes that many bits of its own range.
    anchors : float, optional
        Share of the vertices sent as anchors, 0..1, where the method has them; default 0.01.
        Every connected component gets at least one: with 0 this is decoding by L alone (Eq. 11).
    laplacian : {"normalized", "combinatorial"}
        I - D^-1 C (Eq. 3), which measured better, or D - C (Eq. 1).
    order : {"keep", "vertices", "drop"}
        Keep vertices and faces in the order they came; or the vertices only (the faces too, where
        that takes no more bytes); or neither, which gives the smallest stream.
    block_frames : int, optional
        Frames that are coded together. Default: all of them, as far as memory allows (`blocks`:
        25).
    memory : float or str, optional
        Bytes that encoding may take, or text such as "1GiB", this program included: blocks
        are cut to fit. Default: blocks of up to 67 million positions, which take some 8 GB.
    n_iterations : int, default 4
        Orthogonal iterations from one block to the next (`blocks`).
    quality : float, optional
        1..100; every 12 points halve the error. It sets a step relative to the size of the model
        itself, so that models of different sizes and travels look equally good.
    max_error : float or str, optional
        Percent of the diagonal of the bounding box of all frames, as 0.1 or "0.1%"; or a length,
        as "0.5u" in model units or "0.5mm", which needs `unit`. No vertex of any frame comes back
        farther from where it was.
    kg, sted : float, optional
        The smallest stream found whose KG error in percent, or whose STED, is at most this.
    bpvf : float, optional
        The best stream found of at most so many bits for each vertex and frame; the whole stream
        counts.
    size : float or str, optional
        The best stream found of at most so many bytes; a number, or text such as "100kB".
    step : float, optional
        Step of the fields as it acts on a position, in diagonals of the bounding box.
    tune : {"visual", "geometry"}, optional
        Serve STED, or KG and maximum error. Default: what the target asks for; else visual.
    effort : int, optional
        1..9, time against size; default 5.
    unit : {"mm", "cm", "m", "km", "in", "ft"}, optional
        How long one unit of the model is, for a `max_error` that is a length.
    uv_bits : int, optional
        4..24: texture coordinates are rounded to a grid of 2^uv_bits steps to the width of a
        texture, which takes far fewer bytes. Default: they come back exactly.
    attributes : str or sequence of str, default "all"
        Which attributes and groups of the surface to keep: "all", "none", or names; a kind such
        as "uv" or "color" names all of it. Polygons and parts are kept.
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
    config = EncoderConfig(
        method=method,
        n_modes=n_modes,
        energy=energy,
        bits=bits,
        allocation=allocation,
        anchors=anchors,
        laplacian=laplacian,
        order=order,
        block_frames=block_frames,
        memory=memory,
        n_iterations=n_iterations,
        quality=quality,
        max_error=max_error,
        kg=kg,
        sted=sted,
        bpvf=bpvf,
        size=size,
        step=step,
        tune=tune,
        effort=effort,
        unit=unit,
        uv_bits=uv_bits,
    )
    surface = selected(sequence.surface, attributes)
    if uv_bits is not None:
        check_uvs(surface, uv_bits)
    progress("encoding connectivity", 0.0)
    source = Source(sequence, config, surface)
    return config.method_row.encode(source, progress, engine)
