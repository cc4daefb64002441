"""Writing glTF: an animation of morph targets, which any viewer plays on its GPU."""

import base64
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from meshreel.codec.error_bounds import bound_of
from meshreel.errors import InvalidInputError
from meshreel.formats.frames.frame_stream import FrameStream
from meshreel.formats.gltf.container_writer import write_container
from meshreel.formats.gltf.error_budget import ErrorBudget, share_budget
from meshreel.formats.gltf.moving_mesh import Wanted
from meshreel.formats.gltf.normal_targets import NormalChoice
from meshreel.formats.gltf.placement import check_range
from meshreel.formats.gltf.scene_writer import Scene, make_scene
from meshreel.formats.gltf.seams import describe_left_out
from meshreel.formats.options import WriteOptions
from meshreel.formats.surfaces.polygons import describe_fans
from meshreel.runtime.counting import counted

DEFAULT_MAX_ERROR = 0.1
"""In percent of the diagonal: a pixel of a thousand, for a mesh that fills the picture."""

DEFAULT_FPS = 24.0

MANY_TARGETS = 256
"""Layers that a texture has on every GPU (WebGL 2); more targets than that some cannot play."""

CHOICES = {None: NormalChoice.SMOOTH, True: NormalChoice.ALL, False: NormalChoice.NONE}

WHY_FLAT = "creases are much of it (--normals, normals=True, writes them all the same)"

TOO_FEW_TARGETS = "they need two targets or more"


def write_glb(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write a ``.glb`` file, which holds everything.

    All frames are read into memory. `stream.notes` gains what was achieved.

    Raises
    ------
    InvalidInputError
        If the options are out of range, or the error that they allow cannot be kept.
    """
    achieved = _achieve(stream, options)
    scene = achieved.scene
    size = write_container(
        path, scene.document, scene.buffer, "allow a larger error (max_error), or fewer targets"
    )
    _note_achieved(stream.notes, achieved, size)
    _note_normals(stream.notes, scene, options)


def write_gltf(path: Path, stream: FrameStream, options: WriteOptions) -> None:
    """Write a ``.gltf`` file, whose JSON holds the buffer too, a third larger as text.

    Raises
    ------
    InvalidInputError
        As `write_glb`.
    """
    achieved = _achieve(stream, options)
    scene = achieved.scene
    data = base64.b64encode(b"".join(scene.buffer.pieces)).decode("ascii")
    uri = f"data:application/octet-stream;base64,{data}"
    buffers = [{"byteLength": scene.buffer.size_bytes, "uri": uri}]
    text = json.dumps(scene.document | {"buffers": buffers}, ensure_ascii=False, indent=1)
    _note_achieved(stream.notes, achieved, path.write_bytes(text.encode()))
    _note_normals(stream.notes, scene, options)


@dataclass(frozen=True, eq=False)
class _Achieved:
    """A scene, and how far the furthest vertex of each frame is off.

    Attributes
    ----------
    scene : Scene
    percents : float array of shape (T,)
        Of the diagonal of all frames.
    budget : ErrorBudget
    n_frames : int
    """

    scene: Scene
    percents: npt.NDArray[np.floating]
    budget: ErrorBudget
    n_frames: int


def _achieve(stream: FrameStream, options: WriteOptions) -> _Achieved:
    _check_options(options)
    stream.notes.extend(describe_left_out(stream.surface))
    if cut := describe_fans(stream.surface.sizes(len(stream.faces))):
        stream.notes.append(cut)
    times_s = _times(stream)
    sequence = stream.gather()
    extent = sequence.extent
    check_range(extent.low, extent.high)
    diagonal = float(np.linalg.norm(extent.high - extent.low))
    if options.max_error is not None:
        allowed = bound_of(options.max_error).percent(diagonal or 1.0)
    else:
        allowed = DEFAULT_MAX_ERROR if options.targets is None else 0.0
    budget = share_budget(allowed, diagonal, options.origin, is_total=options.max_error is not None)
    wanted = Wanted(options.targets, budget.added, CHOICES[options.normals])
    stream.progress("morph targets", 0.0)
    scene = make_scene(sequence, times_s, wanted, stream.notes)
    if scene.n_isolated:
        stream.notes.append(f"left out {counted(scene.n_isolated, 'vertex')} that no face uses")
    errors = np.max([one.errors for one in scene.meshes], axis=0)
    achieved = _Achieved(scene, 100 * errors / (budget.diagonal or 1.0), budget, len(times_s))
    if budget.added and scene.n_targets and errors.max() > budget.added:
        left = budget.percent(budget.added)
        is_shared = not math.isclose(left, allowed)
        bound = f"{left:.4g} % is left of the {allowed:g} %" if is_shared else f"{allowed:g} % was"
        raise InvalidInputError(
            f"{_largest(achieved)} with {counted(scene.n_targets[-1], 'morph target')}; {bound} "
            "asked for; allow more targets, or a larger error (max_error)"
        )
    return achieved


def _check_options(options: WriteOptions) -> None:
    least = 2 if options.normals else 1
    if options.targets is not None and options.targets < least:
        reason = " with normals" if options.normals else ""
        raise InvalidInputError(f"targets must be at least {least}{reason}; got {options.targets}")
    if options.max_error is not None:
        bound_of(options.max_error)


def _times(stream: FrameStream) -> Sequence[float]:
    """When frames are, in seconds; glTF has no time before 0."""
    if not stream.fps and stream.n_frames > 1:
        stream.notes.append(f"the frame rate is not known; written as {DEFAULT_FPS:g} fps")
    start_s = stream.start_s
    if start_s < 0:
        stream.notes.append(f"starts at 0 s, not {start_s:g} s: glTF has no time before 0")
        start_s = 0.0
    rate = stream.fps or DEFAULT_FPS
    return [start_s + number / rate for number in range(stream.n_frames)]


def _largest(achieved: _Achieved) -> str:
    percent, frame = float(achieved.percents.max()), int(achieved.percents.argmax())
    added = "" if achieved.budget.origin is None else " added"
    return f"the largest error{added} is {percent:.4f} % of the diagonal, in frame {frame},"


def _note_achieved(notes: list[str], achieved: _Achieved, size_bytes: int) -> None:
    counts = achieved.scene.n_targets
    added = achieved.budget.diagonal * float(achieved.percents.max()) / 100
    if not counts:
        if achieved.n_frames > 1:
            notes.append("no vertex moves by more than the error allowed: written at rest")
        notes += achieved.budget.describe(added)
        return
    number = f"{counts[0]} to " if counts[0] < counts[-1] else ""
    where = f" in each of {len(counts)} meshes" if len(counts) > 1 else ""
    notes.append(
        f"{_largest(achieved)} with {number}{counted(counts[-1], 'morph target')}{where}: "
        f"{size_bytes / 1e6:.3g} MB"
    )
    notes += achieved.budget.describe(added)
    if counts[-1] > MANY_TARGETS:
        notes.append(
            f"some viewers play no more than {MANY_TARGETS} morph targets of a mesh; "
            "allow a larger error (max_error) for fewer"
        )


def _note_normals(notes: list[str], scene: Scene, options: WriteOptions) -> None:
    """One sentence on which meshes have normals, and how near these are while they move."""
    if options.normals is False:
        return
    have = [one.normals for one in scene.meshes if one.normals is not None]
    if not have:
        reason = TOO_FEW_TARGETS if options.targets == 1 else WHY_FLAT
        notes.append(f"no normals, so viewers shade it flat: {reason}")
        return
    angle_deg = max(one.angle_deg for one in have)
    moving = f", off by {angle_deg:.1f} degrees in the mean as they move" if angle_deg else ""
    few = f" of {len(have)} of {len(scene.meshes)} meshes" if len(have) < len(scene.meshes) else ""
    rest = f"; of the others none: {WHY_FLAT}" if few else ""
    hard = " but at hard edges" if scene.has_hard_edges else ""
    if moving or few or hard:
        notes.append(f"normals{few} are smooth{hard}{moving}{rest}")
