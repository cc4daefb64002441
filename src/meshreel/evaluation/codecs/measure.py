"""Encode, decode, measure: a setting of a method or of a peer to one stored result."""

from collections.abc import Callable
from typing import Any

from meshreel.codec.decoder import decode
from meshreel.codec.encoder import encode
from meshreel.codec.inspect import info
from meshreel.errors import MeshReelError
from meshreel.evaluation.codecs.arrangements import Arrangement, Subject
from meshreel.evaluation.codecs.peers.protocol import Peer, ReordersVertices, package_version
from meshreel.evaluation.codecs.settings import MethodSetting
from meshreel.evaluation.folder import file_name
from meshreel.evaluation.runs.machine import machine_facts
from meshreel.evaluation.runs.store import Result, Store, finite
from meshreel.evaluation.runs.timing import REPEATS, seconds_of, timed
from meshreel.metrics.displacement import displacement_errors_percent
from meshreel.metrics.kg import kg_error_percent
from meshreel.metrics.rate import rate_bpvf
from meshreel.metrics.sted import sted
from meshreel.runtime.progress import Progress, silent
from meshreel.sequence import MeshSequence, Vertices

METHOD, PEER = "method", "peer"


def run_method(
    subject: Subject, setting: MethodSetting, store: Store, progress: Progress = silent
) -> Result:
    """The result of one of our methods: the stored one, or a new one that is then stored.

    Rate and seconds are with the order dropped, as other codecs drop it; quality is of a stream
    that keeps it.
    """
    identity = {"kind": METHOD, "method": setting.method, "options": dict(setting.options)}

    def measure() -> Result:
        sequence, options = subject.sequence, dict(setting.options)
        data, encode_s = timed(
            lambda: encode(sequence, setting.method, **options, order="drop", progress=progress),
            REPEATS,
        )
        _, decode_s = timed(lambda: decode(data, progress=progress), REPEATS)
        kept = decode(encode(sequence, setting.method, **options, progress=progress))
        progress("measuring", 0.0)
        n_connectivity = info(data).budget_bytes.get("connectivity", 0)
        return {
            **_sizes(sequence, len(data), n_connectivity),
            "seconds": seconds_of(encode_s, decode_s),
            "quality": errors_of(sequence, kept.vertices),
        }

    return _run(setting.label, setting.params, identity, store, measure)


def run_peer(
    subject: Subject, peer: Peer, value: float, store: Store, progress: Progress = silent
) -> Result:
    """The result of another codec: the stored one, or a new one that is then stored.

    Where it does not code faces, the bytes and seconds of our connectivity are added, with the
    vertices in the order in which both together are smaller.
    """
    about = {"codec": peer.name, "summary": peer.summary, "version": package_version(peer)}
    identity = {"kind": PEER, "value": value, **about}
    progress("encoding and decoding", 0.0)
    return _run(
        peer.name, peer.params(value), identity, store, lambda: _measure_peer(subject, peer, value)
    )


def _measure_peer(subject: Subject, peer: Peer, value: float) -> Result:
    if peer.has_faces:
        return _measure_coder(subject.sequence, peer, value)
    best = min(
        subject.arrangements,
        key=lambda arrangement: (
            arrangement.size_bytes + len(peer.encode(arrangement.sequence, value))
        ),
    )
    return _measure_coder(best.sequence, peer, value, best)


def _measure_coder(
    original: MeshSequence, peer: Peer, value: float, faces: Arrangement | None = None
) -> Result:
    """Sizes, seconds and errors; with those of the faces where the peer does not code them."""
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
    return {
        **_sizes(source, size, n_connectivity),
        "vertex_order": faces.order if faces else None,
        "seconds": seconds_of(encode_s, decode_s),
        "quality": errors_of(original, decoded),
    }


def errors_of(original: MeshSequence, vertices_hat: Vertices) -> dict[str, Any]:
    """KG error, STED, largest and RMS error of decoded positions, as `compare` gives them."""
    distances = displacement_errors_percent(original.vertices, vertices_hat)
    figures = {
        "kg_error_percent": kg_error_percent(original.vertices, vertices_hat),
        "sted": sted(original.vertices, vertices_hat, original.faces).sted,
        "max_error_percent": distances.max_percent,
        "rms_error_percent": distances.rms_percent,
    }
    found: dict[str, Any] = finite(figures)
    return found


def _run(
    codec: str, params: str, identity: dict[str, Any], store: Store, measure: Callable[[], Result]
) -> Result:
    """The stored result of this identity, or what is measured; a refusal says why."""
    key = file_name(f"{codec} {params}")
    found = store.find_any(key, identity)
    if found is not None:
        return found
    named = {"codec": codec, "params": params}
    try:
        figures = measure()
    except MeshReelError as error:
        return store.write(key, identity, {**named, "refused": str(error)})
    except MemoryError:
        raise
    except Exception as error:
        if identity["kind"] == METHOD:
            raise
        # Packages of others raise what they like; it says something about them, not about us.
        why = f"{type(error).__name__}: {error}"
        return store.write(key, identity, {**named, "refused": why})
    return store.write(key, identity, {**named, **figures, "machine": machine_facts()})


def _sizes(sequence: MeshSequence, n_bytes: int, n_connectivity: int | None) -> dict[str, Any]:
    return {
        "size_bytes": n_bytes,
        "connectivity_bytes": n_connectivity,
        "rate_bpvf": rate_bpvf(n_bytes, sequence.n_verts, sequence.n_frames),
    }
