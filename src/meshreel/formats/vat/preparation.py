"""Preparation common to all layouts: frames in memory, the rest mesh, and the error budget."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.error_bounds import bound_of
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.gltf.error_budget import ErrorBudget, share_budget
from meshreel.formats.gltf.quantized import IDENTITY, check_range
from meshreel.formats.gltf.seams import describe_losses
from meshreel.formats.options import WriteOptions
from meshreel.formats.surfaces.polygons import describe_fans
from meshreel.formats.vat.mesh import RestMesh
from meshreel.formats.vat.motion import Motion, placement_for
from meshreel.formats.vat.textures import TexelType
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.counting import counted

DEFAULT_MAX_ERROR = 0.1
"""Percent of the diagonal: one pixel in a thousand, for a mesh that fills the image."""

DEFAULT_FPS = 24.0


@dataclass(frozen=True, eq=False)
class BakeInput:
    """A sequence prepared for baking to textures."""

    mesh: RestMesh
    motion: Motion
    budget: ErrorBudget

    @property
    def bound(self) -> float:
        """Error that textures may add, in model units; the float32 resolution of a single point."""
        return self.budget.added or float(np.spacing(np.abs(self.motion.rest).max()))


def prepare(
    stream: FrameStream, options: WriteOptions, *, max_distance: float = np.inf
) -> BakeInput:
    """Return a stream loaded for baking; notes report data that the folder cannot store.

    Parameters
    ----------
    max_distance : float
        Limit of the coordinates of the mesh, in model units; beyond it, the mesh is centered.

    Raises
    ------
    InvalidInputError
        If positions exceed float32, or the error of the stream itself uses up the error bound.
    """
    fps = _note_losses(stream)
    sequence = stream.gather()
    mesh = RestMesh(sequence.faces, sequence.surface, sequence.n_verts)
    if n_isolated := sequence.n_verts - len(mesh.used):
        stream.notes.append(f"left out {counted(n_isolated, 'vertex')} that no face uses")
    frames = sequence.vertices[:, mesh.used] if n_isolated else sequence.vertices
    budget = _budget(sequence, options)
    placement = placement_for(frames, budget.added or np.inf, max_distance)
    if placement is not IDENTITY:
        origin = " ".join(f"{one:g}" for one in placement.offset)
        stream.notes.append(
            f"the mesh is centered at the origin, and the node of the file moves it to {origin}, "
            "where float32 is too coarse; keep the node when you import it"
        )
    return BakeInput(mesh, Motion(frames, mesh.faces, fps, placement), budget)


def note_error(
    notes: list[str], budget: ErrorBudget, errors: npt.NDArray[np.float64], texels: TexelType
) -> None:
    """Note the largest error of a vertex, and its frame.

    Parameters
    ----------
    errors : float64 array of shape (T,)
        Largest error of each frame, in model units.
    texels : TexelType
        Type of the texture files.
    """
    worst, frame = float(errors.max()), int(errors.argmax())
    added = "" if budget.origin is None else " added"
    notes.append(
        f"the largest error{added} is {budget.percent(worst):.3g} % of the diagonal, in frame "
        f"{frame}, as decoded from {texels.title}"
    )
    notes += budget.describe(worst)


def _budget(sequence: MeshSequence, options: WriteOptions) -> ErrorBudget:
    extent = sequence.extent
    check_range(extent.low, extent.high)
    diagonal = float(np.linalg.norm(extent.high - extent.low))
    allowed = DEFAULT_MAX_ERROR
    if options.max_error is not None:
        allowed = bound_of(options.max_error).percent(diagonal or 1.0)
    return share_budget(
        allowed,
        diagonal,
        options.origin,
        is_total=options.max_error is not None,
        consumer="textures",
    )


def _note_losses(stream: FrameStream) -> float:
    """Note what the folder cannot store, and return the frame rate to write."""
    notes, surface = stream.notes, stream.surface
    notes.extend(describe_losses(surface))
    if fans := describe_fans(surface.sizes(len(stream.faces))):
        notes.append(fans)
    if surface.parts:
        notes.append(f"{counted(len(surface.parts), 'part')} become one mesh, without their names")
    if stream.start_s:
        notes.append(f"starts at 0 s, not {stream.start_s:g} s: textures have no start time")
    if not stream.fps and stream.n_frames > 1:
        notes.append(f"the frame rate is unknown; written as {DEFAULT_FPS:g} fps")
    return stream.fps or DEFAULT_FPS
