"""Runs that measure one of our methods or another codec, and their settings and vertex orders."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from meshreel.codec.connectivity.coder import encode_connectivity
from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.codec.methods import METHOD_NAMES
from meshreel.codec.open_stream import whole_file
from meshreel.evaluation.codecs.peers.protocol import Peer, ReordersVertices, package_version
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.runs.store import Outcome, Run, finite
from meshreel.evaluation.runs.timing import REPEATS, machine_facts, seconds_of, timed
from meshreel.metrics.displacement import displacement_errors_percent
from meshreel.metrics.kg import kg_error_percent
from meshreel.metrics.rate import rate_bpvf
from meshreel.metrics.sted import sted
from meshreel.model.sequence import MeshSequence, Vertices
from meshreel.paper.sweeps import Setting, sweep, variants
from meshreel.runtime.progress import Progress

CODED_METHODS = METHOD_NAMES
DEFAULT_METHODS = ("reel", "pca-qp", "v2v")

# Steps, and pairs of tune and effort, of `reel`, which the paper's sweep does not contain.
_STEPS: tuple[float, ...] = (1.6e-3, 8e-4, 4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5, 1.25e-5)
_PROFILES: tuple[tuple[str, int], ...] = (("visual", 5), ("visual", 9), ("geometry", 9))

# Error bounds of `grid` in percent of the diagonal; larger bounds suit other methods.
_GRID_ERRORS = (1e-3, 3e-4, 1e-4)
_SHORT = {"n_modes": "modes", "block_frames": "frames"}

METHOD, PEER = "method", "peer"


@dataclass(frozen=True)
class MethodSetting:
    """A method with options of `meshreel.encode`.

    Attributes
    ----------
    options : tuple of (name, value)
    """

    method: str
    options: tuple[tuple[str, Any], ...] = ()

    @property
    def label(self) -> str:
        """The name of the curve in reports; each tune is a curve."""
        tune = dict(self.options).get("tune", "visual")
        return self.method if tune == "visual" else f"{self.method}-{tune}"

    @property
    def params(self) -> str:
        """The options as text; empty if all are defaults."""
        return " ".join(f"{_SHORT.get(name, name)} {value}" for name, value in self.options)


def method_sweep(method: str, n_frames: int, n_verts: int, *, quick: bool) -> list[MethodSetting]:
    """The settings of a method for a sequence of this size."""
    if method == "reel":
        steps, profiles = (_STEPS[1:6:2], _PROFILES[:1]) if quick else (_STEPS, _PROFILES)
        return [
            MethodSetting("reel", (("step", step), ("tune", tune), ("effort", effort)))
            for tune, effort in profiles
            for step in steps
        ]
    if method == "grid":
        return [MethodSetting("grid", (("max_error", error),)) for error in _GRID_ERRORS]
    defaults = variants(n_frames, (method,))
    settings = sweep(n_frames, n_verts, (method,), quick=quick) or defaults
    return [_from_paper(setting) for setting in settings] or [MethodSetting(method)]


def _from_paper(setting: Setting) -> MethodSetting:
    options = {name: value for name, value in setting.options().items() if name != "method"}
    if not setting.anchors:  # methods without anchors reject the option
        del options["anchors"]
    return MethodSetting(setting.method, tuple(options.items()))


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A sequence in one vertex order, and the cost of its coded connectivity.

    Attributes
    ----------
    order : {"coded", "given"}
        The order of the coded connectivity, or the original one, which must then be stored.
    size_bytes : int
        Coded connectivity, including the order if it is the original one.
    encode_s, decode_s : float
        Seconds for the connectivity.
    """

    order: str
    sequence: MeshSequence
    size_bytes: int
    encode_s: float
    decode_s: float


@dataclass(frozen=True, eq=False)
class Arrangements:
    """A sequence in both vertex orders, computed on first use."""

    sequence: MeshSequence

    @cached_property
    def coded(self) -> Arrangement:
        """The order of the coded connectivity."""
        return arrange(self.sequence, "coded")

    @cached_property
    def given(self) -> Arrangement:
        """The original order."""
        return arrange(self.sequence, "given")


def arrange(sequence: MeshSequence, order: str) -> Arrangement:
    """Bring the sequence into a vertex order, and code and time its connectivity."""
    faces, n_verts = sequence.faces, sequence.n_verts
    stored = "drop" if order == "coded" else "vertices"
    coded, encode_s = timed(lambda: encode_connectivity(faces, n_verts, order=stored), REPEATS)
    stream = encode(MeshSequence(sequence.vertices[:1], faces), "lossless", order=stored)
    _, decode_s = timed(lambda: whole_file(stream).read_mesh(), REPEATS)
    if order == "coded":
        vertices: Vertices = sequence.vertices[:, coded.internal_to_given]
        sequence = MeshSequence(vertices.copy(), coded.internal_faces)
    size = len(coded.payload) + len(coded.order_payload)
    seconds = seconds_of(encode_s, decode_s)
    return Arrangement(order, sequence, size, seconds["encode"], seconds["decode"])


def method_run(sequence: MeshSequence, setting: MethodSetting) -> Run:
    """A run of one of our methods.

    Rate and seconds are measured without the vertex order, as for other codecs; quality is
    measured on a stream with it.
    """
    return Run(
        name=f"{setting.method} {setting.params}",
        key=file_name(f"{setting.label} {setting.params}"),
        setting={"kind": METHOD, "method": setting.method, "options": dict(setting.options)},
        measure=lambda progress: _measure_method(sequence, setting, progress),
        facts={"codec": setting.label, "params": setting.params},
    )


def peer_run(arrangements: Arrangements, peer: Peer, value: float) -> Run:
    """A run of another codec.

    If it does not code faces, the bytes and seconds of our connectivity are added, and the vertex
    order is the one with the smaller total.
    """
    about = {"codec": peer.name, "summary": peer.summary, "version": package_version(peer)}
    params = peer.params(value)
    return Run(
        name=f"{peer.name} {params}",
        key=file_name(f"{peer.name} {params}"),
        setting={"kind": PEER, "value": value, **about},
        measure=lambda progress: _measure_peer(arrangements, peer, value, progress),
        facts={"codec": peer.name, "params": params},
        is_foreign=True,
    )


def _measure_method(sequence: MeshSequence, setting: MethodSetting, progress: Progress) -> Outcome:
    options = dict(setting.options)
    data, encode_s = timed(
        lambda: encode(sequence, setting.method, **options, order="drop", progress=progress),
        REPEATS,
    )
    _, decode_s = timed(lambda: decode(data, progress=progress), REPEATS)
    ordered = decode(encode(sequence, setting.method, **options, progress=progress))
    progress("measuring", 0.0)
    n_connectivity = info(data).budget_bytes.get("connectivity", 0)
    figures = {
        **_sizes(sequence, len(data), n_connectivity),
        "seconds": seconds_of(encode_s, decode_s),
        "quality": errors_of(sequence, ordered.vertices),
        "machine": machine_facts(),
    }
    return Outcome(figures)


def _measure_peer(
    arrangements: Arrangements, peer: Peer, value: float, progress: Progress
) -> Outcome:
    progress("encoding and decoding", 0.0)
    if peer.has_faces:
        return _measure_coder(arrangements.sequence, peer, value)
    best = min(
        (arrangements.coded, arrangements.given),
        key=lambda arrangement: (
            arrangement.size_bytes + len(peer.encode(arrangement.sequence, value))
        ),
    )
    return _measure_coder(best.sequence, peer, value, best)


def _measure_coder(
    original: MeshSequence, peer: Peer, value: float, faces: Arrangement | None = None
) -> Outcome:
    """Sizes, seconds and errors, including the connectivity in `faces` if given."""
    source = peer.prepare(original) if isinstance(peer, ReordersVertices) else original
    data, encode_s = timed(lambda: peer.encode(source, value), REPEATS)
    shape, dtype = (source.n_frames, source.n_verts, 3), source.vertices.dtype
    decoded, decode_s = timed(lambda: peer.decode(data, shape, dtype), REPEATS)
    if isinstance(peer, ReordersVertices):
        decoded = peer.restore(decoded, source, value)
    size, n_connectivity = len(data), None
    if faces:
        n_connectivity = faces.size_bytes
        size += n_connectivity
        encode_s = [seconds + faces.encode_s for seconds in encode_s]
        decode_s = [seconds + faces.decode_s for seconds in decode_s]
    figures = {
        **_sizes(source, size, n_connectivity),
        "vertex_order": faces.order if faces else None,
        "seconds": seconds_of(encode_s, decode_s),
        "quality": errors_of(original, decoded),
        "machine": machine_facts(),
    }
    return Outcome(figures)


def errors_of(original: MeshSequence, vertices_hat: Vertices) -> dict[str, Any]:
    """KG error, STED, largest and RMS error of decoded positions, as in `compare`."""
    distances = displacement_errors_percent(original.vertices, vertices_hat)
    figures = {
        "kg_error_percent": kg_error_percent(original.vertices, vertices_hat),
        "sted": sted(original.vertices, vertices_hat, original.faces).sted,
        "max_error_percent": distances.max_percent,
        "rms_error_percent": distances.rms_percent,
    }
    errors: dict[str, Any] = finite(figures)
    return errors


def _sizes(sequence: MeshSequence, n_bytes: int, n_connectivity: int | None) -> dict[str, Any]:
    return {
        "size_bytes": n_bytes,
        "connectivity_bytes": n_connectivity,
        "rate_bpvf": rate_bpvf(n_bytes, sequence.n_verts, sequence.n_frames),
    }
