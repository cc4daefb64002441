"""Proof of `meshreel batch` at scale: an object store, a Dask cluster, and a worker that is killed.

    python bench/batch_scale.py --inputs 1000
    python bench/batch_scale.py --inputs 1000 --latency-ms 30    # each request takes longer
    python bench/batch_scale.py --inputs 12 --side 100 --frames 150

Puts the sequences of `bench/batch.py` into a bucket of moto, a server of S3 on this machine, starts
`dask scheduler` and `dask worker` with two processes, and runs `meshreel batch` from the bucket to
a folder. When half of the streams are there, one worker gets SIGKILL. Then checks that each stream
is complete, decodes to the recorded error and is in the manifest and the report, and that a second
run encodes nothing. Prints the figures and, computed from them, what more cores do in ten hours.
Needs the extras [dask,remote], moto and psutil.
"""

import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import psutil

import meshreel
from batch import mib, waves, write_inputs
from measuring import print_table

INPUTS = "captures"
N_WORKERS = 2
NIGHT_S = 10 * 3600.0
SAMPLE_PERIOD_S = 0.3


class Store:
    """A server of S3 that counts requests and bytes.

    Attributes
    ----------
    requests : Counter
        By method.
    bytes_out : int
        Bytes of bodies sent.
    """

    def __init__(self, latency_s: float) -> None:
        self._latency_s, self._lock = latency_s, threading.Lock()
        self.reset()

    def reset(self) -> None:
        """Begin to count again."""
        self.requests, self.bytes_out = Counter[str](), 0

    @contextlib.contextmanager
    def serve(self) -> Iterator[str]:
        """Serve on this machine; yield the address."""
        from moto import server as moto
        from werkzeug.serving import WSGIRequestHandler, make_server

        class Silent(WSGIRequestHandler):
            def log(self, *_: Any) -> None:
                pass

        server_of: Any = moto
        backend = server_of.DomainDispatcherApplication(server_of.create_backend_app)
        application = self._counting(backend)
        server = make_server("127.0.0.1", 0, application, threaded=True, request_handler=Silent)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()

    def _counting(self, application: Callable[..., Iterable[bytes]]) -> Callable[..., Any]:
        def counted(environment: dict[str, Any], respond: Callable[..., Any]) -> list[bytes]:
            time.sleep(self._latency_s)
            body = b"".join(application(environment, respond))
            with self._lock:
                self.requests[environment["REQUEST_METHOD"]] += 1
                self.bytes_out += len(body)
            return [body]

        return counted


def write_equal_inputs(folder: Path, n_inputs: int, side: int, n_frames: int) -> None:
    """Write sequences of one size."""
    rng = np.random.default_rng(17)
    for number in range(n_inputs):
        meshreel.save(waves(side, n_frames, rng.random(4)), folder / f"s{number:04d}.npz")


@contextlib.contextmanager
def dask_cluster(folder: Path) -> Iterator[tuple[str, list[int], int]]:
    """Start a scheduler and workers by Dask's commands.

    Yields
    ------
    address : str
    workers : list of int
        Their processes.
    parent : int
        The process that starts workers, and replaces dead ones.
    """
    from distributed import Client

    client_class: Any = Client
    file = folder / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    commands = (
        [*dask, "scheduler", "--port", "0", "--no-dashboard"],
        [*dask, "worker", "--nworkers", str(N_WORKERS), "--nthreads", "1", "--no-dashboard"],
    )
    processes = []
    with (folder / "dask.log").open("wb") as log:
        for command in commands:
            command += ["--scheduler-file", str(file)]
            processes.append(subprocess.Popen(command, stdout=log, stderr=log, cwd=folder))
            while not file.exists():
                time.sleep(0.1)
    try:
        with client_class(scheduler_file=str(file)) as client:
            client.wait_for_workers(N_WORKERS, timeout=60)
            address, workers = client.scheduler.address, list(client.run(os.getpid).values())
        yield address, workers, processes[-1].pid
    finally:
        for process in reversed(processes):
            process.terminate()
            process.wait()


class Sampler(threading.Thread):
    """Samples processor seconds and private memory of processes, also of those that end.

    Attributes
    ----------
    cpu_s, peak_mib : dict of int to float
        By process; seconds since the first sample.
    """

    def __init__(self, processes: Callable[[], Iterable[int]]) -> None:
        super().__init__(daemon=True)
        self.cpu_s: dict[int, float] = {}
        self.peak_mib: dict[int, float] = {}
        self._first_s: dict[int, float] = {}
        self._processes, self._stopped = processes, threading.Event()

    def run(self) -> None:
        """Sample until stopped."""
        while not self._stopped.wait(SAMPLE_PERIOD_S):
            for process in self._processes():
                with contextlib.suppress(psutil.Error):
                    times = psutil.Process(process).cpu_times()
                    total_s = times.user + times.system
                    self.cpu_s[process] = total_s - self._first_s.setdefault(process, total_s)
                    self.peak_mib[process] = max(self.peak_mib.get(process, 0), mib(process))

    def stop(self) -> None:
        """Stop sampling."""
        self._stopped.set()
        self.join()


@dataclass(frozen=True)
class Run:
    """A run of the batch: what it printed as JSON, and its figures."""

    report: dict[str, Any]
    seconds: float
    program_cpu_s: float
    program_mib: float
    worker_cpu_s: float
    worker_mib: float
    store_cpu_s: float


def run_batch(
    scheduler: str,
    parent: int,
    store: Store,
    out: Path,
    *,
    victim: int | None = None,
    kill_after: int = 0,
) -> Run:
    """Run the batch; kill the victim when `kill_after` streams are in the folder."""
    command = [sys.executable, "-m", "meshreel", "batch", f"s3://{INPUTS}", str(out)]
    store.reset()
    start, store_cpu_s = time.perf_counter(), time.process_time()
    with tempfile.TemporaryFile() as output:
        program = subprocess.Popen([*command, "--scheduler", scheduler, "--json"], stdout=output)

        def processes() -> list[int]:
            children = psutil.Process(parent).children(recursive=True)
            return [program.pid, *(child.pid for child in children)]

        sampler = Sampler(processes)
        sampler.start()
        while program.poll() is None:
            if victim is not None and (n_streams := len([*out.glob("*.reel")])) >= kill_after:
                os.kill(victim, signal.SIGKILL)
                print(f"killed a worker after {n_streams} streams", flush=True)
                victim = None
            time.sleep(0.05)
        seconds = time.perf_counter() - start
        sampler.stop()
        output.seek(0)
        report = json.load(output)
    assert program.returncode == 0
    assert victim is None, "the batch ended before a worker was killed"
    program_cpu_s, program_mib = sampler.cpu_s.pop(program.pid), sampler.peak_mib.pop(program.pid)
    return Run(
        report,
        seconds,
        program_cpu_s,
        program_mib,
        sum(sampler.cpu_s.values()),
        max(sampler.peak_mib.values()),
        time.process_time() - store_cpu_s,
    )


def check(originals: dict[str, meshreel.MeshSequence], run: Run, out: Path) -> None:
    """Fail unless every input has a complete stream that decodes to its recorded error."""
    results = {path.name for path in out.iterdir()}
    assert results == {f"{name}.reel" for name in originals} | {"manifest.json"}
    records = json.loads((out / "manifest.json").read_text())["inputs"]
    assert len(records) == len(run.report["inputs"]) == len(originals)
    for name, original in originals.items():
        record = records[f"{name}.npz"]
        assert record["state"] == "done", name
        assert run.report["inputs"][f"{name}.npz"]["outcome"] == "encoded", name
        data = (out / f"{name}.reel").read_bytes()
        assert len(data) == record["size_bytes"], name
        error = meshreel.compare(original, data).max_error_percent
        assert np.isclose(error, record["max_error_percent"], rtol=1e-3), name


def print_figures(run: Run, store: Store, originals: dict[str, meshreel.MeshSequence]) -> None:
    """Print what was measured."""
    n_inputs, n_positions = len(originals), positions_of(originals)
    requests = ", ".join(f"{number} {method}" for method, number in store.requests.most_common())
    print(f"measured: {n_inputs} inputs, {n_positions / 1e6:.1f} million vertices x frames")
    print(f"  {run.seconds:.1f} s; processor seconds: workers {run.worker_cpu_s:.1f}, "
          f"program {run.program_cpu_s:.1f}, store {run.store_cpu_s:.1f}")  # fmt: skip
    print(f"  per processor second of a worker: {n_inputs / run.worker_cpu_s:.1f} inputs, "
          f"{n_positions / run.worker_cpu_s / 1e6:.2f} million vertices x frames")  # fmt: skip
    print(f"  private memory: worker {run.worker_mib:.0f} MiB, program {run.program_mib:.0f} MiB")
    print(f"  store: {store.bytes_out / 1e6:.1f} MB sent in {store.requests.total()} requests "
          f"({requests})")  # fmt: skip


def print_night(run: Run, idle: Run, sent_mb: float, n_inputs: int, n_positions: int) -> None:
    """Print what more cores would do in ten hours, computed from a run and one without work."""
    program_s = (run.program_cpu_s - idle.program_cpu_s) / n_inputs
    print(f"computed; one program can write {NIGHT_S / program_s:,.0f} streams in ten hours")
    rows = []
    for n_cores in (2, 16, 64, 256):
        share = n_cores * NIGHT_S / run.worker_cpu_s
        figures = share * n_inputs, share * n_positions / 1e6
        rate = f"{share * sent_mb / NIGHT_S:.1f}"
        rows.append([str(n_cores), *(f"{each:,.0f}" for each in figures), rate])
    header = "cores", "inputs", "million vertices x frames", "MB/s from the store"
    print_table("", header, rows)


def positions_of(originals: dict[str, meshreel.MeshSequence]) -> int:
    """The number of vertices x frames of all sequences."""
    return sum(original.n_verts * original.n_frames for original in originals.values())


def main() -> None:
    """Run the proof."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--inputs", type=int, default=1000)
    parser.add_argument("--latency-ms", type=float, default=0.0, help="of each request")
    parser.add_argument("--side", type=int, help="equal inputs of side x side vertices")
    parser.add_argument("--frames", type=int, default=150, help="of each, with --side")
    chosen = parser.parse_args()
    store = Store(chosen.latency_ms / 1000)
    with tempfile.TemporaryDirectory() as made, contextlib.ExitStack() as stack:
        os.environ |= {
            "AWS_ENDPOINT_URL": stack.enter_context(store.serve()),
            "AWS_ACCESS_KEY_ID": "testing",
            "AWS_SECRET_ACCESS_KEY": "testing",
            "AWS_DEFAULT_REGION": "us-east-1",
            "AWS_EC2_METADATA_DISABLED": "true",
        }
        import fsspec

        folder, out = Path(made) / INPUTS, Path(made) / "streams"
        folder.mkdir()
        if chosen.side is None:
            write_inputs(folder, chosen.inputs)
        else:
            write_equal_inputs(folder, chosen.inputs, chosen.side, chosen.frames)
        originals = {path.stem: meshreel.load(path) for path in sorted(folder.iterdir())}
        bucket = fsspec.filesystem("s3")
        bucket.mkdir(INPUTS)
        bucket.put(f"{folder}/", f"{INPUTS}/", recursive=True)
        scheduler, workers, parent = stack.enter_context(dask_cluster(Path(made)))

        first = run_batch(
            scheduler, parent, store, out, victim=workers[0], kill_after=chosen.inputs // 2
        )
        print_figures(first, store, originals)
        sent_mb = store.bytes_out / 1e6
        check(originals, first, out)
        print("every stream is complete, and decodes to the recorded error")

        second = run_batch(scheduler, parent, store, out)
        assert second.report["up_to_date"] == chosen.inputs
        print(f"second run: {chosen.inputs} up to date in {second.seconds:.1f} s")
        print_night(first, second, sent_mb, chosen.inputs, positions_of(originals))


if __name__ == "__main__":
    main()
