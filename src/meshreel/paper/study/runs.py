"""Runs of the study: streams of variants, and measurements for single claims of the paper."""

import io
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from meshreel.arrays import Floats
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.paper_options import equal_blocks
from meshreel.codec.subspace.pca import autocorrelation, eigen_trajectories
from meshreel.codec.subspace.trajectories import bounding_frame, to_matrices
from meshreel.errors import InvalidInputError
from meshreel.metrics.compare import compare
from meshreel.model.frame_choice import spread_frames
from meshreel.model.sequence import MeshSequence
from meshreel.paper.basis import modes_for_energy, project
from meshreel.paper.blocks import write_curves, write_rows
from meshreel.paper.coded_values import Quantized
from meshreel.paper.decoder import coded_blocks
from meshreel.paper.experiment import ExperimentSeries
from meshreel.paper.graph_fourier import basis_bytes, estimated_seconds, graph_fourier_basis
from meshreel.paper.laplacian import delta_coordinates, uniform_laplacian
from meshreel.paper.quantization import uniform_step
from meshreel.paper.stream_rates import StreamRates, rates, rates_of
from meshreel.paper.study.results import RATE
from meshreel.paper.sweeps import BITS, BLOCK_MODES, Setting, TableSettings
from meshreel.runtime.counting import duration_text
from meshreel.runtime.progress import Progress
from meshreel.studies.runs import Outcome, Run, finite
from meshreel.studies.timing import REPEATS, machine_facts, one_thread, seconds_of, timed

Value = TypeVar("Value")

SAMPLED_FRAMES = 16
"""Frames of which sweeps measure the errors: the measures of all frames take five times as long as
the codec.
"""

LONG_FRAMES = 1200
"""The paper's claim about blocks concerns sequences of more than 1,000 frames."""

OMITTED_ENERGY = 1e-4
"""Fraction of the shape's energy that the rows of a block omit, equal in all blocks."""

N_DECOMPOSITIONS = 2

NEAR_ZERO = 0.01, 0.001
"""Magnitudes near zero, relative to the largest."""

REPEAT_BELOW_S = 15.0
"""Longer work is timed once."""

MAX_FULL_SECONDS = 600.0
"""Time that the study spends on all graph frequencies of a sequence."""


def projected_deltas(sequence: MeshSequence) -> Floats:
    """Magnitudes of U^T delta^T of the x coordinate, shape (T, V), in diagonals."""
    frame = bounding_frame(sequence.extent)
    matrix = to_matrices(sequence.vertices, frame)[0]
    _, basis = eigen_trajectories(autocorrelation(matrix), sequence.n_frames)
    laplacian = uniform_laplacian(sequence.faces, sequence.n_verts, normalized=True)
    return np.abs(delta_coordinates(laplacian, project(basis, matrix).T).T)


def near_zero_percent(magnitudes: Floats, threshold: float) -> float:
    """Percentage of the entries whose magnitude is at most `threshold` times the largest."""
    return 100 * float(np.mean(magnitudes <= threshold * magnitudes.max()))


def sparsity_run(sequence: MeshSequence) -> Run:
    """A run that counts entries near zero of the projected deltas of x, without quantization.

    Its figures are "below_percent" and "below_permille": percentages of the entries of at most 1 %
    and 0.1 % of the largest.
    """

    def measure(progress: Progress) -> Outcome:
        magnitudes = projected_deltas(sequence)
        percent, permille = (near_zero_percent(magnitudes, limit) for limit in NEAR_ZERO)
        return Outcome({"below_percent": percent, "below_permille": permille})

    return Run("sparsity", "claim_sparsity", {}, measure)


def dictionaries_run(sequence: MeshSequence) -> Run:
    """A run that measures the bits per entry of dictionaries and of their differences.

    Its figures are bits per entry over all tracked blocks but the first: "kept_whole" and
    "kept_difference" with the columns that `blocks` keeps, "all_whole" and "all_difference" with
    all k_f, coded as curves over time as in a stream; and the same with "_plain", coded entry by
    entry. None if there is only one block.
    """
    frames = equal_blocks(sequence.n_frames)
    n_columns = {"kept": min(BLOCK_MODES, frames), "all": frames}
    setting = {"block_frames": frames, "modes": n_columns, "bits": BITS, "codings": 2}

    def measure(progress: Progress) -> Outcome:
        figures: dict[str, Any] = {}
        for name, n_modes in n_columns.items():
            progress(f"dictionaries of {n_modes} columns", 0.0)
            bases = dictionaries(sequence, frames, n_modes)
            for extension, write in (("", write_curves), ("_plain", write_rows)):
                whole, difference = bits_per_entry(bases, write) or (None, None)
                figures |= {
                    f"{name}_whole{extension}": whole,
                    f"{name}_difference{extension}": difference,
                }
        return Outcome(figures)

    return Run("dictionaries", "claim_dictionaries", setting, measure)


def dictionaries(sequence: MeshSequence, block_frames: int, n_modes: int) -> list[Quantized]:
    """The dictionaries of the whole blocks of a stream of `blocks` with this many columns."""
    data = encode(sequence, "blocks", n_modes=n_modes, bits=BITS, block_frames=block_frames)
    bases = [block.basis for block in coded_blocks(data) if block.basis is not None]
    return [basis for basis in bases if basis.integers.shape[2] == block_frames]


def bits_per_entry(
    bases: Sequence[Quantized], write: Callable[[Quantized], bytes]
) -> tuple[float, float] | None:
    """Mean bits per entry of all dictionaries but the first, whole and as differences.

    Parameters
    ----------
    bases : sequence of Quantized of shape (3, K, T)
    write : callable
        Returns the payload of a matrix; steps and tables count.

    Returns
    -------
    tuple of two floats; None if there is no difference
    """
    sizes, n_entries = [0, 0], 0
    for previous, basis in pairwise(bases):
        difference = Quantized(basis.integers - previous.integers, basis.steps)
        sizes[0] += 8 * len(write(basis))
        sizes[1] += 8 * len(write(difference))
        n_entries += basis.integers.size
    return (sizes[0] / n_entries, sizes[1] / n_entries) if n_entries else None


def quiet_blocks_run(sequence: MeshSequence) -> Run:
    """A run that relates the motion of each block to the bits of its coefficients.

    All blocks have the same quantization step and omit the same energy, so their errors are about
    equal. Its figures are lists with a number for each block: "motion_percent", the RMS
    displacement between frames in percent of the diagonal, "bits", coefficient bits per vertex and
    frame of one coordinate, and "n_modes".
    """
    frames = equal_blocks(sequence.n_frames)
    setting = {"block_frames": frames, "bits": BITS, "left_out": OMITTED_ENERGY}

    def measure(progress: Progress) -> Outcome:
        frame = bounding_frame(sequence.extent)
        laplacian = uniform_laplacian(sequence.faces, sequence.n_verts, normalized=True)
        blocks = [
            to_matrices(sequence.vertices[start : start + frames], frame)
            for start in range(0, sequence.n_frames, frames)
        ]
        blocks = [block for block in blocks if block.shape[1] > 1]
        # Every frame of every block may omit the same energy.
        shapes = [block - block.mean(axis=2, keepdims=True) for block in blocks]
        n_frames = sum(block.shape[1] for block in blocks)
        energy = sum(float(np.vdot(shape, shape)) for shape in shapes) / max(n_frames, 1)
        rows = [_deltas_of_block(block, energy, laplacian) for block in blocks]
        largest = max((float(np.abs(row).max(initial=0.0)) for row in rows), default=0.0)
        steps = np.array([uniform_step(largest, BITS)], np.float32)
        bits, motion = [], []
        for number, (row, block) in enumerate(zip(rows, blocks, strict=True)):
            progress("blocks", number / len(blocks))
            payload = write_rows(Quantized.of(row, steps))
            bits.append(8 * len(payload) / 3 / (sequence.n_verts * block.shape[1]))
            displacements = np.diff(block, axis=1)
            motion.append(100 * float(np.sqrt(3 * np.mean(displacements**2))))
        n_modes = [row.shape[1] for row in rows]
        return Outcome({"motion_percent": motion, "bits": bits, "n_modes": n_modes})

    return Run("quiet blocks", "claim_quiet_blocks", setting, measure)


def _deltas_of_block(block: Floats, energy: float, laplacian: Any) -> Floats:
    """Projected deltas of shape (3, K, V), with modes that omit the given energy per frame."""
    correlation = autocorrelation(block)
    values, _ = eigen_trajectories(correlation, block.shape[1])
    total = float(np.trace(correlation, axis1=1, axis2=2).sum())
    n_modes = modes_for_energy(values, total, energy * block.shape[1], 1 - OMITTED_ENERGY)
    _, basis = eigen_trajectories(correlation, n_modes)
    projected = project(basis, block)
    return np.stack([delta_coordinates(laplacian, axis.T).T for axis in projected])


def long_run(sequence: MeshSequence, table: TableSettings) -> Run:
    """A run that times `blocks` and `pca-qp` on the sequence repeated to over 1,000 frames.

    Its figures are "n_frames" and seconds of "blocks" and "pca-qp" in the format of other runs.
    """
    n_repeats = -(-LONG_FRAMES // sequence.n_frames)
    settings = {name: table.setting(name) for name in ("pca-qp", "blocks")}
    keys = {name: setting.key for name, setting in settings.items()}

    def measure(progress: Progress) -> Outcome:
        vertices = np.concatenate([sequence.vertices] * n_repeats)
        repeated = sequence.replace(vertices=vertices)
        figures: dict[str, Any] = {"n_frames": len(vertices)}
        for number, (name, setting) in enumerate(settings.items()):
            progress(f"{name}, {len(vertices)} frames", number / 2)
            options = setting.options()
            data, encode_s = timed_on_one_thread(partial(encode, repeated, **options))
            _, decode_s = timed_on_one_thread(partial(decode, data))
            figures[name] = seconds_of(encode_s, decode_s)
        return Outcome(figures)

    return Run("long sequence", "claim_long_sequence", {"times": n_repeats, **keys}, measure)


def timed_on_one_thread(
    work: Callable[[], Value], n_repeats: int = REPEATS
) -> tuple[Value, Floats]:
    """Return the value of the work and the seconds of each run, of one thread, as `timed`.

    Threads of BLAS wait for each other in loops, which count as processor time: with two, blocks
    seem faster to encode than all frames at once, with one they are slower.
    """
    with one_thread():
        return timed(work, n_repeats, REPEAT_BELOW_S)


def decompositions_run(sequence: MeshSequence, n_modes: int) -> Run:
    """A run that times two decompositions with this many graph frequencies.

    Its figures are "n_modes", and the means "seconds_each" and "processor_seconds_each".
    """

    def measure(progress: Progress) -> Outcome:
        laplacian = uniform_laplacian(sequence.faces, sequence.n_verts)
        runs = []
        for number in range(N_DECOMPOSITIONS):
            progress("decomposition", number / N_DECOMPOSITIONS)
            work = partial(graph_fourier_basis, laplacian, n_modes)
            runs += timed_on_one_thread(work, 1)[1].tolist()
        wall, processor = np.mean(runs, axis=0).tolist()
        return Outcome(
            {"n_modes": n_modes, "seconds_each": wall, "processor_seconds_each": processor}
        )

    setting = {"n_modes": n_modes, "n_decompositions": N_DECOMPOSITIONS}
    return Run("decompositions", "decompositions", setting, measure)


def full_decomposition_run(sequence: MeshSequence) -> Run:
    """A run that times one decomposition with all graph frequencies.

    Its figures are "n_verts", "seconds", "processor_seconds", "memory_bytes" and "machine". It is
    refused if it would take more than `MAX_FULL_SECONDS`, estimated, or too much memory.
    """

    def measure(progress: Progress) -> Outcome:
        n_verts = sequence.n_verts
        laplacian = uniform_laplacian(sequence.faces, n_verts)
        estimate = estimated_seconds(laplacian, n_verts)
        if estimate > MAX_FULL_SECONDS:
            raise InvalidInputError(
                f"all {n_verts} graph frequencies would take about {duration_text(estimate)} (an "
                f"estimate); the study spends up to {duration_text(MAX_FULL_SECONDS)}"
            )
        progress(f"about {duration_text(estimate)} (an estimate)", 0.0)
        _, runs = timed_on_one_thread(partial(graph_fourier_basis, laplacian, n_verts), 1)
        seconds, processor = runs[0].tolist()
        return Outcome(
            {
                "n_verts": n_verts,
                "seconds": seconds,
                "processor_seconds": processor,
                "memory_bytes": basis_bytes(n_verts, n_verts),
                "machine": machine_facts(),
            }
        )

    return Run("full decomposition", "full_decomposition", {"n_decompositions": 1}, measure)


MEASURED = (
    "processor seconds of one thread, from arrays in memory to bytes in memory and back, with "
    "connectivity and entropy coding, without files; the order of vertices and faces is preserved"
)


def variant_run(
    sequence: MeshSequence, setting: Setting, *, shown_frame: int = 0, repeat: bool = False
) -> Run:
    """A run of a setting; its stream and one decoded frame are stored with the result.

    The sequence is encoded once with vertex order, for quality and seconds, and once without, for
    the smallest size.

    Parameters
    ----------
    shown_frame : int
        The decoded frame to store for pictures.
    repeat : bool
        Use the median of three runs if one takes less than 15 seconds.
    """
    options, n_repeats = setting.options(), REPEATS if repeat else 1

    def measure(progress: Progress) -> Outcome:
        work = partial(encode, sequence, **options, progress=progress)
        data, encode_s = timed_on_one_thread(work, n_repeats)
        decoded, decode_s = timed_on_one_thread(partial(decode, data, progress=progress), n_repeats)
        smallest = info(encode(sequence, **options, order="drop", progress=progress))
        stream, frame = info(data), io.BytesIO()
        np.save(frame, decoded.vertices[shown_frame])
        figures = {
            "stream": stream.as_dict(),
            "rate_bpvf": stream.rate_bpvf,
            "rate_order_dropped_bpvf": smallest.rate_bpvf,
            "size_order_dropped_bytes": smallest.size_bytes,
            "budget_order_dropped_bytes": smallest.budget_bytes,
            **_rate_figures(rates(data), smallest.rate_bpvf),
            "seconds": seconds_of(encode_s, decode_s),
            "quality": finite(compare(sequence, decoded, progress=progress).as_dict()),
            "machine": machine_facts(),
        }
        return Outcome(figures, {"reel": data, "npy": frame.getvalue()})

    name = f"{setting.label}, {setting.n_modes or 'default'} modes, {setting.bits} bits"
    return Run(name, setting.key, asdict(setting), measure, needs=("reel",))


def sweep_run(series: ExperimentSeries, setting: Setting) -> Run:
    """A run of a point of a rate-distortion sweep: rates and errors, without a stream and seconds.

    Rates and positions are those of a stream. Errors are of `SAMPLED_FRAMES` frames.
    """
    numbers = spread_frames(range(series.sequence.n_frames), SAMPLED_FRAMES)

    def measure(progress: Progress) -> Outcome:
        encoded = series.run(setting.method, setting.method_options())
        stream_rates = rates_of(encoded.stream, has_coded_rows=False)
        figures = _rate_figures(stream_rates, encoded.rate_bpvf)
        del figures["bits_per_row"]
        quality = finite(encoded.errors_of(numbers))
        return Outcome({RATE: encoded.rate_bpvf, **figures, "quality": quality})

    name = f"sweep of {setting.label}, {setting.n_modes} modes, {setting.bits} bits"
    identity = {**asdict(setting), "frames": SAMPLED_FRAMES}
    return Run(name, f"sweep_{setting.key}", identity, measure)


def _rate_figures(stream_rates: StreamRates, smallest_bpvf: float) -> dict[str, Any]:
    """The rates of a stream in the paper's count, in plain types.

    "rate_order_dropped_entropy_bpvf" is the rate of the file if its coefficients took their
    zero-order entropy.
    """
    figures: dict[str, Any] = {
        name: {part: getattr(getattr(stream_rates, name), part) for part in RATE_PARTS}
        for name in ("eq13", "stored")
    }
    for name in ("q_entropy", "q_d_per_block", "dictionary_bits"):
        figures[name] = getattr(stream_rates, name)
    saved = 3 * (stream_rates.q_entropy - stream_rates.stored.q)
    return {
        "rates": figures,
        "rate_order_dropped_entropy_bpvf": smallest_bpvf + saved,
        "bits_per_row": [rows.tolist() for rows in stream_rates.stored.bits_per_row],
    }


RATE_PARTS = ("q", "q_a", "q_d", "q_s")
