"""USD files: every mesh that is drawn, in world space, moved by whatever moves it.

Read through ``Usd.Stage``, which composes references, layers, instances and value clips. Points
are read where they, a transform above them or their skeleton have samples. Skinning and blend
shapes are those of UsdSkel. Positions keep the units and the axes of the file.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from meshreel.counting import counted
from meshreel.formats.options import ReadOptions
from meshreel.formats.scene import SceneMesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.drawn import drawn_meshes
from meshreel.formats.usd.material_reading import StageMaterials
from meshreel.formats.usd.mesh_reading import StageMesh
from meshreel.formats.usd.sampling import (
    Codes,
    even_codes,
    even_step,
    frame_grid,
    skinned_codes,
    snapped,
)
from meshreel.formats.usd.skinning import find_skins
from meshreel.formats.usd.stage import codes_per_frame, codes_per_second, open_stage
from meshreel.formats.usd.transforms import Transforms
from meshreel.sequence import validate_fps


def read_meshes(path: Path, options: ReadOptions) -> list[SceneMesh]:
    """The meshes of a USD file.

    With a frame rate in the options, all meshes of a file that has a skinned one are sampled as
    often as that, from its first sample to its last.

    Raises
    ------
    FormatError
        If USD cannot read the file, or it holds no mesh that is drawn.
    """
    notes = options.notes
    stage = open_stage(path, notes)
    with usd_errors("USD cannot read its meshes"):
        rate = codes_per_second(stage, notes)
        frame_step = codes_per_frame(stage, rate)
        prims = drawn_meshes(stage, notes)
        transforms, skins = Transforms(), find_skins(prims)
        materials = StageMaterials(path.parent, notes)
        meshes = [
            StageMesh(stage, prim, skins.get(str(prim.GetPath())), transforms, materials, notes)
            for prim in prims
        ]
        has_rate = stage.HasAuthoredMetadata("timeCodesPerSecond")
        fps = validate_fps(options.fps or 0.0)
        if fps and any(mesh.skin for mesh in meshes):
            codes = _resampled(meshes, rate / fps)
        else:
            codes = [_codes(mesh, frame_step, notes) for mesh in meshes]
    return [
        _scene_mesh(mesh, own, rate, has_rate=has_rate)
        for mesh, own in zip(meshes, codes, strict=True)
    ]


def _scene_mesh(mesh: StageMesh, codes: Codes, rate: float, *, has_rate: bool) -> SceneMesh:
    fps = None
    if step := even_step(codes):
        fps = rate / step
    elif len(codes) == 1 and has_rate and len(mesh.samples):
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


def _resampled(meshes: Sequence[StageMesh], step: float) -> list[Codes]:
    """The same codes for all meshes that move, from the first sample of any to the last."""
    moving = [mesh.samples for mesh in meshes if len(mesh.samples) > 1]
    if not moving:
        return [mesh.samples for mesh in meshes]
    first, last = min(one[0] for one in moving), max(one[-1] for one in moving)
    grid = frame_grid(float(first), float(last), step)
    return [grid if len(mesh.samples) > 1 else mesh.samples for mesh in meshes]


def _codes(mesh: StageMesh, frame_step: float, notes: list[str]) -> Codes:
    """Where a mesh has its frames; empty if it does not move."""
    samples = mesh.samples
    codes = even_codes(samples) if mesh.skin is None else skinned_codes(samples, frame_step)
    if len(codes) != len(samples):
        notes.append(
            f"{mesh.path} has {len(samples)} samples that are not one to a frame; read as USD "
            f"has it at {counted(len(codes), 'frame')}"
        )
    return codes
