"""The colours that a mesh carries, as the rasterizer takes them."""

import numpy as np
import numpy.typing as npt

from meshreel.model.sequence import Faces
from meshreel.model.surface import Kind, Surface
from meshreel.rendering.item_colors import colors_of_items


def surface_colors(surface: Surface, faces: Faces) -> npt.NDArray[np.float32] | None:
    """The first colour attribute of a mesh, sRGB in 0..255; None if it has none.

    Parameters
    ----------
    surface : Surface
        Colours of bytes are taken as they are, others times 255; opacity is left out.
    faces : int32 array of shape (M, 3)

    Returns
    -------
    float32 array of shape (V, 3), of each vertex, or (M, 3, 3), of each corner of each face
    """
    found = surface.of_kind(Kind.COLOR)
    if not found:
        return None
    values = found[0].per_item()[:, :3].astype(np.float32)
    if values.shape[1] < 3:
        values = np.repeat(values[:, :1], 3, axis=1)  # shades of grey
    if found[0].values.dtype != np.uint8:
        values = 255 * np.nan_to_num(values)
    values = np.clip(values, 0, 255)
    return np.asarray(colors_of_items(values, found[0].domain, surface, faces))
