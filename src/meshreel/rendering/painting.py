"""Shade pixels, given the face visible in each sample."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Floats, Integers, Singles
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.geometry.normals import face_normals, vertex_normals
from meshreel.model.sequence import Faces
from meshreel.rendering.camera import Camera
from meshreel.rendering.studio import shade
from meshreel.rendering.visibility import signed_areas
from meshreel.runtime.threads import chunks

Image = npt.NDArray[np.uint8]
Color = tuple[int, int, int]
Box = tuple[slice, slice]

_PIXELS_PER_CHUNK = 1 << 16


@dataclass(frozen=True)
class ProjectedSurface:
    """Shading inputs of one frame of M faces; normals in the axes of `studio`."""

    first: Floats  # (M, 2): the first corner of each face, pixels
    inv_depths: Floats  # (M, 3)
    slopes: Floats  # (M, 2, 2): gradients of the second and third barycentric coordinate
    normals: Singles  # (M, 3, 3), or (M, 3) when flat
    colors: Singles  # (M, 3, 3), or (3,) when all are the same
    side: Singles  # (M,): -1 for back faces
    glow: Singles  # (M,)


def project_surface(
    positions: Floats,
    points: Floats,
    inv_depths: Floats,
    faces: Faces,
    camera: Camera,
    colors: Singles,
    smooth: bool,
    glow: Singles,
    shading: RowNormals | None,
) -> ProjectedSurface:
    """Return the shading inputs of a frame from its projected vertices.

    Parameters
    ----------
    positions : float64 array of shape (V, 3), in model units
    points, inv_depths : float64 arrays of shape (V, 2) and (V,)
        From `Camera.project` and `inverse_depths`.
    faces : int32 array of shape (M, 3)
    colors : float32 array of shape (3,), (V, 3) or (M, 3, 3), sRGB in 0..255
    glow : float32 array of shape (M,)
    smooth, shading
        As in `meshreel.rendering.rasterizer.render`.
    """
    ab, ac = (points[faces[:, k]] - points[faces[:, 0]] for k in (1, 2))
    area = signed_areas(points, faces)
    slopes = np.stack([ac[:, 1], -ac[:, 0], -ab[:, 1], ab[:, 0]], axis=1).reshape(-1, 2, 2)
    rows = faces
    if not smooth:
        normals = face_normals(positions, faces)
    elif shading is None:
        normals = vertex_normals(positions, faces)
    else:
        normals, rows = shading.of_frames(positions[np.newaxis])[0], shading.triangles
    to_studio = np.array([[1], [-1], [-1]]) * camera.axes
    local = (normals @ to_studio.T).astype(np.float32)
    return ProjectedSurface(
        first=points[faces[:, 0]],
        inv_depths=inv_depths[faces],
        slopes=np.divide(
            slopes, area[:, None, None], out=np.zeros_like(slopes), where=area[:, None, None] != 0
        ),
        normals=local[rows] if smooth else local,
        colors=colors[faces] if colors.ndim == 2 else colors,
        side=np.where(area < 0, 1, -1).astype(np.float32),
        glow=glow,
    )


def covered_box(visible: Integers, factor: int) -> Box | None:
    """Bounding rows and columns of the covered pixels; None if there are none.

    Parameters
    ----------
    visible : int64 array of shape (height * factor, width * factor)
        The visible face of each sample, or -1.
    factor : int
        Samples along each side of a pixel.
    """
    covered = visible >= 0
    rows, columns = (np.flatnonzero(covered.any(axis=axis)) // factor for axis in (1, 0))
    if len(rows) == 0:
        return None
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


def shade_box(
    surface: ProjectedSurface, visible: Integers, box: Box, factor: int, background: Color
) -> Image:
    """Colors of the pixels in a box, uint8 of shape (height, width, 3).

    A pixel is the mean of its samples, or is shaded once at its center if all its samples see the
    same face.
    """
    height, width = (side.stop - side.start for side in box)
    ids = visible[tuple(slice(side.start * factor, side.stop * factor) for side in box)]
    samples = [
        ids[row::factor, column::factor].ravel() for row, column in np.ndindex(factor, factor)
    ]
    is_uniform, is_covered = samples[0] >= 0, samples[0] >= 0
    for sample in samples[1:]:
        is_uniform &= sample == samples[0]
        is_covered |= sample >= 0
    pixels = np.empty((height * width, 3), np.float32)
    pixels[:] = np.asarray(background, np.float32)
    corners = np.mgrid[box][::-1].reshape(2, -1).T * float(factor)
    inner = np.flatnonzero(is_uniform)
    pixels[inner] = _shade(surface, samples[0][inner], corners[inner] + factor / 2)
    edge = np.flatnonzero(is_covered & ~is_uniform)
    total = np.zeros((len(edge), 3), np.float32)
    for (row, column), sample in zip(np.ndindex(factor, factor), samples, strict=True):
        faces = sample[edge]
        covered = faces >= 0
        total[~covered] += np.asarray(background, np.float32)
        centers = corners[edge[covered]] + np.array([column + 0.5, row + 0.5])
        total[covered] += _shade(surface, faces[covered], centers)
    pixels[edge] = total / np.float32(factor**2)
    return np.asarray(np.rint(pixels), np.uint8).reshape(height, width, 3)


def _shade(surface: ProjectedSurface, ids: Integers, centers: Floats) -> Singles:
    """Colors of the faces ``ids`` at picture coordinates ``centers``, of shape (N, 3)."""
    colors = np.empty((len(ids), 3), np.float32)
    for chunk in chunks(len(ids), _PIXELS_PER_CHUNK):
        colors[chunk] = _shade_chunk(surface, ids[chunk], centers[chunk])
    return colors


def _shade_chunk(surface: ProjectedSurface, ids: Integers, centers: Floats) -> Singles:
    offsets = centers - surface.first[ids]
    weights = np.empty((len(ids), 3))
    weights[:, 1:] = np.einsum("nkc,nc->nk", surface.slopes[ids], offsets)
    weights[:, 0] = 1 - weights[:, 1] - weights[:, 2]
    # Clipped because weights of slivers leave 0..1 by rounding; perspective-correct because
    # linear functions on the surface are not linear in the picture.
    weights = np.clip(weights, 0, 1) * surface.inv_depths[ids]
    share = (weights / weights.sum(axis=1, keepdims=True)).astype(np.float32)
    normals = _blend(share, surface.normals[ids]) * surface.side[ids, None]
    if surface.colors.ndim == 1:
        colors = np.broadcast_to(surface.colors, normals.shape)
    else:
        colors = _blend(share, surface.colors[ids])
    return shade(_unit_or_facing(normals), colors, surface.glow[ids])


def _blend(share: Singles, values: Singles) -> Singles:
    """Interpolate corner values of shape (N, 3, 3); values of faces, (N, 3), stay the same."""
    return values if values.ndim == 2 else np.einsum("nk,nkc->nc", share, values)


def _unit_or_facing(normals: Singles) -> Singles:
    """Unit normals; zero normals, where opposite faces cancel, become the viewing direction."""
    lengths = np.sqrt(np.einsum("nc,nc->n", normals, normals))[:, None]
    viewer = np.broadcast_to(np.array([0, 0, 1], np.float32), normals.shape).copy()
    np.divide(normals, lengths, out=viewer, where=lengths > 0)
    return viewer
