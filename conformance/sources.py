"""Small, generated, deterministic meshes and motions for the streams."""

import numpy as np

from meshreel.kernel.cells import cell_sizes
from meshreel.kernel.polygons import triangulate
from meshreel.model.cells import Cells
from meshreel.model.geometry.hard_edges import shared_edges
from meshreel.model.geometry.polygons import join_triangles
from meshreel.model.materials import AlphaMode, Filter, Image, Material, Texture, Wrap
from meshreel.model.sequence import MeshSequence
from meshreel.model.surface import Attribute, Domain, FaceGroups, Kind, Part, Surface


def grid(rows, columns, *, closed=(False, False), turned=False):
    """Return the triangles of a sheet; closed in one direction a tube, in both a torus."""
    i, j = np.mgrid[0 : rows - (not closed[0]), 0 : columns - (not closed[1])].reshape(2, -1)

    def at(a, b):
        wrapped = (a // rows) % 2
        b = np.where(turned & (wrapped == 1), columns - 1 - b, b)
        return a % rows * columns + b % columns

    a, b, c, d = at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)
    return np.concatenate([np.stack([a, b, c], 1), np.stack([c, b, d], 1)])


def sphere(rows, columns):
    """Return a closed surface: a tube with a fan at each end."""
    body = grid(rows, columns, closed=(False, True))
    ring = np.arange(columns)
    first, last = rows * columns, rows * columns + 1
    top = np.stack([np.full(columns, first), ring, (ring + 1) % columns], 1)
    low = (rows - 1) * columns
    bottom = np.stack([np.full(columns, last), low + (ring + 1) % columns, low + ring], 1)
    return np.concatenate([body, top, bottom])


def fan(n_rim):
    """Return a fan: one vertex surrounded by all others."""
    rim = np.arange(n_rim)
    return np.stack([np.full(n_rim, n_rim), rim, (rim + 1) % n_rim], 1)


def book(n_pages):
    """Return triangles that share one edge."""
    pages = np.arange(2, n_pages + 2)
    return np.stack([np.zeros_like(pages), np.ones_like(pages), pages], 1)


def holes(rows, columns, seed=1, share=0.25):
    """Return a sheet without a random share of its triangles."""
    faces = grid(rows, columns)
    return faces[np.random.default_rng(seed).random(len(faces)) >= share]


def tangled(n_verts, n_faces, seed=2):
    """Return faces between random vertices, some degenerate or repeated."""
    return np.random.default_rng(seed).integers(0, n_verts, (n_faces, 3))


def boxes(*counts):
    """Return points and hexahedra of a block with these numbers of cells along its axes."""
    numbers = np.arange(np.prod(np.add(counts, 1))).reshape(np.add(counts, 1))
    i, j, k = np.indices(counts).reshape(3, -1)
    corners = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0),
        (0, 0, 1),
        (1, 0, 1),
        (1, 1, 1),
        (0, 1, 1),
    ]
    cells = np.stack([numbers[i + a, j + b, k + c] for a, b, c in corners], axis=1)
    return np.argwhere(numbers >= 0).astype(np.float64), cells


def tetrahedra(points, hexahedra):
    """Return six tetrahedra for each hexahedron."""
    paths = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
    return np.concatenate([hexahedra[:, path] for path in paths])


def waving(points, n_frames=5, dtype=np.float32):
    """Return positions of points that wave, of shape (n_frames, V, 3)."""
    times = np.arange(n_frames)[:, None, None]
    return (points + 0.2 * np.sin(0.5 * points[:, [1, 2, 0]] + 0.4 * times)).astype(dtype)


def shuffled_cells(points, cells, seed=11):
    """Return points and cells in another order."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(points))
    return points[order], np.argsort(order)[rng.permutation(cells)]


def mixed_cells(n_cells=70, n_verts=60, seed=12):
    """Return cells of every type between random vertices, some with a vertex twice."""
    rng = np.random.default_rng(seed)
    types = rng.choice(np.flatnonzero(cell_sizes()), n_cells).astype(np.uint8)
    sizes = cell_sizes()[types]
    nodes = [rng.choice(n_verts, size, replace=rng.random() < 0.2) for size in sizes]
    return Cells(types, np.concatenate(nodes).astype(np.int32))


def of_type(kind, cells):
    """Return cells of one type from an array with a row for each."""
    return Cells(np.full(len(cells), kind, np.uint8), cells.ravel().astype(np.int32))


def together(*meshes):
    """Return the disjoint union of meshes."""
    parts, n_verts = [], 0
    for faces in meshes:
        parts.append(np.asarray(faces) + n_verts)
        n_verts = int(parts[-1].max()) + 1
    return np.concatenate(parts)


def pinched():
    """Return three sheets that share only a vertex."""
    faces = together(grid(4, 4), grid(4, 4), grid(4, 4))
    faces[faces == 16] = 5
    faces[faces == 37] = 5
    used = np.unique(faces)
    return np.searchsorted(used, faces)


def uneven(seed=3, n_verts=140):
    """Return a closed surface of widely varying degrees, by repeatedly splitting faces."""
    rng = np.random.default_rng(seed)
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    for vertex in range(4, n_verts):
        split = int(len(faces) * rng.random() ** 2)
        a, b, c = faces[split]
        faces[split] = [a, b, vertex]
        faces += [[b, c, vertex], [c, a, vertex]]
    return np.array(faces)


def shuffled(faces, seed=4, *, turns=False):
    """Permute faces, their first corners and vertices; with `turns` also flip some faces."""
    rng = np.random.default_rng(seed)
    faces = rng.permutation(int(faces.max()) + 1)[faces[rng.permutation(len(faces))]]
    faces = np.take_along_axis(faces, (rng.integers(0, 3, (len(faces), 1)) + range(3)) % 3, 1)
    if turns:
        flipped = rng.random(len(faces)) < 0.4
        faces[flipped] = faces[flipped][:, ::-1]
    return faces


def moving(faces, n_frames=10, *, seed=5, n_more=0, dtype=np.float32, shape=(1.0, 0.0), rough=0.0,
           n_waves=4, **more):  # fmt: skip
    """Return a mesh whose vertices are smoothed noise and move in waves.

    Parameters
    ----------
    n_more : int
        Vertices without faces.
    shape : pair of float
        Size and offset in model units.
    rough : float
        Noise of each frame, relative to the size.
    n_waves : int
        Number of independent motions.
    """
    faces, rng = np.asarray(faces, np.int32), np.random.default_rng(seed)
    n_verts = int(faces.max()) + 1 + n_more
    rest, waves = rng.normal(size=(n_verts, 3)), rng.normal(size=(n_waves, n_verts, 3)) / 3
    ends = np.concatenate([faces, np.roll(faces, 1, axis=1), np.roll(faces, 2, axis=1)])[:, :2]
    count = np.maximum(np.bincount(ends[:, 0], minlength=n_verts), 1)[:, None]
    for field in (rest, *waves):
        for _ in range(25):
            total = np.zeros_like(field)
            np.add.at(total, ends[:, 0], field[ends[:, 1]])
            has_edge = np.bincount(ends[:, 0], minlength=n_verts)[:, None] > 0
            field[:] = np.where(has_edge, 0.5 * field + 0.5 * total / count, field)
        field /= np.abs(field).max()
    phase = np.linspace(0, 2, n_frames)[:, None] * (1 + np.arange(n_waves))
    vertices = rest + 0.3 * np.tensordot(np.sin(phase + np.arange(n_waves)), waves, 1)
    vertices += rough * rng.normal(size=vertices.shape)
    size, offset = shape
    return MeshSequence((size * vertices + offset).astype(dtype), faces, **more)


def concave_sheet(rows=5, columns=9):
    """Return a sheet of concave quads and hexagons, as sizes and triangles."""
    c = (np.arange(rows - 1)[:, None] * columns + np.arange(0, columns - 1, 2)).ravel()
    hexagons = np.stack([c, c + columns, c + columns + 1, c + columns + 2, c + 2, c + 1], 1)
    quads = hexagons[::3, [0, 1, 2, 5, 5, 2, 3, 4]].reshape(-1, 4)
    polygons = [*quads, *np.delete(hexagons, np.s_[::3], axis=0)]
    sizes = np.array([len(polygon) for polygon in polygons], np.int32)
    places = np.stack([*np.divmod(np.arange(rows * columns), columns), np.zeros(rows * columns)], 1)
    places[:, :2] += np.random.default_rng(4).uniform(-0.6, 0.6, (rows * columns, 2))
    return sizes, triangulate(sizes, np.concatenate(polygons), places)[0]


def sheet_of_quads(rows=6, columns=7):
    """Return a sheet of quads, triangles and a pentagon, as sizes and triangles."""
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    quads = np.stack([corner, corner + columns, corner + columns + 1, corner + 1], 1)
    triangles = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    n_verts = rows * columns
    extra = [[0, n_verts, 1], [0, columns, n_verts], [0, n_verts, 1], [0, 1, 2], [0, 2, 3]]
    sizes = np.concatenate([np.full(len(quads), 4), [3, 3, 5]])
    return sizes.astype(np.int32), np.concatenate([triangles, extra])


def attribute(name, kind, domain, values, indices=None):
    indices = None if indices is None else np.asarray(indices, np.int32)
    return Attribute(name, Kind(kind), Domain(domain), np.asarray(values), indices)


def seamed_uvs(sizes, triangles, dtype=np.float32, name="uv"):
    """Return texture coordinates of corners, with some faces in a second chart."""
    n_verts, at = int(triangles.max()) + 1, join_triangles(sizes, triangles)
    far = np.repeat(np.arange(len(sizes)) % 11 < 4, sizes)
    rows, indices = np.unique(at + n_verts * far, return_inverse=True)
    plane = np.stack([rows % n_verts % 7, rows % n_verts // 7], 1) / 7.3 + 2.0 * (
        rows[:, None] >= n_verts
    )
    return attribute(name, "uv", "corner", plane.astype(dtype), indices)


def of_everything(dtype=np.float32, n_frames=5, **more):
    """Return a sheet of polygons with attributes of all domains and types, groups and parts."""
    sizes, triangles = sheet_of_quads()
    n_verts, n_faces, n_corners = int(triangles.max()) + 1, len(sizes), int(sizes.sum())
    rng = np.random.default_rng(6)
    smooth = np.sin(np.arange(n_verts)[:, None] / 9 + np.arange(4))
    counted, half = np.arange(n_faces, dtype=np.int32), n_faces // 2
    bytes_each = rng.integers(0, 256, (4, 3)) / 255.0
    noise = rng.integers(-(2**31), 2**31, (n_verts, 16)).astype(np.int32)
    attributes = (
        seamed_uvs(sizes, triangles),
        seamed_uvs(sizes, triangles, np.float64, "fine"),
        attribute("paint", "color", "vertex", (127 * (1 + smooth)).astype(np.uint8)),
        attribute("light", "color", "corner", np.round(rng.random((n_corners, 3)), 2).astype("f4")),
        attribute("weights", "other", "vertex", smooth.astype(np.float64)),
        attribute("limits", "other", "vertex", extreme(n_verts)),
        attribute("number", "other", "face", counted[:, None] * 7 - 90),
        attribute("of bytes", "color", "face", bytes_each, rng.integers(0, 4, n_faces)),
        attribute("wide", "other", "vertex", noise),
        attribute("again", "other", "corner", rng.integers(0, 2, (n_corners, 1)).astype(np.int32)),
    )  # fmt: skip
    groups = (
        FaceGroups("material", ("red", "gr\u00fcn", "unused"), counted // 9 % 2),
        FaceGroups("group", ("one",), np.where(counted < half, -1, 0).astype(np.int32)),
    )  # fmt: skip
    surface = Surface(sizes, attributes, groups, (Part("/all", n_verts, n_faces),), *look())
    return moving(triangles, n_frames, dtype=dtype, surface=surface, **more)


def of_rough_integers():
    """Return a frame of polygons with rough integers at vertices and corners, with a seam."""
    sizes, triangles = sheet_of_quads(10, 11)
    of_corners = join_triangles(sizes, triangles)
    n_verts = int(triangles.max()) + 1
    far = np.repeat(np.arange(len(sizes)) > len(sizes) // 2, sizes)
    rows, indices = np.unique(of_corners + n_verts * far, return_inverse=True)
    rest = moving(triangles, 1, rough=0.05).vertices[0]
    uvs = rest[rows % n_verts, :2] / 2 + (rows[:, None] >= n_verts)
    integers = np.rint(300 * rest).astype(np.int32)
    attributes = (
        attribute("uv", "uv", "corner", uvs.astype(np.float32), indices),
        attribute("cents", "other", "vertex", np.rint(100 * rest).astype(np.int32) / 100),
        attribute("integers", "other", "vertex", integers),
        attribute("of corners", "other", "corner", integers[of_corners]),
    )
    return moving(triangles, 1, surface=Surface(sizes, attributes))


def of_boxes():
    """Return boxes of quads with hard edges except two, and edges of more than two faces."""
    frame = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4]])
    quads = np.concatenate([frame, frame + 8, [[5, 4, 8, 9], [5, 4, 10, 11]]])
    sizes, corners = np.full(len(quads), 4, np.int32), quads.ravel()
    edges = shared_edges(sizes, corners).ends
    surface = Surface(sizes, hard_edges=np.delete(edges, [3, 6], axis=0))
    triangles = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return moving(triangles, 5, surface=surface)


def faceted(faces):
    """Return a mesh with hard edges only."""
    edges = shared_edges(np.full(len(faces), 3), np.asarray(faces).ravel()).ends
    return moving(faces, 4, surface=Surface(hard_edges=edges))


def extreme(n):
    """Return floats of every size and sign, infinite, NaN and subnormal ones."""
    values = np.float32(10.0) ** (np.arange(n) % 77 - 38) * np.where(np.arange(n) % 3, 1, -1)
    values[:6] = [np.inf, -np.inf, np.nan, 0.0, -0.0, 1e-45]
    values[6:9] = np.finfo(np.float32).max
    return np.stack([values, values[::-1]], 1).astype(np.float32)


def look():
    """Return materials that use every feature, and their images."""
    red = Material(
        name="red",
        base_color=(1.0, 0.5, 0.25, 0.75),
        metallic=0.1,
        roughness=0.3,
        emissive=(0.5, 0.25, 0.0),
        normal_scale=0.5,
        occlusion_strength=0.75,
        alpha_mode=AlphaMode.MASK,
        alpha_cutoff=0.25,
        double_sided=True,
        base_color_texture=Texture(0, "uv", "rgba", Wrap.CLAMP, Wrap.MIRROR),
        metallic_texture=Texture(1, "uv", "b"),
        roughness_texture=Texture(1, "uv", "g", Wrap.BLACK, Wrap.METADATA),
        normal_texture=Texture(1, "uv"),
        occlusion_texture=Texture(1, "uv", "r"),
        emissive_texture=Texture(0, "uv"),
    )
    place = {"offset": (0.5, 0.25), "rotation": 0.5, "scale": (2.0, 4.0)}
    filters = {"magnified": Filter.NEAREST, "shrunk": Filter.LINEAR_MIPMAP_LINEAR}
    cloth = Material(
        name="gr\u00fcn",
        roughness=0.5,
        unlit=True,
        alpha_mode=AlphaMode.BLEND,
        base_color_texture=Texture(1, "fine", **filters, **place),
    )
    images = (Image("", "image/png", bytes(range(64))), Image("b", "image/jpeg", b"\xff\xd8\xff"))
    return (red, cloth), images
