"""Pictures of a mesh by the CPU alone: no screen, no graphics card, no window system."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from meshreel.errors import InvalidInputError
from meshreel.geometry.normals import face_normals, vertex_normals
from meshreel.rendering.camera import Camera, Floats
from meshreel.rendering.shading import Singles, shade
from meshreel.rendering.visibility import Integers, nearness, signed_areas, visible_faces
from meshreel.sequence import Faces, validate_faces, validate_vertices

Image = npt.NDArray[np.uint8]
Color = tuple[int, int, int]
Box = tuple[slice, slice]

CLAY: Color = (188, 198, 214)
PAPER: Color = (247, 248, 250)

_PIXELS_AT_ONCE = 1 << 16
_MAX_SUPERSAMPLE = 8


def render(
    vertices: npt.NDArray[np.floating],
    faces: npt.NDArray[np.integer],
    camera: Camera,
    *,
    colors: npt.ArrayLike = CLAY,
    background: Color = PAPER,
    smooth: bool = True,
    supersample: int = 2,
) -> Image:
    """A shaded picture of one frame, lit from the camera, both sides of every face alike.

    Parameters
    ----------
    vertices : float array of shape (V, 3), in model units
    faces : integer array of shape (M, 3)
        A face that reaches behind the camera is left out.
    camera : Camera
        Gives the view and the size of the picture; see `fit_camera`.
    colors : array of shape (V, 3) or (3,), default a light clay
        sRGB in 0..255, of each vertex or of all; from `colorize` for a heat map.
    background : three integers
        sRGB in 0..255.
    smooth : bool
        Whether normals are interpolated between the vertices or flat over each face.
    supersample : int
        Samples along each side of a pixel, 1..8; more make smoother outlines.

    Returns
    -------
    uint8 array of shape (height, width, 3)

    Raises
    ------
    InvalidInputError
        If an array has another shape, a position is not finite, a face names a vertex that is
        not there, or ``supersample`` is out of range.
    """
    if supersample not in range(1, _MAX_SUPERSAMPLE + 1):
        raise InvalidInputError(f"supersample must be in 1..{_MAX_SUPERSAMPLE}; got {supersample}")
    positions = validate_vertices(np.asarray(vertices, np.float64)[None])[0].astype(np.float64)
    faces = validate_faces(faces, len(positions))
    fine = _enlarge(camera, supersample)
    surface = _seen_surface(positions, faces, fine, _per_vertex(colors, len(positions)), smooth)
    seen = visible_faces(surface.points, surface.near, faces, fine)
    picture = np.empty((camera.height, camera.width, 3), np.uint8)
    picture[:] = np.asarray(background, np.uint8)
    if (box := _covered_box(seen.reshape(fine.height, fine.width), supersample)) is not None:
        samples = _paint(surface, seen.reshape(fine.height, fine.width), box, background)
        inside = tuple(slice(side.start // supersample, side.stop // supersample) for side in box)
        picture[inside] = _average_samples(samples, supersample)
    return picture


@dataclass(frozen=True)
class _Surface:
    """What shading needs of one frame: M faces, V vertices; normals in camera axes."""

    points: Floats  # (V, 2), pixels
    near: Floats  # (V,)
    faces: Faces  # (M, 3)
    slopes: Floats  # (M, 2, 2): gradients of the second and third barycentric coordinate
    normals: Singles  # (V, 3), or (M, 3) when flat
    colors: Singles  # (V, 3)
    side: Singles  # (M,): -1 where the back of the face is seen
    smooth: bool


def _seen_surface(
    positions: Floats, faces: Faces, camera: Camera, colors: Singles, smooth: bool
) -> _Surface:
    points, depths = camera.project(positions)
    normals = vertex_normals(positions, faces) if smooth else face_normals(positions, faces)
    ab, ac = (points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))
    area = signed_areas(points, faces)
    slopes = np.stack([ac[:, 1], -ac[:, 0], -ab[:, 1], ab[:, 0]], axis=1).reshape(-1, 2, 2)
    return _Surface(
        points=points,
        near=nearness(depths),
        faces=faces,
        slopes=np.divide(
            slopes, area[:, None, None], out=np.zeros_like(slopes), where=area[:, None, None] != 0
        ),
        normals=(normals @ camera.axes.T).astype(np.float32),
        colors=colors,
        side=np.where(area < 0, 1, -1).astype(np.float32),
        smooth=smooth,
    )


def _covered_box(seen: Integers, factor: int) -> Box | None:
    """Rows and columns of samples that hold all that is seen, whole pixels of them."""
    covered = seen >= 0
    rows, columns = (np.flatnonzero(covered.any(axis=axis)) for axis in (1, 0))
    if len(rows) == 0:
        return None
    (top, left), (bottom, right) = (
        (int(rows[end]) // factor, int(columns[end]) // factor) for end in (0, -1)
    )
    return (
        slice(top * factor, (bottom + 1) * factor),
        slice(left * factor, (right + 1) * factor),
    )


def _paint(surface: _Surface, seen: Integers, box: Box, background: Color) -> Singles:
    """Colours of the samples in a box, as an array of its shape and 3 channels."""
    ids = seen[box].ravel()
    height, width = (side.stop - side.start for side in box)
    samples = np.empty((height * width, 3), np.float32)
    samples[:] = np.asarray(background, np.float32)
    covered = np.flatnonzero(ids >= 0)
    for start in range(0, len(covered), _PIXELS_AT_ONCE):
        places = covered[start : start + _PIXELS_AT_ONCE]
        centres = np.stack([places % width + box[1].start, places // width + box[0].start], axis=1)
        samples[places] = _shade_samples(surface, ids[places], centres + 0.5)
    return samples.reshape(height, width, 3)


def _shade_samples(surface: _Surface, ids: Integers, centres: Floats) -> Singles:
    """Colours of samples with these centres that see the faces ``ids``, of shape (N, 3)."""
    corners = surface.faces[ids]
    offsets = centres - surface.points[corners[:, 0]]
    weights = np.empty((len(ids), 3))
    weights[:, 1:] = np.einsum("nkc,nc->nk", surface.slopes[ids], offsets)
    weights[:, 0] = 1 - weights[:, 1] - weights[:, 2]
    # Clipped because slivers leave the interval by rounding; divided by depth because what is
    # linear on the surface is not linear in the picture.
    weights = np.clip(weights, 0, 1) * surface.near[corners]
    share = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
    if surface.smooth:
        normals = np.einsum("nk,nkc->nc", share, surface.normals[corners])
    else:
        normals = surface.normals[ids]
    normals = normals * surface.side[ids, None]
    colors = np.einsum("nk,nkc->nc", share, surface.colors[corners])
    return shade(_unit_or_facing(normals), colors)


def _unit_or_facing(normals: Singles) -> Singles:
    """Unit normals; towards the viewer where faces of opposite sides cancelled each other."""
    lengths = np.sqrt(np.einsum("nc,nc->n", normals, normals))[:, None]
    viewer = np.broadcast_to(np.array([0, 0, -1], np.float32), normals.shape).copy()
    np.divide(normals, lengths, out=viewer, where=lengths > 0)
    return viewer


def _per_vertex(colors: npt.ArrayLike, n_verts: int) -> Singles:
    array = np.asarray(colors, np.float32)
    if array.shape not in ((3,), (n_verts, 3)):
        raise InvalidInputError(
            f"colors must have shape (3,) or ({n_verts}, 3), one for each vertex; got {array.shape}"
        )
    if not (array.min() >= 0 and array.max() <= 255):
        raise InvalidInputError("colors must be sRGB values in 0..255")
    return np.broadcast_to(array, (n_verts, 3))


def _enlarge(camera: Camera, factor: int) -> Camera:
    return replace(
        camera,
        focal_px=camera.focal_px * factor,
        width=camera.width * factor,
        height=camera.height * factor,
    )


def _average_samples(samples: Singles, factor: int) -> Image:
    """Means of squares of samples; added up in slices, which is many times faster than a mean."""
    corners = [(row, column) for row in range(factor) for column in range(factor)]
    total = sum(samples[row::factor, column::factor] for row, column in corners)
    return np.asarray(np.rint(total / np.float32(factor**2)), np.uint8)
