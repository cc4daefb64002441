"""The C# binding, `integrations/csharp`, compiled and run by Mono."""

import hashlib
import re
import shutil
import sys
from ctypes import POINTER, byref, c_uint32
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.codec.open_stream import whole_stream
from meshreel.codec.surface.codes import ALPHA_MODES, CHANNELS, FILTERS, WRAPS
from meshreel.kernel.library import NAME
from meshreel.kernel.library import library as core
from meshreel.model.materials import SLOTS
from samples import c_reader
from samples.c_interface import layouts
from samples.c_reader import CModes, CSurface, Decoder, File, Layout, RefusalError
from samples.meshes import waving_grid
from samples.programs import output_of

ROOT = Path(__file__).parents[3]
BINDING, TESTED = ROOT / "integrations" / "csharp", Path(__file__).parent / "csharp"
LIBRARY = [BINDING / name for name in ("Native.cs", "Host.cs", "Meshreel.cs")]
STREAMS = sorted((ROOT / "conformance" / "streams").glob("*.reel"))
SEGMENTS = sorted((ROOT / "conformance" / "segments").glob("*.reel"))
EVERYTHING = ROOT / "conformance" / "streams" / "everything.reel"
TRACKS = EVERYTHING.with_name("corners_in_rows.reel")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="tried where Mono finds .so or .dylib"),
    pytest.mark.skipif(
        shutil.which("mcs") is None or shutil.which("mono") is None,
        reason="needs Mono (Debian: mono-mcs)",
    ),
]


UNITY = ROOT / "examples/unity/ReelPlayer.cs", TESTED / "UnityEngine.cs"


def compiled(folder, name, *sources):
    """Compile a C# 7.2 program next to the library that it loads."""
    shutil.copy(core()._name, folder / ("libmeshreel" + Path(NAME).suffix))
    program = folder / f"{name}.exe"
    strict = "-langversion:7.2", "-warn:4", "-warnaserror"
    output_of("mcs", *strict, f"-out:{program}", *LIBRARY, *sources)
    return program


@pytest.fixture(scope="module")
def describe(tmp_path_factory):
    """A program that prints the contents of files."""
    return compiled(tmp_path_factory.mktemp("describe"), "describe", TESTED / "Describe.cs")


def hashed(numbers):
    return "-" if numbers is None else hashlib.sha256(np.ascontiguousarray(numbers)).hexdigest()


def described(path):
    """Return the expected output for a file."""
    try:
        yield from whole_lines(path.read_bytes())
    except RefusalError as error:
        place = "" if error.offset == c_reader.UNKNOWN_OFFSET else error.offset
        message = str(error).split(": ", 1)[1]
        shown = f" (byte {place})" if place != "" else ""
        yield f"failed {error.code} {place} {message}{shown}"


def whole_lines(data):
    with File(data, mesh=False) as file:
        info = file.info
        yield (
            f"file {info.n_frames} frames, {info.n_segments} segments, {number(info.fps)} fps, "
            f"start {number(info.start_s)}, whole {bool(info.is_whole)}"
        )
        yield f"times {hashed(file.times)}"
        yield f"shown {file.frame_at(-1)} {file.frame_at(1.99)} {file.frame_at(1e9)}"
        for i, segment in enumerate(file.segments):
            last = file.segment_of_frame(segment.first_frame + segment.n_frames - 1)
            yield f"segment {i} {segment.first_frame} {segment.n_frames} {segment.offset} {last}"
            with file.open_segment(i, mesh=False) as opened:
                yield from mesh_lines(opened)
                with Decoder(opened) as decoder:
                    yield from frame_lines(opened, decoder)
                yield from surface_lines(opened, data, i)


def number(value):
    """Format a number like C#."""
    return f"{value:.15G}"


def mesh_lines(file):
    info = file.info
    counts = info.n_verts, info.n_triangles, info.n_faces, info.n_corners
    yield f"mesh '{info.name}' " + " ".join(map(str, counts))
    yield f"box {hashed(np.array([*info.center, info.diagonal, info.error_bound_percent]))}"
    file.read_mesh()
    yield f"triangles {hashed(file.triangles)}"


def frame_lines(file, decoder):
    info = file.info
    for i, track in enumerate(file.tracks):
        codes = f"{track.kind} {track.domain} {track.type} {hashed(np.array([track.bound]))}"
        yield f"track '{track.name}' '{track.unit}' {codes} {bool(track.is_exact)}"
        block = file.block(info.n_blocks - 1, i)
        n_modes = file.group(info.n_blocks - 1, i, check=False).n_modes
        frames = f"{block.first_frame} {block.n_frames} {block.offset} {block.size}"
        yield f"block {frames} modes {n_modes}"
        yield f"values {hashed(decoder.frames(i))}"
        yield f"later {hashed(decoder.frames(i, info.n_frames // 2))}"
    yield f"modes {hashed(modes_of(decoder))}"
    yield f"preview {hashed(decoder.frames(n_modes=2, dtype=np.float32))}"
    floats = decoder.frames(first=info.n_frames - 1, dtype=np.float32)
    yield f"floats {hashed(floats)}"
    yield f"normals {hashed(decoder.normals(floats[0]))}"
    vertices = np.zeros((2, info.n_verts, 5), np.float32)
    layout = Layout(type=c_reader.FLOAT32, value_stride=20)
    decoder.decode(vertices.reshape(-1)[1:], 0, 0, min(2, info.n_frames), layout=layout)
    yield f"strided {hashed(vertices)}"
    if info.number_bytes == 8:
        yield f"doubles {hashed(decoder.normals(decoder.frames(count=1)[0]))}"


def modes_of(decoder):
    """Return numbers and arrays of the modes of a block, in the order of the header."""
    modes = CModes()
    c_reader.call("modes_of", decoder.handle, c_uint32(0), c_uint32(0), byref(modes))
    shape = modes.n_frames, modes.n_modes, modes.n_columns, modes.n_items
    if not modes.n_modes:
        return np.array(shape, float)
    n_frames, n_modes, n_columns, n_items = shape
    starts = modes.correction_starts
    starts = c_reader.array_at(starts, n_frames + 1, np.int64) if starts else np.zeros(0)
    n_corrections = int(starts[-1]) if len(starts) else 0
    arrays = [
        shape,
        (modes.step, modes.scale),
        c_reader.array_at(modes.origin, n_columns, float),
        c_reader.array_at(modes.values, n_items * n_modes, float),
        c_reader.array_at(modes.rows, n_items, np.int32),
        c_reader.array_at(modes.basis, n_columns * n_frames * n_modes, float),
        starts,
        c_reader.array_at(modes.corrected, n_corrections, np.int32),
        c_reader.array_at(modes.corrections, n_corrections * n_columns, float),
    ]
    return np.concatenate([np.asarray(array, float) for array in arrays])


def surface_lines(file, data, number):
    file.read_surface()
    surface = whole_stream(data, segment=number).surface
    c = c_reader.returned("surface_of", POINTER(CSurface), file.handle).contents
    edges = c_reader.array_at(c.hard_edges, 2 * c.n_hard_edges, np.int32)
    yield f"faces {hashed(surface.face_sizes)} hard {hashed(edges)}"
    cells = surface.cells
    arrays: tuple[Any, ...] = (None,) * 3
    if cells is not None:
        owners = cells.surface(file.info.n_verts).owners
        arrays = cells.types, cells.nodes, owners.astype(np.int32)
    yield f"cells {file.info.n_cells} {' '.join(map(hashed, arrays))}"
    names = {"uint8": "Byte", "int32": "Int32", "float32": "Single", "float64": "Double"}
    for i, attribute in enumerate(surface.attributes):
        code, values = c.attributes[i], attribute.values
        stored = (values, attribute.indices) if code.is_indexed else (None, None)
        each = values if attribute.indices is None else values[attribute.indices]
        hashes = " ".join(map(hashed, [*stored, each.astype(float)]))
        codes = f"{code.kind} {code.domain} {code.width}"
        yield f"attribute '{attribute.name}' {codes} {names[values.dtype.name]} {hashes}"
    for groups in surface.groups:
        yield f"groups '{groups.name}' {'|'.join(groups.labels)} {hashed(groups.numbers)}"
    for part in surface.parts:
        yield f"part '{part.name}' {part.n_verts} {part.n_faces}"
    for material in surface.materials:
        yield from material_lines(material)
    for image in surface.images:
        yield f"image '{image.name}' {image.mime_type} {hashed(np.frombuffer(image.data, 'u1'))}"


def material_lines(m):
    numbers = [
        *m.base_color, m.metallic, m.roughness, *m.emissive, m.normal_scale,
        m.occlusion_strength, m.alpha_cutoff,
    ]  # fmt: skip
    codes = f"{ALPHA_MODES.index(m.alpha_mode)} {m.double_sided} {m.unlit}"
    yield f"material '{m.name}' {codes} {hashed(np.array(numbers, float))}"
    for slot in SLOTS:
        t = m.textures.get(slot)
        if t is None:
            yield "no texture"
            continue
        channels = sum(1 << CHANNELS.index(channel) for channel in t.channels)
        filters = [FILTERS.index(f) + 1 if f else 0 for f in (t.magnified, t.shrunk)]
        numbers = [t.image, channels, WRAPS.index(t.wrap_u), WRAPS.index(t.wrap_v), *filters]
        moved = hashed(np.array([*t.offset, t.rotation, *t.scale], float))
        yield f"texture {' '.join(map(str, numbers))} '{t.uv}' {moved}"


def test_structures_have_the_layout_of_c(describe):
    layout = re.compile("(size|offset) meshreel_")
    expected = {line for line in layouts() if layout.match(line)}
    assert set(output_of("mono", describe, "layouts").splitlines()) == expected


@pytest.mark.parametrize("way", ["bytes", "path", "threads"])
def test_csharp_decodes_the_same_values_as_python(describe, way):
    expected = [line for path in STREAMS + SEGMENTS for line in described(path)]
    assert output_of("mono", describe, way, *STREAMS, *SEGMENTS).splitlines() == expected


def test_error_names_the_byte_of_the_damage(describe, tmp_path):
    data = EVERYTHING.read_bytes()
    paths = []
    for at in range(40, len(data), 211):
        cut, changed = tmp_path / f"cut_{at}.reel", tmp_path / f"changed_{at}.reel"
        cut.write_bytes(data[:at])
        changed.write_bytes(data[:at] + bytes([data[at] ^ 16]) + data[at + 1 :])
        paths += [cut, changed]
    empty = tmp_path / "empty.reel"
    empty.write_bytes(b"")
    expected = [line for path in [*paths, empty] for line in described(path)]
    assert sum(line.startswith("failed") and "(byte " in line for line in expected) > 40
    for way in ("path", "bytes"):
        assert output_of("mono", describe, way, *paths, empty).splitlines() == expected


def test_csharp_program_passes_its_own_checks(tmp_path):
    """Threads, failing streams, memory, invalid arguments; the program prints failed checks."""
    program = compiled(tmp_path, "checks", TESTED / "Checks.cs")
    two_meshes = ROOT / "conformance" / "segments" / "two_meshes.reel"
    integers = EVERYTHING.with_name("exact_i2.reel")
    assert output_of("mono", program, EVERYTHING, two_meshes, integers) == "passed\n"


def test_csharp_code_of_the_guide_runs(tmp_path):
    page = (ROOT / "docs" / "guides" / "engines.md").read_text(encoding="utf-8")
    shown = re.findall(r"^```csharp\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    using, body = shown[0].split("\n\n", 1)
    source = tmp_path / "Shown.cs"
    vertex = "struct Vertex { public float X, Y, Z, NX, NY, NZ, U, V; }"
    main = "static void Main(string[] words) { string path = words[0]; int frame = 1;"
    source.write_text(f"{using}\n{vertex}\nstatic class Shown {{ {main}\n{body}}} }}\n")
    lines = output_of("mono", compiled(tmp_path, "shown", source), TRACKS).splitlines()
    sizes = {"wave": 118, "gaps": 118, "whole": 59, "normals": 177, "own": 59}
    assert lines == [f"{name}: {size} numbers" for name, size in sizes.items()]


@pytest.fixture(scope="module")
def play(tmp_path_factory):
    """A program that plays files with the Unity component, and prints the shown values."""
    folder = tmp_path_factory.mktemp("play")
    return compiled(folder, "play", *UNITY, TESTED / "Play.cs")


def shown_frames(path, mirrored=True):
    """Return the values that the component must show for each frame, by corner."""
    data = path.read_bytes()
    with File(data, mesh=False) as file:
        for number, segment in enumerate(file.segments):
            with file.open_segment(number) as opened, Decoder(opened) as decoder:
                corners, items, uvs = shown_corners(
                    opened, whole_stream(data, segment=number).surface, mirrored
                )
                n_vertices = len(np.unique(np.column_stack([corners, items]), axis=0))
                for t, positions in enumerate(decoder.frames(dtype=np.float32)):
                    vectors = [positions, decoder.normals(positions)]
                    side = np.array([-1 if mirrored else 1, 1, 1], np.float32)
                    hashes = " ".join(hashed((vector * side)[corners] + 0) for vector in vectors)
                    frame = segment.first_frame + t
                    yield f"{frame} {number} {n_vertices} {hashes} {hashed(uvs)}"


def shown_corners(file, surface, mirrored):
    """Return vertices, UV rows and UVs of the drawn triangles."""
    n_triangles, n_faces = file.info.n_triangles, file.info.n_faces
    sizes = np.full(n_faces, 3) if surface.face_sizes is None else surface.face_sizes
    starts = np.cumsum(sizes) - sizes
    faces = np.repeat(np.arange(n_faces), sizes - 2)
    second = (
        starts[faces]
        + 1
        + np.arange(n_triangles)
        - np.repeat(np.cumsum(sizes - 2) - sizes + 2, sizes - 2)
    )
    corners = np.stack([starts[faces], second, second + 1], axis=1)
    groups = [group for group in surface.groups if group.name == "material"]
    labels = groups[0].numbers[faces] if groups else np.zeros(n_triangles, int)
    order = np.argsort(np.where(labels < 0, labels.max() + 1, labels), kind="stable")
    turned = [0, 2, 1] if mirrored else [0, 1, 2]
    corners, vertices = (one[order][:, turned].ravel() for one in (corners, file.triangles))
    uv = next((attribute for attribute in surface.attributes if attribute.kind == "uv"), None)
    if uv is None:
        return vertices, vertices, None
    items = {"vertex": vertices, "corner": corners}[uv.domain]
    rows = items if uv.indices is None else uv.indices[items]
    coordinates = uv.values[rows].astype(np.float32)
    if uv.domain == "vertex":
        return vertices, vertices, coordinates
    if uv.indices is None:  # corners of a vertex with equal coordinates share a row
        rows = np.unique(uv.values, axis=0, return_inverse=True)[1].ravel()[items]
    return vertices, rows, coordinates


@pytest.mark.parametrize("way", ["ahead", "direct", "backwards", "as it is"])
@pytest.mark.parametrize(
    "name", ["everything", "blocks", "attributes_of_vertices", "two_meshes", "one_frame_each"]
)
def test_unity_component_shows_every_frame(play, name, way):
    (path,) = [path for path in STREAMS + SEGMENTS if path.stem == name]
    frames = list(shown_frames(path, mirrored=way != "as it is"))
    last = frames[0] if way == "backwards" else frames[-1]
    played = frames[::-1] if way == "backwards" else frames
    expected = played + played[:2] + [frames[-1], frames[0], frames[-2], last]  # loops, and seeks
    assert output_of("mono", play, way, path).splitlines() == expected


def test_unity_component_shows_frames_when_they_are_due(play, tmp_path):
    path = tmp_path / "uneven.reel"
    times = [2, 2.5, 3, 3.5, 3.75]
    path.write_bytes(meshreel.encode(waving_grid(5).replace(times=times)))
    seconds = (-1, 0, 0.49, 0.5, 1.5, 1.74, 1.75, 2.1)
    shown = output_of("mono", play, "at", path, *map(str, seconds))
    mean = 1.75 / 4
    assert float(shown.split()[0]) == pytest.approx(1.75 + mean)
    assert shown.split()[1:] == ["0", "0", "0", "1", "3", "3", "4", "4"]


def test_unity_component_stops_at_damage(play, tmp_path):
    damaged = tmp_path / "damaged.reel"
    data = EVERYTHING.read_bytes()
    damaged.write_bytes(data[:6200] + bytes([data[6200] ^ 1]) + data[6201:])
    shown = output_of("mono", play, "ahead", damaged).splitlines()
    assert shown == ["failed Corrupt, closed"]
