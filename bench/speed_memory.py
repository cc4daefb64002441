"""Peak memory of encoding and decoding, each in a separate process."""

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
    """Peak resident set before and after encoding and decoding, in MiB.

    Values are of the whole process, including Python, NumPy and the prepared input.
    """
    with TemporaryDirectory() as folder:
        np.save(Path(folder) / "vertices.npy", sequence.vertices)
        np.save(Path(folder) / "faces.npy", sequence.faces)
        return {
            "encode": in_child(encode_peak_mib, coder, Path(folder)),
            "decode": in_child(decode_peak_mib, coder, Path(folder)),
        }


def in_child(work: Callable[..., Any], *arguments: Any) -> Any:
    """Run the work in a new process, and return its result."""
    with ProcessPoolExecutor(1, mp_context=PROCESSES) as pool:
        return pool.submit(work, *arguments).result()


def encode_peak_mib(coder: Coder, folder: Path) -> dict[str, float]:
    """Encode the stored arrays, store the bytes, and return the peaks before and after."""
    vertices, faces = np.load(folder / "vertices.npy"), np.load(folder / "faces.npy")
    sequence = meshreel.MeshSequence(vertices, faces)
    before = peak_mib()
    data = coder.encode(sequence)
    after = peak_mib()
    (folder / "stream").write_bytes(data)
    return {"before": before, "peak": after}


def decode_peak_mib(coder: Coder, folder: Path) -> dict[str, float]:
    """Decode the stored bytes, and return the peaks before and after."""
    data = (folder / "stream").read_bytes()
    shape = np.load(folder / "vertices.npy", mmap_mode="r").shape
    before = peak_mib()
    coder.decode(data, shape)
    return {"before": before, "peak": peak_mib()}


def peak_mib() -> float:
    """Largest resident set of this process so far; macOS reports bytes, other systems KiB."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / 2**20 if sys.platform == "darwin" else peak / 2**10
