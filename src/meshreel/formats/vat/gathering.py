"""What all layouts begin with: frames in memory, the mesh at rest, and the error to keep."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from meshreel.codec.error_bounds import bound_of
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.gltf.error_budget import ErrorBudget, share_budget
from meshreel.formats.gltf.placement import NOWHERE, check_range
from meshreel.formats.gltf.seams import describe_left_out
from meshreel.formats.options import WriteOptions
from meshreel.formats.surfaces.polygons import describe_fans
from meshreel.formats.vat.mesh import RestMesh
from meshreel.formats.vat.motion import Motion, placement_for
from meshreel.formats.vat.textures import TexelType
from meshreel.model.sequence import MeshSequence
from meshreel.runtime.counting import counted

DEFAULT_MAX_ERROR = 0.1
"""In percent of the diagonal: a pixel of a thousand, for a mesh that fills the picture."""

DEFAULT_FPS = 24.0


@dataclass(frozen=True, eq=False)
class Gathered:
    """A sequence that is to become textures.

    Attributes
    ----------
    mesh : RestMesh
    motion : Motion
    budget : ErrorBudget
    """

    mesh: RestMesh
    motion: Motion
    budget: ErrorBudget

    @property
    def bound(self) -> float:
        """What textures may add, in model units: what float32 does, where all is one point."""
        return self.budget.added or float(np.spacing(np.abs(self.motion.rest).max()))


def gather(stream: FrameStream, options: WriteOptions, *, farthest: float = np.inf) -> Gathered:
    """All frames of a stream in memory; its notes gain what no file of the folder holds.

    Parameters
    ----------
    stream : FrameStream
    options : WriteOptions
    farthest : float
        Where a mesh may be, in model units from the origin along an axis.

    Raises
    ------
    InvalidInputError
        If positions are beyond float32, or the stream itself may be as far off as is allowed.
    """
    fps = _note_lost(stream)
    sequence = stream.gather()
    mesh = RestMesh(sequence.faces, sequence.surface, sequence.n_verts)
    if n_isolated := sequence.n_verts - len(mesh.used):
        stream.notes.append(f"left out {counted(n_isolated, 'vertex')} that no face uses")
    frames = sequence.vertices[:, mesh.used] if n_isolated else sequence.vertices
    budget = _budget(sequence, options)
    placement = placement_for(frames, budget.added or np.inf, farthest)
    if placement is not NOWHERE:
        place = " ".join(f"{one:g}" for one in placement.offset)
        stream.notes.append(
            f"the mesh is around its own middle, and the node of the file moves it to {place}: "
            "float32 is too coarse there; keep the node when you import it"
        )
    return Gathered(mesh, Motion(frames, mesh.faces, fps, placement), budget)


def note_error(
    notes: list[str], budget: ErrorBudget, errors: npt.NDArray[np.float64], texels: TexelType
) -> None:
    """Say how far off the furthest vertex is, and in which frame.

    Parameters
    ----------
    notes : list of str
    budget : ErrorBudget
    errors : float64 array of shape (T,)
        Of each frame, in model units.
    texels : TexelType
        Of the files that were read back.
    """
    worst, frame = float(errors.max()), int(errors.argmax())
    added = "" if budget.origin is None else " added"
    notes.append(
        f"the largest error{added} is {budget.percent(worst):.3g} % of the diagonal, in frame "
        f"{frame}, as read back from {texels.title}"
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
        spender="textures",
    )


def _note_lost(stream: FrameStream) -> float:
    """Note what no file of the folder holds, and give the frame rate to write."""
    notes, surface = stream.notes, stream.surface
    notes.extend(describe_left_out(surface))
    if cut := describe_fans(surface.sizes(len(stream.faces))):
        notes.append(cut)
    if surface.parts:
        notes.append(f"{counted(len(surface.parts), 'part')} become one mesh, without their names")
    if stream.start_s:
        notes.append(f"begins at 0 s, not {stream.start_s:g} s: textures have no times")
    if not stream.fps and stream.n_frames > 1:
        notes.append(f"the frame rate is not known; written as {DEFAULT_FPS:g} fps")
    return stream.fps or DEFAULT_FPS
