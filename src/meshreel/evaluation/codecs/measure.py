"""Runs that measure one of our methods or another codec at one setting."""

from typing import Any

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.evaluation.codecs.arrangements import Arrangement, Arrangements
from meshreel.evaluation.codecs.peers.protocol import Peer, ReordersVertices, package_version
from meshreel.evaluation.codecs.settings import MethodSetting
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.runs.machine import machine_facts
from meshreel.evaluation.runs.run import Outcome, Run
from meshreel.evaluation.runs.store import finite
from meshreel.evaluation.runs.timing import REPEATS, seconds_of, timed
from meshreel.metrics.displacement import displacement_errors_percent
from meshreel.metrics.kg import kg_error_percent
from meshreel.metrics.rate import rate_bpvf
from meshreel.metrics.sted import sted
from meshreel.model.sequence import MeshSequence, Vertices
from meshreel.runtime.progress import Progress

METHOD, PEER = "method", "peer"


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
