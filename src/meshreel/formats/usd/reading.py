"""USD files: every mesh that is drawn, in world space, moved by whatever moves it.

Read through ``Usd.Stage``, which composes references, layers, instances and value clips. Points
are read where they have samples, and what transforms or a skeleton move between its keys at every
frame of the stage. Skinning and blend shapes are those of UsdSkel. Positions keep the units and
the axes of the file.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from meshreel.counting import counted
from meshreel.formats.options import ReadOptions
from meshreel.formats.scene import SceneMesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.drawn import drawn_meshes, shape_of
from meshreel.formats.usd.layers import codes_per_second
from meshreel.formats.usd.mesh_notes import MeshNotes
from meshreel.formats.usd.mesh_reading import StageMesh
from meshreel.formats.usd.sampling import Codes, even_step, frame_grid, snapped
from meshreel.formats.usd.skinning import find_skins
from meshreel.formats.usd.stage import codes_per_frame, open_stage
from meshreel.formats.usd.transforms import Transforms
from meshreel.sequence import validate_fps


def read_meshes(path: Path, options: ReadOptions) -> list[SceneMesh]:
    """The meshes of a USD file.

    With a frame rate in the options, all meshes of a file in which one moves between its samples
    are sampled as often as that, from the first sample of any to the last.

    Raises
    ------
    FormatError
        If USD cannot read the file, or it holds no mesh that is drawn.
    """
    notes = options.notes
    stage = open_stage(path, notes)
    with usd_errors("USD cannot read its meshes"):
        rate = codes_per_second(stage.GetRootLayer())
        prims = drawn_meshes(stage, notes)
        transforms, skins = Transforms(), find_skins(prims)
        said = MeshNotes(notes)
        meshes = [
            StageMesh(stage, shape_of(prim), skins.get(str(prim.GetPath())), transforms, said)
            for prim in prims
        ]
        has_rate = stage.HasAuthoredMetadata("timeCodesPerSecond")
        codes = _frame_codes(meshes, rate, codes_per_frame(stage, rate), options)
    return [
        _scene_mesh(mesh, own, rate, has_rate=has_rate)
        for mesh, own in zip(meshes, codes, strict=True)
    ]


def _scene_mesh(mesh: StageMesh, codes: Codes, rate: float, *, has_rate: bool) -> SceneMesh:
    fps = None
    if step := even_step(codes):
        fps = rate / step
    elif len(codes) == 1 and has_rate and len(mesh.samples.all):
        fps = rate
    if not len(codes):
        codes = np.zeros(1)
    return SceneMesh(
        mesh.path,
        snapped(codes) / rate,
        lambda index: mesh.frame(float(codes[index])),
        lambda index: mesh.surface(float(codes[index])),
        fps,
    )


def _frame_codes(
    meshes: Sequence[StageMesh], rate: float, frame_step: float, options: ReadOptions
) -> list[Codes]:
    """Where meshes have their frames; none of those that do not move."""
    fps = validate_fps(options.fps or 0.0)
    between = [mesh.samples.all for mesh in meshes if mesh.samples.move_between(frame_step)]
    if fps and between:
        return _resampled(meshes, rate / fps)
    origin = min((float(one[0]) for one in between), default=0.0)
    codes = [mesh.samples.frames(frame_step, origin) for mesh in meshes]
    for mesh, own in zip(meshes, codes, strict=True):
        if len(own) != (n_samples := len(mesh.samples.all)):
            options.notes.append(
                f"{mesh.path} has {n_samples} samples that are not one to a frame; read as USD "
                f"has it at {counted(len(own), 'frame')}"
            )
    return codes


def _resampled(meshes: Sequence[StageMesh], step: float) -> list[Codes]:
    """The same codes for all meshes that move, from the first sample of any to the last."""
    every = [mesh.samples.all for mesh in meshes]
    moving = [one for one in every if len(one) > 1]
    grid = frame_grid(
        float(min(one[0] for one in moving)), float(max(one[-1] for one in moving)), step
    )
    return [grid if len(one) > 1 else one for one in every]
