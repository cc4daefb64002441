"""Odd sequences from independent choices, of each the simplest first."""

import random
from dataclasses import replace
from typing import Any

import numpy as np

import meshreel as mr
from meshreel.model.surface import Domain
from meshreel.model.timing import Timing
from samples.meshes import grid_faces
from samples.shapes import torus

CHOICES = {
    "mesh": "grid triangle torus quads tetrahedra mixed components isolated degenerate coincident",
    "motion": "smooth still rigid noise jump last mostly one_axis",
    "frames": "3 1 2 7 40 61",
    "segments": "1 2_new 3_new 2_same",
    "times": "rate none uneven start late gap",
    "place": "unit far tiny huge",
    "type": "f4 f8",
    "attributes": "none uv seams colors groups all",
}
TRACK_CHOICES = {
    "domain": "vertex face cell corner",
    "kind": "scalar vector velocity normal color other uv",
    "pattern": "smooth noise one_frame first_frame zero_middle zero_first round_off_first "
    "integers_first nan_first constant_first tiny_then_huge few_integers large_integers constant "
    "one_column small_range coincident related nan mostly_nan infinite",
    "type": "f4 f8 i4 u1 i8",
}
N_COLUMNS = {"scalar": 1, "color": 3, "other": 5, "uv": 2}
PLACES = {"unit": (1, 0), "far": (1, 1e4), "tiny": (1e-6, 0), "huge": (1e7, -3e7)}


def choose(seed):
    """Return the choices of a sequence: for each the simplest, or any."""
    rng = random.Random(seed)

    def pick(table):
        words = {name: text.split() for name, text in table.items()}
        return {
            name: rng.choice(some[: 1 if rng.random() < 0.35 else None])
            for name, some in words.items()
        }

    tracks = [pick(TRACK_CHOICES) for _ in range(rng.choice([0, 1, 1, 2, 3]))]
    return pick(CHOICES) | {"seed": seed, "tracks": tracks}


def simpler(choice):
    """Yield choices that are simpler in one way."""
    tracks = choice["tracks"]
    for number, track in enumerate(tracks):
        changed = [track | {name: text.split()[0]} for name, text in TRACK_CHOICES.items()]
        for one in [[], *([other] for other in changed if other != track)]:
            yield choice | {"tracks": tracks[:number] + one + tracks[number + 1 :]}
    changed = [choice | {name: text.split()[0]} for name, text in CHOICES.items()]
    yield from (other for other in changed if other != choice)


def at_rest(mesh, n):
    """Return the points of a mesh, and its faces, sizes of polygons, and cells, or None."""
    faces, points = grid_faces(n, n), np.argwhere(np.ones((n, n))) / (n - 1)
    points, size = np.c_[points, 0.1 * np.sin(3 * points[:, 0])], len(points)
    above = faces + size
    if mesh == "triangle":
        return points[faces[0]], np.array([[0, 1, 2]]), None, None
    if mesh == "torus":
        return *torus(n, n + 1), None, None
    if mesh == "quads":
        corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).reshape(-1, 1)
        quads = corner + np.array([0, n, n + 1, 0, n + 1, 1])
        return points, quads.reshape(-1, 3), np.full(len(corner), 4, np.int32), None
    if mesh == "tetrahedra":
        split = [np.c_[faces[:, i:], above[:, : i + 1]] for i in range(3)]
        nodes, types = np.concatenate(split), [10] * (3 * len(faces))
    if mesh == "mixed":  # a hexahedron, wedges and a triangle
        quad, wedges = np.array([0, n, n + 1, 1]), np.c_[faces[1:], above[1:]]
        nodes = np.concatenate([quad, quad + size, wedges.ravel(), above[2]])
        types = [12] + [13] * len(wedges) + [5]
    if mesh in ("tetrahedra", "mixed"):
        cells = mr.Cells(np.array(types, np.uint8), nodes.ravel().astype(np.int32))
        return np.concatenate([points, points + np.array([0, 0, 1])]), None, None, cells
    if mesh == "components":
        points = np.concatenate([points, points + 3, points[faces[0]] - 2])
        faces = np.concatenate([faces, above, 2 * size + np.arange(3)[None]])
    if mesh == "isolated":
        points, faces = np.concatenate([points[:1] + 5, points, points[:2] - 3]), faces + 1
    if mesh == "degenerate":
        faces = np.concatenate([faces, [[0, 0, 1], [2, 2, 2]], faces[:1]])
    if mesh == "coincident":
        points, faces = np.concatenate([points, points]), np.concatenate([faces, above])
    return points, faces, None, None


def moved(points, choice, frames, rng):
    """Return positions in numbered frames, of shape (T, V, 3)."""
    n_frames, time = len(frames), frames[:, None, None]
    noise = rng.normal(size=(n_frames, *points.shape))
    wave = np.sin(2 * points @ [[1], [2], [3]] + 0.3 * time) * [0.1, 0.2, 0.3]
    moves = {"smooth": wave, "rigid": time * [0.1, 0.2, 0.05], "one_axis": wave * [0, 0, 1]}
    vertices = points + moves.get(choice["motion"], noise * (choice["motion"] == "noise") / 20)
    changed = {"jump": [n_frames // 3], "last": [-1], "mostly": [0, n_frames // 2]}
    for frame in changed.get(choice["motion"], []):
        vertices[frame] += 0.3 * noise[frame]
    scale, offset = PLACES[choice["place"]]
    return (vertices * scale + offset).astype(choice["type"])


def values_of(track, shape, rng, earlier, first_frame):
    """Return the values of a track, of shape (T, N, C)."""
    frame, item, column = np.ogrid[: shape[0], : shape[1], : shape[2]]
    is_late, is_middle = frame > shape[0] // 2, frame == shape[0] // 2
    noise, chance = rng.normal(size=shape), rng.random((*shape[:2], 1))
    smooth = 3 * np.sin(5 * item / shape[1] + 0.2 * (frame + first_frame) + column)
    is_related = earlier is not None and earlier.shape[:2] == shape[:2]
    known = np.nan_to_num(earlier[..., :1] * 1.0, posinf=0, neginf=0) if is_related else 0
    values = {
        "smooth": smooth, "noise": noise, "constant": noise * 0 + 2.5,
        "few_integers": np.rint(noise), "large_integers": np.rint(1e7 * noise),
        "one_frame": noise * (frame == rng.integers(shape[0])), "first_frame": noise * (frame == 0),
        "zero_middle": noise * ~is_middle, "zero_first": noise * is_late,
        "round_off_first": noise * np.where(is_late, 1, 1e-16), "related": known**2 + noise / 100,
        "integers_first": np.where(is_late, noise, np.rint(noise)),
        "nan_first": np.where(is_late, noise, np.nan), "small_range": 1e5 + 1e-3 * noise,
        "constant_first": np.where(is_late, noise, 2.5),
        "tiny_then_huge": noise * np.where(is_late, 1e12, 1e-12),
        "one_column": smooth * (column == shape[2] - 1),
        "coincident": noise[:, np.arange(shape[1]) // 2],
        "nan": np.where(chance < 0.1, np.nan, smooth),
        "mostly_nan": np.where(chance < 0.95, np.nan, smooth),
        "infinite": np.where(is_middle & (item == 0) & (column == 0), np.inf, smooth),
    }[track["pattern"]]  # fmt: skip
    finite, is_byte = np.where(np.isinf(values), 1, values), track["type"] == "u1"
    if track["kind"] == "normal":
        length = np.linalg.norm(finite, axis=2, keepdims=True)
        values = np.divide(finite, length, out=np.zeros(shape), where=length != 0)
    if track["kind"] == "color":
        largest = np.nanmax(np.abs(finite), initial=0) or 1
        values = np.abs(values) / largest * (255 if is_byte else 1)
    if track["type"] not in ("f4", "f8"):
        low, high = (0, 255) if is_byte else (-(2**31), 2**31 - 1)
        values = np.clip(np.rint(np.nan_to_num(values)), low, high)
    return values.astype(track["type"])


def attributes_of(name, points, n_corners, rng):
    """Return the attributes of a surface with a name of the choices."""
    colors, seams = rng.random((len(points), 4), "f4"), rng.random((n_corners, 2), "f4")
    uv = mr.Attribute("uv", mr.Kind.UV, Domain.VERTEX, points[:, :2].astype("f4"))
    color = mr.Attribute("color", mr.Kind.COLOR, Domain.VERTEX, colors)
    seamed = mr.Attribute("uv", mr.Kind.UV, Domain.CORNER, seams)
    return {"uv": (uv,), "seams": (seamed,), "colors": (color,), "all": (uv, color)}.get(name, ())


def made(choice):
    """Return the sequence of some choices."""
    rng, n_frames = np.random.default_rng(choice["seed"]), int(choice["frames"])
    parts, all_times, grows = [], [], choice["segments"].endswith("new")
    for number in range(int(choice["segments"][0])):
        frames = np.arange(n_frames) + number * n_frames
        points, faces, sizes, cells = at_rest(choice["mesh"], 5 + number * grows)
        vertices, plain = moved(points, choice, frames, rng), mr.Surface(face_sizes=sizes)
        mesh = mr.MeshSequence(vertices, faces, surface=plain, cells=cells)
        n_items = {one: mesh.surface.n_items(one, mesh.n_verts, mesh.n_faces) for one in Domain}
        tracks, values = {}, None
        for name, track in zip("abc", choice["tracks"], strict=False):
            lacks = track["domain"] == ("cell" if cells is None else "corner")
            domain = Domain("face" if lacks else track["domain"])
            if track["kind"] in ("velocity", "normal", "uv") and track["type"][0] != "f":
                track = track | {"type": "f4"}
            shape = n_frames, n_items[domain], N_COLUMNS.get(track["kind"], 3)
            values = values_of(track, shape, rng, values, frames[0])
            unit = "Pa" if track["kind"] == "scalar" else ""
            tracks[name] = mr.Track(values, domain, track["kind"], unit)
        labels = (np.arange(n_items[Domain.FACE]) % 3 - 1).astype(np.int32)
        group = mr.FaceGroups("group", ("a", "b"), labels)
        attributes = attributes_of(choice["attributes"], points, n_items[Domain.CORNER], rng)
        groups = (group,) if choice["attributes"] in ("groups", "all") and len(labels) > 1 else ()
        surface = replace(mesh.surface, attributes=attributes, groups=groups)
        timings: dict[str, dict[str, Any]] = {
            "rate": {"fps": 30}, "start": {"fps": 24, "start_s": 1.25}, "none": {},
            "uneven": {"times": (frames + 0.3 * np.sin(frames)) / 7},
            "late": {"times": 1e4 + 0.1 * frames + 0.013 * (frames % 2)},
            "gap": {"times": 0.1 * frames + 3 * number},
        }  # fmt: skip
        timing = timings[choice["times"]]
        all_times += list(timing.get("times", ()))
        parts.append(mesh.replace(surface=surface, tracks=tracks, **timing))
    times = Timing.of_times(all_times) if all_times else None
    return parts[0] if len(parts) == 1 else mr.MeshSequence.of_segments(parts, timing=times)
