"""Hypothesis strategies of irregular meshes, shared by property tests."""

import numpy as np
from hypothesis import strategies as st

from meshreel.model.sequence import MeshSequence
from samples.meshes import grid_faces, octahedron_faces

SCALES = (1e-6, 1e-3, 1.0, 1e3, 1e6)
OFFSETS = (0.0, 1.0, -1e3, 1e6)
"""In units of the model's size."""


def scattered_faces(n_verts):
    """Any faces over the vertices, including degenerate, duplicate and non-manifold ones."""
    corner = st.integers(0, n_verts - 1)
    return st.lists(st.tuples(corner, corner, corner), min_size=1, max_size=2 * n_verts + 4)


@st.composite
def connectivities(draw):
    """The number of vertices, and faces."""
    kind = draw(st.sampled_from(["tiny", "scattered", "grid", "bodies", "fan", "book"]))
    if kind == "tiny":
        n_verts = draw(st.integers(1, 4))
        return n_verts, np.array(draw(scattered_faces(n_verts)), np.int32)
    if kind == "scattered":
        n_verts = draw(st.integers(5, 30))
        return n_verts, np.array(draw(scattered_faces(n_verts)), np.int32)
    if kind == "grid":
        rows, columns = draw(st.integers(2, 9)), draw(st.integers(2, 9))
        return rows * columns, grid_faces(rows, columns)
    if kind == "bodies":
        return bodies(draw(st.integers(2, 12)), draw(st.integers(0, 3)))
    n_leaves = draw(st.integers(3, 60))
    return fan(n_leaves) if kind == "fan" else book(n_leaves)


def bodies(n_bodies, n_isolated=0):
    """Return closed components of six vertices, with isolated vertices before and after them."""
    faces = np.concatenate([octahedron_faces() + 6 * body for body in range(n_bodies)])
    return 6 * n_bodies + n_isolated, faces + n_isolated // 2


def fan(n_leaves):
    """Return triangles that share a vertex."""
    rim = np.arange(1, n_leaves)
    faces = np.stack([np.zeros_like(rim), rim, rim + 1], axis=1)
    return n_leaves + 1, faces.astype(np.int32)


def book(n_leaves):
    """Return triangles that share an edge."""
    leaves = np.arange(2, n_leaves + 2)
    faces = np.stack([np.zeros_like(leaves), np.ones_like(leaves), leaves], axis=1)
    return n_leaves + 2, faces.astype(np.int32)


@st.composite
def motions(draw, n_verts):
    """Positions of shape (T, V, 3) and size about 1."""
    kind = draw(st.sampled_from(["rigid", "still", "bending", "noise", "bending and noise"]))
    n_frames = draw(st.sampled_from([1, 2, 3, 7, 20, n_verts + 5]))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return moving(rng, kind, n_frames, rng.normal(size=(n_verts, 3)))


def moving(rng, kind, n_frames, body):
    """Return the motion of a body of shape (V, 3), of shape (T, V, 3)."""
    time = np.arange(n_frames)[:, None] / 9.0
    vertices = np.repeat(body[None], n_frames, axis=0)
    if kind == "rigid":
        cosine, sine = np.cos(time), np.sin(time)
        x, y = vertices[:, :, 0].copy(), vertices[:, :, 1].copy()
        vertices[:, :, 0], vertices[:, :, 1] = cosine * x - sine * y, sine * x + cosine * y
        vertices += rng.normal(size=3) * time[:, :, None]
    if "bending" in kind:
        vertices[:, :, 2] += 0.3 * np.sin(2 * vertices[:, :, 0] + time)
    if kind == "noise":
        vertices = rng.normal(size=vertices.shape)
    if "noise" in kind:
        vertices += 1e-3 * rng.normal(size=vertices.shape)
    return vertices


@st.composite
def odd_sequences(draw, dtype=None):
    """Sequences that are hard for codecs, of one or any number type."""
    n_verts, faces = draw(connectivities())
    vertices = draw(motions(n_verts))
    if draw(st.booleans()):
        vertices[:, :, draw(st.integers(0, 2))] = 0.25
    if draw(st.booleans()):
        vertices[:, n_verts // 2 :] = vertices[:, : n_verts - n_verts // 2]
    if draw(st.integers(0, 9)) == 0:
        vertices[:] = vertices[:, :1]
    scale, offset = draw(st.sampled_from(SCALES)), draw(st.sampled_from(OFFSETS))
    dtype = dtype or draw(st.sampled_from([np.float32, np.float64]))
    return MeshSequence(((vertices + offset) * scale).astype(dtype), faces)
