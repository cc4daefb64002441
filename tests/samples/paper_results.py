"""Synthetic results of the paper's study."""

from dataclasses import asdict

from meshreel.paper.study.results import PaperResults, RateSweep, label_of_result
from meshreel.paper.sweeps import Setting


def made_result(
    method,
    *,
    anchors=0.01,
    choices="",
    rate=1.0,
    entropy_rate=None,
    error=1.0,
    temporal=None,
    q=0.25,
    nmsve=None,
    n_modes=20,
    seconds=(1.0, 1.0),
    n_frames=4,
):
    """Return a stored result of a variant with these figures."""
    setting = Setting(method, n_modes, anchors=anchors, choices=choices)
    return {
        "identity": {"setting": asdict(setting)},
        "rate_bpvf": 1.1 * rate,
        "rate_order_dropped_bpvf": rate,
        "rate_order_dropped_entropy_bpvf": rate if entropy_rate is None else entropy_rate,
        "rates": {
            "eq13": {"q": 0.4, "q_a": 0.16, "q_d": 0.28, "q_s": 0.84},
            "stored": {"q": q, "q_a": 0.05, "q_d": 0.02, "q_s": q + 0.07},
            "q_entropy": 0.3, "q_d_per_block": 0.28, "dictionary_bits": 16,
        },
        "stream": {"n_modes": [20]},
        "bits_per_row": [[[8.0] * 20] * 3],
        "seconds": {
            "encode": seconds[0], "decode": seconds[1], "encode_processor": 2 * seconds[0],
            "decode_processor": 2 * seconds[1],
        },
        "quality": {
            "kg_error_percent": error,
            "sted": error / 100,
            "sted_temporal": error / 50 if temporal is None else temporal,
            "nmsve": [error / 1000] * n_frames if nmsve is None else list(nmsve),
            "nmsve_mean": error / 1000,
            "max_error_percent": 2 * error,
            "normal_angle_mean_deg": 3 * error,
        },
        "machine": {
            "cpu": "a processor", "cores": 1, "platform": "x", "python": "3", "numpy": "2",
            "scipy": "1", "meshreel": "0",
        },
    }  # fmt: skip


def made_sequence(name, variants=(), n_verts=9971, sweep=(), **others):
    """Combine results of variants and of sweeps to those of a sequence."""
    groups = {}
    for result in sweep:
        groups.setdefault(label_of_result(result), []).append(result)
    sweeps = [RateSweep(label, results, 1.5) for label, results in groups.items()]
    sequence = {
        "name": name, "n_frames": 175, "n_verts": n_verts, "n_faces": 19938, "sha256": "0" * 64,
    }  # fmt: skip
    return PaperResults(name, sequence, list(variants), sweeps=sweeps, **others)
