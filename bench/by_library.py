"""Processor seconds of our own code and of libraries that could replace it.

    python bench/by_library.py samba.npz
    python bench/by_library.py samba.npz --only render html --repeats 9

Runs each task in alternating rounds; seconds are medians and include child processes. Readers also
get damaged copies of the file, each in a child process with 8 GiB of memory. The last table lists
what each library installs in addition to NumPy and Pillow. Missing libraries are skipped.
"""

import argparse
import os
import re
import resource
import signal
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import meshreel
from measuring import medians, print_table, rounds
from meshreel.formats.frames.frame_stream import SegmentedStream
from meshreel.formats.meshes.obj import read_obj
from meshreel.formats.vtk.xml_arrays import parse_xml
from meshreel.formats.vtk.xml_file import read_frame
from meshreel.formats.vtk.xml_writing import vtu_encoder
from meshreel.model.geometry.normals import vertex_normals
from meshreel.model.sequence import MeshSequence
from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.film_files import save_mp4
from meshreel.rendering.rasterizer import CLAY, PAPER, render
from meshreel.studies.timing import Seconds, timed_once

SIZE = (1280, 720)
N_PICTURES = 24
"""Pictures of a drawn clip or an encoded film."""

N_DAMAGED = 60
DAMAGE_TIMEOUT_S = 10
MAX_MEMORY_BYTES = 8 << 30
ERROR, ENDED = 3, 4
"""Exit codes of a reader that raises an error, and of one that calls `sys.exit`."""

LIBRARIES = (
    "vtk", "moderngl", "pyrender", "pyvista", "lxml", "meshio", "trimesh", "tinyobjloader",
    "imageio-ffmpeg", "av", "plotly",
)  # fmt: skip
BASE = {"numpy", "pillow"}

Tasks = dict[str, Callable[..., Any]]


@dataclass(frozen=True)
class Film:
    """Finished pictures, in place of a film that is drawn."""

    images: list[Any]
    fps: float = 25.0
    size: tuple[int, int] = SIZE

    @property
    def n_pictures(self) -> int:
        return len(self.images)

    def pictures(self, stride: int = 1) -> Any:
        """Yield every `stride`-th picture."""
        return iter(self.images[::stride])


def timed_with_children(work: Callable[[], Any]) -> tuple[Any, Seconds]:
    """Return the value and the seconds of work; processor seconds include its child processes."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    value, seconds = timed_once(work)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    children_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return value, Seconds(seconds.wall, seconds.processor + children_s)


def measure(tasks: Tasks, repeats: int) -> dict[str, float]:
    """Median processor seconds of each task, in alternating rounds after one warm-up."""
    seconds = medians(rounds(tasks, repeats, timed=timed_with_children))
    return {name: each.processor for name, each in seconds.items()}


def available(tasks: Mapping[str, tuple[str, Callable[..., Any]]]) -> Tasks:
    """The tasks whose library is installed."""
    kept: Tasks = {}
    for name, (library, work) in tasks.items():
        if find_spec(library) is None:
            print(f"{name} is not installed")
        else:
            kept[name] = work
    return kept


def outcome(work: Callable[[], Any]) -> str:
    """What a reader does with damaged data, in another process."""
    child = os.fork()
    if child == 0:
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        os.dup2(null, 2)
        resource.setrlimit(resource.RLIMIT_AS, (MAX_MEMORY_BYTES, MAX_MEMORY_BYTES))
        signal.alarm(DAMAGE_TIMEOUT_S)
        try:
            work()
        except Exception:
            os._exit(ERROR)
        except SystemExit:
            os._exit(ENDED)
        os._exit(0)
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status):
        return "hangs" if os.WTERMSIG(status) == signal.SIGALRM else "ends the process"
    return {0: "reads", ERROR: "error"}.get(os.WEXITSTATUS(status), "ends the process")


def damaged(data: bytes) -> list[bytes]:
    """The file, then copies with one byte changed, and truncated ones."""
    rng = np.random.default_rng(0)
    copies = [data]
    for index in range(N_DAMAGED):
        place = int(rng.integers(len(data) if index % 2 else min(len(data), 2000)))
        if index % 6 == 5:
            copies.append(data[:place])
        else:
            copies.append(data[:place] + bytes([int(rng.integers(256))]) + data[place + 1 :])
    return copies


def counts_of(read: Callable[[bytes], Any], copies: list[bytes]) -> str:
    """How often each outcome occurs; the first copy is undamaged and must be read."""
    if outcome(partial(read, copies[0])) != "reads":
        raise RuntimeError("the reader fails on the undamaged file, or under the memory limit")
    counts = Counter(outcome(partial(read, data)) for data in copies[1:])
    return ", ".join(f"{counts[name]} {name}" for name in sorted(counts))


def vtk_pictures(frames: Any, faces: Any, camera: Camera) -> Callable[[], list[Any]]:
    """Return a function that draws frames by VTK, with the same camera and four samples."""

    def draw() -> list[Any]:
        vtk, arrays = (
            import_module(f"vtkmodules.{name}") for name in ("all", "util.numpy_support")
        )
        cells = vtk.vtkCellArray()
        corners = np.ascontiguousarray(faces, np.int64)
        cells.SetData(3, arrays.numpy_to_vtkIdTypeArray(corners.ravel(), deep=True))
        mesh, points = vtk.vtkPolyData(), vtk.vtkPoints()
        mesh.SetPoints(points)
        mesh.SetPolys(cells)
        points.SetData(arrays.numpy_to_vtk(frames[0], deep=True))
        normals, mapper, actor = vtk.vtkPolyDataNormals(), vtk.vtkPolyDataMapper(), vtk.vtkActor()
        normals.SetInputData(mesh)
        normals.SplittingOff()
        normals.ConsistencyOff()
        mapper.SetInputConnection(normals.GetOutputPort())
        actor.SetMapper(mapper)
        actor.GetProperty().SetColor(*(value / 255 for value in CLAY))
        scene, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
        scene.SetBackground(*(value / 255 for value in PAPER))
        scene.AddActor(actor)
        window.SetOffScreenRendering(True)
        window.SetMultiSamples(4)
        window.SetSize(camera.width, camera.height)
        window.AddRenderer(scene)
        view = scene.GetActiveCamera()
        view.SetPosition(*camera.eye)
        view.SetFocalPoint(*(camera.eye + camera.axes[2]))
        view.SetViewUp(*-camera.axes[1])
        view.SetViewAngle(np.degrees(2 * np.arctan(camera.height / 2 / camera.focal_px)))
        pictures = []
        for frame in frames:
            points.SetData(arrays.numpy_to_vtk(frame, deep=True))
            points.Modified()
            scene.ResetCameraClippingRange()
            window.Render()
            grab = vtk.vtkWindowToImageFilter()
            grab.SetInput(window)
            grab.ReadFrontBufferOff()
            grab.Update()
            values = arrays.vtk_to_numpy(grab.GetOutput().GetPointData().GetScalars())
            pictures.append(values.reshape(camera.height, camera.width, 3)[::-1].copy())
        return pictures

    return draw


VERTEX_SHADER = """
#version 330
uniform mat4 projection; uniform mat3 axes; uniform vec3 eye;
in vec3 position; in vec3 normal; out vec3 direction;
void main() {
  direction = axes * normal;
  gl_Position = projection * vec4(axes * (position - eye), 1.0);
}
"""
FRAGMENT_SHADER = """
#version 330
uniform vec3 color; in vec3 direction; out vec4 result;
void main() { result = vec4(color * (0.3 + 0.7 * abs(normalize(direction).z)), 1.0); }
"""


def moderngl_pictures(frames: Any, faces: Any, camera: Camera) -> Callable[[], list[Any]]:
    """Return a function that draws frames by OpenGL, with the same camera and four samples."""

    def draw() -> list[Any]:
        gl = import_module("moderngl")
        context = gl.create_standalone_context(backend="egl")
        size = (camera.width, camera.height)
        several = context.simple_framebuffer(size, components=3, samples=4)
        single = context.simple_framebuffer(size, components=3)
        program = context.program(vertex_shader=VERTEX_SHADER, fragment_shader=FRAGMENT_SHADER)
        depths = (frames - camera.eye) @ camera.axes[2]
        near, far = 0.9 * depths.min(), 1.1 * depths.max()
        projection = np.zeros((4, 4))
        projection[0, 0] = 2 * camera.focal_px / camera.width
        projection[1, 1] = -2 * camera.focal_px / camera.height
        projection[2, 2:] = (far + near) / (far - near), -2 * far * near / (far - near)
        projection[3, 2] = 1
        program["projection"].write(projection.T.astype("f4").tobytes())
        program["axes"].write(camera.axes.T.astype("f4").tobytes())
        program["eye"].value = tuple(camera.eye)
        program["color"].value = tuple(value / 255 for value in CLAY)
        indices = context.buffer(np.ascontiguousarray(faces, "i4").tobytes())
        values = context.buffer(reserve=frames[0].shape[0] * 24)
        array = context.vertex_array(program, [(values, "3f 3f", "position", "normal")], indices)
        pictures = []
        for frame in frames:
            both = np.concatenate([frame, vertex_normals(frame, faces)], axis=1).astype("f4")
            values.write(both.tobytes())
            several.use()
            several.clear(*(value / 255 for value in PAPER))
            context.enable(context.DEPTH_TEST)
            array.render()
            context.copy_framebuffer(single, several)
            pixels = np.frombuffer(single.read(components=3), np.uint8)
            pictures.append(pixels.reshape(camera.height, camera.width, 3)[::-1].copy())
        context.release()
        return pictures

    return draw


def covered(picture: Any) -> Any:
    """Pixels that differ from the background."""
    return (np.abs(picture.astype(int) - np.asarray(PAPER)) > 2).any(axis=2)


def bench_render(sequence: MeshSequence, repeats: int) -> None:
    """Draw the first frames of a clip."""
    frames = np.asarray(sequence.vertices[:N_PICTURES], np.float64)
    faces = np.asarray(sequence.faces)
    camera = fit_camera(frames, width=SIZE[0], height=SIZE[1])
    prepared = {
        "vtk": ("vtkmodules", vtk_pictures(frames, faces, camera)),
        "moderngl": ("moderngl", moderngl_pictures(frames, faces, camera)),
    }
    tasks: Tasks = {"own": lambda: [render(frame, faces, camera) for frame in frames]}
    tasks |= available(prepared)
    seconds = measure(tasks, repeats)
    own = tasks["own"]()
    rows = []
    for name, draw in tasks.items():
        first, again = draw(), draw()
        same = all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
        outline = np.mean(
            [np.mean(covered(a) != covered(b)) for a, b in zip(first, own, strict=True)]
        )
        rows.append(
            [name, f"{seconds[name] / len(frames):.3f}", f"{100 * outline:.3f} %", str(same)]
        )
    print_table("", ["render", "CPU s a picture", "pixels of other coverage", "repeatable"], rows)


def obj_text(sequence: MeshSequence) -> bytes:
    """The first frame as OBJ, as meshreel writes it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame_0000.obj"
        meshreel.save(MeshSequence(sequence.vertices[:1], sequence.faces), path)
        [written] = sorted(Path(folder).rglob("*.obj"))
        return written.read_bytes()


def with_file(read: Callable[[str], Any], suffix: str, data: bytes) -> Any:
    """Call a reader that needs a path."""
    with tempfile.NamedTemporaryFile(suffix=suffix) as file:
        file.write(data)
        file.flush()
        return read(file.name)


def read_by_vtk(reader_name: str, path: str) -> Any:
    """Read points by a reader of VTK; it reports errors on standard error only."""
    reader = getattr(import_module("vtkmodules.all"), reader_name)()
    reader.SetFileName(path)
    reader.Update()
    points = reader.GetOutput().GetPoints()
    if points is None:
        raise ValueError("no points")
    return import_module("vtkmodules.util.numpy_support").vtk_to_numpy(points.GetData())


def read_by_tiny(path: str) -> Any:
    """Read points by tinyobjloader."""
    reader = import_module("tinyobjloader").ObjReader()
    if not reader.ParseFromFile(path):
        raise ValueError(reader.Error())
    return np.array(reader.GetAttrib().vertices).reshape(-1, 3)


def read_by_trimesh(path: str) -> Any:
    """Read points by trimesh, in file order."""
    load = import_module("trimesh").load
    return load(path, process=False, maintain_order=True, force="mesh").vertices


def compare_readers(title: str, readers: Tasks, data: bytes, wanted: Any, repeats: int) -> None:
    """Time readers of a file, compare positions, and count outcomes for damaged copies."""
    copies = damaged(data)
    outcomes = {name: counts_of(read, copies) for name, read in readers.items()}  # before threads
    seconds = measure({name: partial(read, data) for name, read in readers.items()}, repeats)
    rows = []
    for name, read in readers.items():
        points = np.asarray(read(data), np.float32)
        same = np.array_equal(points, wanted.astype(np.float32))
        rows.append([name, f"{1000 * seconds[name]:.1f}", str(same), outcomes[name]])
    print_table("", [title, "CPU ms", "equal positions", f"{N_DAMAGED} damaged copies"], rows)


def read_by_meshio(path: str) -> Any:
    """Read points by meshio."""
    return import_module("meshio").read(path).points


def bench_obj(sequence: MeshSequence, repeats: int) -> None:
    """Parse a frame as OBJ."""
    data = obj_text(sequence)
    libraries = {
        "trimesh": ("trimesh", partial(with_file, read_by_trimesh, ".obj")),
        "meshio": ("meshio", partial(with_file, read_by_meshio, ".obj")),
        "tinyobjloader": ("tinyobjloader", partial(with_file, read_by_tiny, ".obj")),
        "vtk": ("vtkmodules", partial(with_file, partial(read_by_vtk, "vtkOBJReader"), ".obj")),
    }
    readers: Tasks = {"own": lambda data: read_obj(data).mesh.vertices, **available(libraries)}
    title = f"read OBJ, {len(data):,} bytes"
    compare_readers(title, readers, data, read_obj(data).mesh.vertices, repeats)


def vtu_writers(sequence: MeshSequence) -> Tasks:
    """Functions that write the first frame as VTU and return its bytes."""
    vertices, faces = np.asarray(sequence.vertices[0], np.float32), np.asarray(sequence.faces)

    def by_meshio() -> bytes:
        meshio = import_module("meshio")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "frame.vtu"
            meshio.Mesh(vertices, [("triangle", faces)]).write(path)
            return path.read_bytes()

    def by_vtk() -> bytes:
        vtk = import_module("vtkmodules.all")
        arrays = import_module("vtkmodules.util.numpy_support")
        cells, grid, points = vtk.vtkCellArray(), vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
        cells.SetData(3, arrays.numpy_to_vtkIdTypeArray(faces.astype(np.int64).ravel(), deep=True))
        points.SetData(arrays.numpy_to_vtk(vertices, deep=True))
        grid.SetPoints(points)
        grid.SetCells(vtk.VTK_TRIANGLE, cells)
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetInputData(grid)
        writer.SetDataModeToAppended()
        writer.EncodeAppendedDataOff()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "frame.vtu"
            writer.SetFileName(str(path))
            writer.Write()
            return path.read_bytes()

    stream = SegmentedStream(sequence).only()
    return {"own": lambda: vtu_encoder(stream)(vertices, {})} | available(
        {"meshio": ("meshio", by_meshio), "vtk": ("vtkmodules", by_vtk)}
    )


def bench_vtu(sequence: MeshSequence, repeats: int) -> None:
    """Write and read a frame as VTU."""
    writers = vtu_writers(sequence)
    seconds = measure(writers, repeats)
    rows = [
        [name, f"{1000 * seconds[name]:.1f}", f"{len(write()):,}"]
        for name, write in writers.items()
    ]
    print_table("", ["write VTU", "CPU ms", "bytes"], rows)
    data = writers["own"]()
    by_vtk = partial(read_by_vtk, "vtkXMLUnstructuredGridReader")
    libraries = {
        "meshio": ("meshio", partial(with_file, read_by_meshio, ".vtu")),
        "vtk": ("vtkmodules", partial(with_file, by_vtk, ".vtu")),
    }
    readers: Tasks = {"own": lambda data: read_frame(data).mesh.vertices, **available(libraries)}
    wanted = np.asarray(sequence.vertices[0], np.float32)
    compare_readers("read VTU", readers, data, wanted, repeats)


def bench_xml(sequence: MeshSequence, repeats: int) -> None:
    """Parse a collection of 20,000 steps."""
    row = '<Grid Name="frame {0}"><Time Value="{0}"/><DataItem>a.h5:/{0}</DataItem></Grid>\n'
    data = f"<Xdmf>{''.join(row.format(number) for number in range(20_000))}</Xdmf>".encode()
    tasks: Tasks = {"own (expat)": partial(parse_xml, data)}
    tasks |= available({"lxml": ("lxml", lambda: import_module("lxml.etree").fromstring(data))})
    seconds = measure(tasks, repeats)
    rows = [[name, f"{value:.3f}"] for name, value in seconds.items()]
    print_table("", [f"parse XML, {len(data):,} bytes", "CPU s"], rows)


def bench_film(sequence: MeshSequence, repeats: int) -> None:
    """Encode finished pictures as H.264 with equal settings."""
    from PIL import Image

    frames = np.asarray(sequence.vertices[:N_PICTURES], np.float64)
    camera = fit_camera(frames, width=SIZE[0], height=SIZE[1])
    film = Film([Image.fromarray(render(frame, sequence.faces, camera)) for frame in frames])
    folder = Path(tempfile.mkdtemp())

    def own() -> Path:
        save_mp4(film, folder / "own.mp4", overwrite=True)  # type: ignore[arg-type]
        return folder / "own.mp4"

    def by_imageio() -> Path:
        from meshreel.rendering.film_files import _MP4_OPTIONS

        path = folder / "imageio.mp4"
        at = _MP4_OPTIONS.index("-vf")
        writer = import_module("imageio_ffmpeg").write_frames(
            str(path), SIZE, fps=film.fps, macro_block_size=1, codec="libx264", quality=None,
            ffmpeg_log_level="error",
            output_params=["-crf", "18", "-preset", "medium", "-threads", "1", *_MP4_OPTIONS[at:]],
        )  # fmt: skip
        writer.send(None)
        for image in film.images:
            writer.send(image.tobytes())
        writer.close()
        return path

    def by_av() -> Path:
        av, path = import_module("av"), folder / "av.mp4"
        with av.open(str(path), "w", options={"movflags": "+faststart"}) as container:
            stream = container.add_stream("libx264", rate=25)
            stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
            stream.options = {"crf": "18", "preset": "medium", "threads": "1"}
            for image in film.images:
                for packet in stream.encode(av.VideoFrame.from_image(image)):
                    container.mux(packet)
            for packet in stream.encode():
                container.mux(packet)
        return path

    tasks: Tasks = {"own": own}
    tasks |= available(
        {
            "imageio-ffmpeg": ("imageio_ffmpeg", by_imageio),
            "av": ("av", by_av),
        }
    )
    seconds = measure(tasks, repeats)
    first = own().read_bytes()
    rows = [
        [
            name,
            f"{seconds[name]:.2f}",
            f"{write().stat().st_size:,}",
            str(write().read_bytes() == first),
        ]
        for name, write in tasks.items()
    ]
    print_table("", [f"film of {N_PICTURES} pictures", "CPU s", "bytes", "same bytes"], rows)


def installed_with(name: str) -> set[str]:
    """Names of a library and of the libraries that it requires, without extras."""
    libraries: set[str] = set()
    missing = [name]
    while missing:
        library = missing.pop().lower().replace("_", "-")
        if library in libraries | BASE:
            continue
        try:
            requirements = metadata.requires(library) or []
        except metadata.PackageNotFoundError:  # a requirement of another platform
            continue
        libraries.add(library)
        missing += [
            re.split(r"[^\w.-]", text)[0] for text in requirements if "extra ==" not in text
        ]
    return libraries


def size_mb(name: str) -> float:
    """Megabytes of the installed files of a library."""
    paths = [Path(str(file.locate())) for file in metadata.files(name) or []]
    return sum(path.stat().st_size for path in paths if path.exists()) / 1e6


def list_sizes(sequence: MeshSequence, repeats: int) -> None:
    """List what each library installs."""
    rows = []
    for name in LIBRARIES:
        if all_of := installed_with(name):
            others = sorted(all_of - {name.lower()})
            total = sum(map(size_mb, all_of))
            rows.append(
                [f"{name} {metadata.version(name)}", f"{total:.1f}", ", ".join(others) or "-"]
            )
    print_table("", ["library", "MB", "requires, besides NumPy and Pillow"], rows)


BENCHES = {
    "render": bench_render, "obj": bench_obj, "vtu": bench_vtu, "xml": bench_xml,
    "film": bench_film, "sizes": list_sizes,
}  # fmt: skip


def main() -> None:
    """Print a table for each task."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("sequence", type=Path)
    parser.add_argument("--only", nargs="+", choices=BENCHES, default=[*BENCHES])
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    sequence = meshreel.load(options.sequence)
    for name in options.only:
        BENCHES[name](sequence, options.repeats)


if __name__ == "__main__":
    main()
