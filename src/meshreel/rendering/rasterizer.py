"""Software rasterizer: pictures of a mesh without a GPU or display."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from meshreel.arrays import Singles
from meshreel.errors import InvalidInputError
from meshreel.model.colors import to_srgb
from meshreel.model.geometry.hard_edges import RowNormals
from meshreel.model.materials import CLAY_MATERIAL
from meshreel.model.validation import validate_faces, validate_vertices
from meshreel.rendering.camera import Camera
from meshreel.rendering.painting import Color, Image, covered_box, project_surface, shade_box
from meshreel.rendering.visibility import inverse_depths, visible_faces

_GRAY = round(255 * float(to_srgb(np.array([CLAY_MATERIAL.base_color[:3]]))[0, 0]))
CLAY: Color = (_GRAY, _GRAY, _GRAY)
PAPER: Color = (247, 248, 250)

_MAX_SUPERSAMPLE = 8


def render(
    vertices: npt.NDArray[np.floating],
    faces: npt.NDArray[np.integer],
    camera: Camera,
    *,
    colors: npt.ArrayLike = CLAY,
    background: Color = PAPER,
    smooth: bool = True,
    shading: RowNormals | None = None,
    shown: npt.NDArray[np.bool_] | None = None,
    glow: float | Singles = 0.0,
    supersample: int = 2,
) -> Image:
    """Render one frame with two-sided shading in a studio attached to the camera.

    Parameters
    ----------
    vertices : float array of shape (V, 3), in model units
    faces : integer array of shape (M, 3)
        Faces that reach behind the camera are not drawn.
    camera : Camera
        See `fit_camera`.
    colors : array of shape (3,), (V, 3) or (M, 3, 3), default a light gray
        sRGB in 0..255: one color, or one per vertex (from `colorize` for a heat map), or one per
        corner of each face.
    background : three integers
        sRGB in 0..255.
    smooth : bool
        Whether to interpolate normals; otherwise faces are flat.
    shading : RowNormals, optional
        Which corners share an interpolated normal. Default: all corners of a vertex.
    shown : bool array of shape (M,), optional
        Which faces are drawn; the others still contribute to normals. Default: all.
    glow : float, or float array of shape (M,)
        0 for surfaces in the studio. Else colors are those of values, such as `GLOW`: exact where
        they face the camera, and times at least this elsewhere. 1 for unlit colors.
    supersample : int
        Samples along each side of a pixel, 1..8.

    Returns
    -------
    uint8 array of shape (height, width, 3)

    Raises
    ------
    InvalidInputError
        If an array has the wrong shape, a position is not finite, a face refers to a missing
        vertex, or ``supersample`` or ``glow`` is out of range.
    """
    if supersample not in range(1, _MAX_SUPERSAMPLE + 1):
        raise InvalidInputError(f"supersample must be in 1..{_MAX_SUPERSAMPLE}; got {supersample}")
    verts = validate_vertices(np.asarray(vertices, np.float64)[None])[0].astype(np.float64)
    faces = validate_faces(faces, len(verts))
    glows = np.broadcast_to(np.asarray(glow, np.float32), len(faces))
    if not ((glows >= 0) & (glows <= 1)).all():
        raise InvalidInputError(f"glow must be in 0..1; got {glow}")
    fine = replace(
        camera,
        focal_px=camera.focal_px * supersample,
        width=camera.width * supersample,
        height=camera.height * supersample,
    )
    rgb = np.asarray(colors, np.float32)
    if rgb.shape not in ((3,), (len(verts), 3), (len(faces), 3, 3)):
        raise InvalidInputError(
            f"colors must have shape (3,), ({len(verts)}, 3), one for each vertex, or "
            f"({len(faces)}, 3, 3), one for each corner; got {rgb.shape}"
        )
    if not (rgb.min() >= 0 and rgb.max() <= 255):
        raise InvalidInputError("colors must be sRGB values in 0..255")
    points, depths = fine.project(verts)
    inv_depths = inverse_depths(depths)
    size = fine.width, fine.height
    visible = visible_faces(points, inv_depths, faces, size, shown).reshape(fine.height, fine.width)
    surface = project_surface(verts, points, inv_depths, faces, fine, rgb, smooth, glows, shading)
    picture = np.empty((camera.height, camera.width, 3), np.uint8)
    picture[:] = np.asarray(background, np.uint8)
    if (box := covered_box(visible, supersample)) is not None:
        picture[box] = shade_box(surface, visible, box, supersample, background)
    return picture
