"""A simulation as a `.vtkhdf`, to `.reel` and back: bytes, errors and seconds at its full size.

    python bench/simulation.py --folder /tmp/simulation
    python bench/simulation.py --vertices 50000 --frames 500 --folder /tmp/simulation

The simulation is that of `examples/heat_on_a_sphere.py`: a temperature and a velocity of vertices,
and a flow of heat of faces, whose true values are known. Needs the extras [vtk] and, to open both
files with the reader of their owner, the package vtk. Some 3 GB on disk at full size.
"""

import argparse
import resource
import runpy
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import meshreel
from meshreel.runtime.counting import counted

EXAMPLE = Path(__file__).parents[1] / "examples" / "heat_on_a_sphere.py"
BOUNDS: dict[str, float | str] = {"temperature": "0.1K", "velocity": "0.1%", "heat flow": "0.1%"}


def timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """What work gives, and its seconds on the wall and of processor time."""
    wall, processor = time.perf_counter(), time.process_time()
    found = work()
    return found, time.perf_counter() - wall, time.process_time() - processor


def said(what: str, wall: float, processor: float) -> None:
    """Print a row of seconds, and the most memory so far."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"| {what} | {wall:.2f} | {processor:.2f} | {peak:.0f} |", flush=True)


def written(simulate: Callable[..., Any], size: tuple[int, int], path: Path) -> int:
    """Simulate into a file; the bytes of all arrays, which are gone then."""
    simulated, *seconds = timed(lambda: simulate(*size))
    said("simulating", *seconds)
    _, *seconds = timed(lambda: meshreel.save(simulated, path, overwrite=True))
    said(f"writing {path.name}", *seconds)
    return int(simulated.raw_size_bytes)


def frames_in_vtk(path: Path, numbers: list[int]) -> Iterator[dict[str, np.ndarray]]:
    """Arrays of some frames as VTK's own reader has them: points, point and cell data by name."""
    from vtkmodules.vtkIOHDF import vtkHDFReader

    numpy_support: Any = import_module("vtkmodules.util.numpy_support")
    vtk_to_numpy = numpy_support.vtk_to_numpy

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    for number in numbers:
        reader.SetStep(number)
        reader.Update()
        mesh = reader.GetOutput()
        found = {"positions": vtk_to_numpy(mesh.GetPoints().GetData())}
        for data in (mesh.GetPointData(), mesh.GetCellData()):
            for at in range(data.GetNumberOfArrays()):
                found[data.GetArrayName(at)] = vtk_to_numpy(data.GetArray(at))
        yield found


def check_in_vtk(original: Path, decoded: Path, numbers: list[int]) -> None:
    """Print the largest error of each array of some frames, both read by VTK."""
    try:
        import vtkmodules  # noqa: F401
    except ImportError:
        print("not opened by VTK: pip install vtk")
        return
    worst: dict[str, float] = {}
    pairs = zip(frames_in_vtk(original, numbers), frames_in_vtk(decoded, numbers), strict=True)
    for given, found in pairs:
        assert given.keys() == found.keys(), (given.keys(), found.keys())
        for name, values in given.items():
            apart = (found[name].astype(float) - values).reshape(len(values), -1)
            worst[name] = max(worst.get(name, 0.0), float(np.linalg.norm(apart, axis=1).max()))
    for name, largest in worst.items():
        print(f"{name}: opened by VTK in both files, largest error {largest:.4g}")


def main() -> None:
    """Simulate, write, encode, decode track by track, write again, and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=50_000)
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--folder", type=Path, required=True, help="for the files; made if missing")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    raw, coded, back = (
        arguments.folder / name for name in ("sphere.vtkhdf", "sphere.reel", "decoded.vtkhdf")
    )
    print("| | s | processor s | peak MiB |\n|---|---|---|---|")
    simulate = runpy.run_path(str(EXAMPLE))["simulate"]
    raw_bytes = written(simulate, (arguments.vertices, arguments.frames), raw)
    data, *seconds = timed(lambda: meshreel.encode(raw, tracks=BOUNDS))
    said("encoding it", *seconds)
    coded.write_bytes(data)
    with meshreel.open(coded) as reel:
        _, *seconds = timed(lambda: reel.read(0, reel.n_frames))
        said("decoding the mesh and positions, 3 columns", *seconds)
        for name in BOUNDS:
            track = reel.track(name)
            _, *seconds = timed(partial(track.read, 0, len(track)))
            said(f"decoding {name}, {counted(track.shape[2], 'column')}", *seconds)
    quality, *seconds = timed(lambda: meshreel.compare(raw, coded))
    said("comparing", *seconds)
    _, *seconds = timed(lambda: meshreel.save(meshreel.load(coded), back, overwrite=True))
    said(f"decoding all and writing {back.name}", *seconds)
    stream = meshreel.info(data)
    rest = stream.size_bytes - sum(track.size_bytes for track in stream.tracks)
    print(f"\n{raw_bytes:,} bytes of arrays, {raw.stat().st_size:,} as {raw.name}; "
          f"{stream.size_bytes:,} as {coded.name}")  # fmt: skip
    print(f"positions, faces, order: {rest:,} bytes, KG error {quality.kg_error_percent:.3f} %")
    for about in stream.tracks:
        print(f"{about}: {about.size_bytes:,} bytes; {quality.tracks[about.name]}")
    last = arguments.frames - 1
    check_in_vtk(raw, back, sorted({0, last // 3, 2 * last // 3, last}))


if __name__ == "__main__":
    main()
