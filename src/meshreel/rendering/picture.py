"""PNG output of pictures."""

from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image as PillowImage

from meshreel.errors import InvalidInputError
from meshreel.runtime.outputs.atomic import replace_when_done

Panel = npt.NDArray[np.uint8] | PillowImage.Image


def save_png(image: Panel, path: Path, *, overwrite: bool = False) -> None:
    """Write a picture as a PNG file, atomically.

    Parameters
    ----------
    image : Pillow image, or uint8 array of shape (H, W, 3)
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InvalidInputError
        If the image has the wrong type or shape, or the path cannot or must not be written.
    """
    picture = _as_image(image)
    with replace_when_done(Path(path), overwrite=overwrite) as temporary:
        picture.save(temporary, format="PNG", optimize=True)


def _as_image(panel: Panel) -> PillowImage.Image:
    if isinstance(panel, PillowImage.Image):
        return panel.convert("RGB")
    array = np.asarray(panel)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise InvalidInputError(
            f"a picture must be a uint8 array of shape (H, W, 3); got {array.dtype} {array.shape}"
        )
    return PillowImage.fromarray(array)
