"""Peak memory of encoding and decoding, each in a process of its own."""

import multiprocessing
import resource
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import meshreel
from speed_coders import Coder

# Not "spawn": Linux adds the peak of the parent process to that of a started program.
PROCESSES = multiprocessing.get_context("forkserver")


def peaks_mib(coder: Coder, sequence: meshreel.MeshSequence) -> dict[str, dict[str, float]]:
    """Largest resident set of encoding and of decoding, and that before the work, in MiB.

    Both are of the whole process, Python, NumPy and the prepared input included.
    """
    with TemporaryDirectory() as folder:
        np.save(Path(folder) / "vertices.npy", sequence.vertices)
        np.save(Path(folder) / "faces.npy", sequence.faces)
        return {
            "encode": in_child(encode_peak_mib, coder, Path(folder)),
            "decode": in_child(decode_peak_mib, coder, Path(folder)),
        }


def in_child(work: Callable[..., Any], *arguments: Any) -> Any:
    """The value that the work returns in a new process."""
    with ProcessPoolExecutor(1, mp_context=PROCESSES) as pool:
        return pool.submit(work, *arguments).result()


def encode_peak_mib(coder: Coder, folder: Path) -> dict[str, float]:
    """Peaks before and after encoding the stored arrays; the bytes are stored, too."""
    vertices, faces = np.load(folder / "vertices.npy"), np.load(folder / "faces.npy")
    sequence = meshreel.MeshSequence(vertices, faces)
    before = peak_mib()
    data = coder.encode(sequence)
    after = peak_mib()
    (folder / "stream").write_bytes(data)
    return {"before": before, "peak": after}


def decode_peak_mib(coder: Coder, folder: Path) -> dict[str, float]:
    """Peaks before and after decoding the stored bytes."""
    data = (folder / "stream").read_bytes()
    shape = np.load(folder / "vertices.npy", mmap_mode="r").shape
    before = peak_mib()
    coder.decode(data, shape)
    return {"before": before, "peak": peak_mib()}


def peak_mib() -> float:
    """Largest resident set of this process so far; macOS reports bytes, other systems KiB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10
