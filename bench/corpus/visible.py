"""What a viewer sees of errors: pictures, silhouettes and normals of a frame."""

import numpy as np
import numpy.typing as npt

from meshreel.model.geometry.normals import face_normals
from meshreel.model.sequence import Faces
from meshreel.rendering.camera import Camera, fit_camera
from meshreel.rendering.rasterizer import render

LINES, MARGIN_PX = 1080, 8
WHITE, BLACK = (255, 255, 255), (0, 0, 0)

Vertices = npt.NDArray[np.floating]
Floats = npt.NDArray[np.float64]


class SeenFrame:
    """A frame that fills a picture of 1080 lines, seen from the front right.

    Parameters
    ----------
    frames : float array of shape (T, V, 3)
    faces : int32 array of shape (M, 3)
        Every vertex is used.
    is_drawn : bool
        Whether pictures are compared.
    """

    def __init__(self, frames: Vertices, faces: Faces, *, is_drawn: bool) -> None:
        number = len(frames) * 2 // 3
        self._pair = slice(max(0, number - 1), number + 1)
        self._faces, self._frames = faces, frames[self._pair].astype(np.float64)
        self._picture = None
        if is_drawn:
            camera = fit_camera(self._frames[-1:], width=LINES, height=LINES, margin=0.02)
            self._picture = Picture(self._frames[-1], faces, camera)

    def errors(self, decoded: Vertices) -> dict[str, float]:
        """Errors of decoded frames.

        Returns
        -------
        dict
            flip, silhouette_px: of `Picture.errors`, if pictures are compared. normal, normal_95:
            angles between normals of faces in degrees, the mean by area and the 95 % quantile.
            flicker: mean change of the errors of normals from the previous frame, in degrees;
            absent if there is none.
        """
        found = decoded[self._pair].astype(np.float64)
        normals, turned = (_unit_normals(each, self._faces) for each in (self._frames, found))
        areas = np.linalg.norm(face_normals(self._frames[-1], self._faces), axis=1)
        if not areas.any():
            return {}
        cosines = np.einsum("mc,mc->m", normals[-1], turned[-1])[areas > 0]
        angles = np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0)))
        figures = {
            "normal": float(np.average(angles, weights=areas[areas > 0])),
            "normal_95": float(np.quantile(angles, 0.95)),
        }
        if len(normals) > 1:
            change = np.linalg.norm(np.diff(turned - normals, axis=0)[0], axis=1)
            figures["flicker"] = float(np.degrees(np.average(change, weights=areas)))
        if self._picture is not None:
            figures |= self._picture.errors(Picture(found[-1], self._faces, self._picture.camera))
        return figures


class Picture:
    """A shaded model, and the share of each pixel that it covers."""

    def __init__(self, vertices: Floats, faces: Faces, camera: Camera) -> None:
        self.camera = camera
        self.colors = render(vertices, faces, camera)
        mask = render(vertices, faces, camera, colors=BLACK, background=WHITE, glow=1.0)
        self.coverage = 1.0 - mask[..., 0] / 255.0

    def errors(self, other: "Picture") -> dict[str, float]:
        """Differences of another picture.

        Returns
        -------
        dict
            flip: the mean of FLIP (Andersson and others, 2020) over covered pixels, at its default
            of 67 pixels per degree. silhouette_px: mean distance between the silhouettes.
        """
        import flip_evaluator

        lines = [np.flatnonzero(self.coverage.any(axis=axis)) for axis in (1, 0)]
        edges = np.linalg.norm(np.gradient(self.coverage), axis=0).sum()
        if not edges:
            return {}
        box = tuple(slice(max(0, each[0] - MARGIN_PX), each[-1] + MARGIN_PX + 1) for each in lines)
        difference, _, _ = flip_evaluator.evaluate(
            *(one.colors[box].astype(np.float32) / 255 for one in (self, other)),
            "LDR",
            applyMagma=False,
        )
        return {
            "flip": float(difference[..., 0][self.coverage[box] > 0].mean()),
            "silhouette_px": float(np.abs(other.coverage - self.coverage).sum() / edges),
        }


def _unit_normals(frames: Floats, faces: Faces) -> Floats:
    normals = face_normals(frames, faces)
    lengths = np.linalg.norm(normals, axis=-1, keepdims=True)
    return np.asarray(np.divide(normals, lengths, out=np.zeros_like(normals), where=lengths > 0))
