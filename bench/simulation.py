"""Round trip of a simulation from `.vtkhdf` to `.reel` and back: bytes, errors and seconds.

    python bench/simulation.py --folder /tmp/simulation
    python bench/simulation.py --vertices 50000 --frames 500 --folder /tmp/simulation

The simulation is that of `bench/heat_on_a_sphere.py`: temperature and velocity of vertices, and
heat flow of faces, with known exact values. Needs the extra [vtk] and, to open both files with
VTK's reader, the package vtk. Needs about 3 GB on disk at full size.
"""

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import meshreel
from heat_on_a_sphere import simulate
from measuring import peak_mib, start_table
from meshreel.runtime.counting import counted
from meshreel.studies.timing import timed_once

BOUNDS: dict[str, float | str] = {"temperature": "0.1K", "velocity": "0.1%", "heat flow": "0.1%"}


def simulate_to_file(measure: Callable[..., Any], size: tuple[int, int], path: Path) -> int:
    """Simulate, write the file, and return the raw size of the arrays."""
    simulated = measure("simulating", lambda: simulate(*size))
    measure(f"writing {path.name}", lambda: meshreel.save(simulated, path, overwrite=True))
    return int(simulated.raw_size_bytes)


def frames_in_vtk(path: Path, numbers: list[int]) -> Iterator[dict[str, np.ndarray]]:
    """Yield points, point data and cell data of frames, read by VTK."""
    from vtkmodules.vtkIOHDF import vtkHDFReader

    numpy_support: Any = import_module("vtkmodules.util.numpy_support")
    vtk_to_numpy = numpy_support.vtk_to_numpy

    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    for number in numbers:
        reader.SetStep(number)
        reader.Update()
        mesh = reader.GetOutput()
        arrays = {"positions": vtk_to_numpy(mesh.GetPoints().GetData())}
        for data in (mesh.GetPointData(), mesh.GetCellData()):
            for index in range(data.GetNumberOfArrays()):
                arrays[data.GetArrayName(index)] = vtk_to_numpy(data.GetArray(index))
        yield arrays


def check_in_vtk(original: Path, decoded: Path, numbers: list[int]) -> None:
    """Print the largest error of each array over some frames, with both files read by VTK."""
    try:
        import vtkmodules  # noqa: F401
    except ImportError:
        print("not opened by VTK: pip install vtk")
        return
    errors: dict[str, float] = {}
    pairs = zip(frames_in_vtk(original, numbers), frames_in_vtk(decoded, numbers), strict=True)
    for arrays, arrays_hat in pairs:
        assert arrays.keys() == arrays_hat.keys(), (arrays.keys(), arrays_hat.keys())
        for name, values in arrays.items():
            offsets = (arrays_hat[name].astype(float) - values).reshape(len(values), -1)
            errors[name] = max(errors.get(name, 0.0), float(np.linalg.norm(offsets, axis=1).max()))
    for name, largest in errors.items():
        print(f"{name}: opened by VTK in both files, largest error {largest:.4g}")


def main() -> None:
    """Simulate, write, encode, decode track by track, write again, and compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vertices", type=int, default=50_000)
    parser.add_argument("--frames", type=int, default=500)
    parser.add_argument("--folder", type=Path, required=True, help="created if missing")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    raw, coded, back = (
        arguments.folder / name for name in ("sphere.vtkhdf", "sphere.reel", "decoded.vtkhdf")
    )
    print_row = start_table("", "s", "processor s", "peak MiB")

    def measure(task: str, work: Callable[[], Any]) -> Any:
        """Do the work, and print its seconds and the peak memory so far."""
        value, seconds = timed_once(work)
        print_row(task, *(f"{each:.2f}" for each in seconds), f"{peak_mib():.0f}")
        return value

    raw_bytes = simulate_to_file(measure, (arguments.vertices, arguments.frames), raw)
    data = measure("encoding it", lambda: meshreel.encode(raw, tracks=BOUNDS))
    coded.write_bytes(data)
    with meshreel.open(coded) as reel:
        read = partial(reel.read, 0, reel.n_frames)
        measure("decoding the mesh and positions, 3 columns", read)
        for name in BOUNDS:
            track = reel.track(name)
            title = f"decoding {name}, {counted(track.shape[2], 'column')}"
            measure(title, partial(track.read, 0, len(track)))
    quality = measure("comparing", lambda: meshreel.compare(raw, coded))
    measure(
        f"decoding all and writing {back.name}",
        lambda: meshreel.save(meshreel.load(coded), back, overwrite=True),
    )
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
