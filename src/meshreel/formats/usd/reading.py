"""USD files: every mesh that is drawn, in world space, moved by whatever moves it.

Read through ``Usd.Stage``, which composes references, layers, instances and value clips. Points
are read where they have samples, and what transforms or a skeleton move between its keys at every
frame of the stage. Skinning and blend shapes are those of UsdSkel. Positions keep the units and
the axes of the file.
"""

from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.extras import USD
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_mesh import SceneMesh, readable_mesh
from meshreel.formats.usd.diagnostics import usd_errors
from meshreel.formats.usd.drawn import DrawnMesh, drawn_meshes, shape_of
from meshreel.formats.usd.instanced_mesh import InstancedMesh, note_instances
from meshreel.formats.usd.instancers import Placements
from meshreel.formats.usd.layers import (
    DAMAGED,
    DEFAULT_RATE,
    MAX_RATE,
    MIN_RATE,
    check_used_layers,
    checked_layers,
    codes_per_second,
    layer_number,
)
from meshreel.formats.usd.material_reading import StageMaterials
from meshreel.formats.usd.mesh_notes import MeshNotes
from meshreel.formats.usd.mesh_reading import StageMesh
from meshreel.formats.usd.sampling import (
    TOLERANCE,
    Codes,
    Samples,
    even_interval,
    frame_grid,
    snapped,
)
from meshreel.formats.usd.skinning import find_skins
from meshreel.formats.usd.track_reading import MeshTracks
from meshreel.formats.usd.transforms import Transforms
from meshreel.model.sequence import validate_fps

AnyMesh = StageMesh | InstancedMesh

MAX_SHOWN_RATE = 120.0
"""Where a stage has more time codes a second, and does not say how many frames, a code is none."""

MAX_LISTED = 3


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
    stage = open_stage(path, options)
    with usd_errors("USD cannot read its meshes"):
        rate = codes_per_second(stage.GetRootLayer())
        drawn = drawn_meshes(stage, notes)
        transforms, skins = Transforms(), find_skins(one.prim for one in drawn)
        materials = StageMaterials(None if options.allow_outside else path.parent, notes)
        said = MeshNotes(notes)

        def stage_mesh(found: DrawnMesh) -> AnyMesh:
            skin = skins.get(str(found.prim.GetPath()))
            above = found.levels[-1].to_root if found.levels else transforms
            mesh = StageMesh(stage, shape_of(found.prim), skin, above, materials, said)
            if not found.levels:
                return mesh
            return InstancedMesh(found.name, mesh, Placements(found.levels, transforms))

        meshes = [stage_mesh(one) for one in drawn]
        note_instances([one for one in meshes if isinstance(one, InstancedMesh)], notes)
        has_rate = stage.HasAuthoredMetadata("timeCodesPerSecond")
        codes_of = _frame_codes(meshes, rate, codes_per_frame(stage, rate), options)

    def scene_mesh(mesh: AnyMesh) -> SceneMesh:
        with usd_errors(f"USD cannot read {mesh.path}"):
            return _scene_mesh(mesh, codes_of(mesh), rate, notes, has_rate=has_rate)

    return [readable_mesh(mesh.path, partial(scene_mesh, mesh)) for mesh in meshes]


def _scene_mesh(
    mesh: AnyMesh, codes: Codes, rate: float, notes: list[str], *, has_rate: bool
) -> SceneMesh:
    fps = None
    if interval := even_interval(codes):
        fps = rate / interval
    elif len(codes) == 1 and has_rate and len(mesh.samples.all):
        fps = rate
    if not len(codes):
        codes = np.zeros(1)
    carried = MeshTracks(mesh, codes, notes)
    return SceneMesh(
        mesh.path,
        snapped(codes) / rate,
        lambda index: mesh.frame(float(codes[index])),
        lambda index: mesh.surface(float(codes[index]), carried.moving),
        fps,
        carried.tracks,
    )


def _frame_codes(
    meshes: Sequence[AnyMesh], rate: float, frame_interval: float, options: ReadOptions
) -> Callable[[AnyMesh], Codes]:
    """A function to where a mesh has its frames, which are none if it does not move."""
    every = [one for mesh in meshes if (one := _samples(mesh)) is not None]
    between = [one.all for one in every if one.move_between(frame_interval)]
    if (fps := validate_fps(options.fps or 0.0)) and between:
        grid = cache(lambda: _common_grid([one.all for one in every], rate / fps))

        def common_codes(mesh: AnyMesh) -> Codes:
            if len(mesh.samples.all) < 2:
                return mesh.samples.all
            _note_final(mesh, grid(), max(float(one.all[-1]) for one in every if len(one.all)))
            return grid()

        return common_codes
    origin = min((float(one[0]) for one in between), default=0.0)

    def codes_of(mesh: AnyMesh) -> Codes:
        codes = mesh.samples.frames(frame_interval, origin)
        if len(codes) != (n_samples := len(mesh.samples.all)):
            mesh.notes.sampled.add(f"{mesh.path} ({n_samples} samples, {len(codes)} frames)")
        if n_samples:
            _note_final(mesh, codes, float(mesh.samples.all[-1]))
        return codes

    return codes_of


def _note_final(mesh: AnyMesh, codes: Codes, last: float) -> None:
    """Tell of a mesh whose last sample is between two frames, so that a frame later shows it."""
    if codes[-1] > last + TOLERANCE:
        mesh.notes.final.add(f"{mesh.path} (of time code {last:g}, shown at {codes[-1]:g})")


def _samples(mesh: AnyMesh) -> Samples | None:
    """Where a mesh has samples; None if they cannot be."""
    try:
        _ = mesh.samples.all
    except FormatError:
        return None
    return mesh.samples


def _common_grid(samples: Sequence[Codes], interval: float) -> Codes:
    """The same codes for all that moves, from the first sample of any to the last."""
    moving = [one for one in samples if len(one) > 1]
    first, last = min(one[0] for one in moving), max(one[-1] for one in moving)
    return frame_grid(float(first), float(last), interval)


def open_stage(path: Path, options: ReadOptions) -> Any:
    """The ``Usd.Stage`` of a file, as it is on disk now.

    Parameters
    ----------
    options : ReadOptions
        Its notes gain a sentence if anything that the file refers to is missing, and one if its
        axes or units are not those that are written: y upwards, metres.

    Raises
    ------
    FormatError
        If USD cannot read it, it has a rate that cannot be, or names layers where they may not be.
    """
    layers = checked_layers(path, allow_outside=options.allow_outside)
    with usd_errors(DAMAGED):
        stage = USD.load("Usd").Stage.Open(layers[0])
        _note_missing(stage, options.notes)
        _note_axes(stage, options.notes)
    if not options.allow_outside:
        check_used_layers(stage, path)
    return stage


def codes_per_frame(stage: Any, rate: float) -> float:
    """Time codes from one frame to the next, as players show a stage of so many codes a second.

    Where the stage does not say it is one, unless codes are finer than any frames: then there are
    as many frames a second as the standard takes.
    """
    shown = layer_number(stage.GetRootLayer(), "framesPerSecond")
    if shown is not None and MIN_RATE <= shown <= MAX_RATE:
        return rate / shown
    return 1.0 if rate <= MAX_SHOWN_RATE else rate / DEFAULT_RATE


def _note_missing(stage: Any, notes: list[str]) -> None:
    found = [" ".join(str(error).split()) for error in stage.GetCompositionErrors()]
    if found:
        more = f" and {len(found) - MAX_LISTED} more" if len(found) > MAX_LISTED else ""
        listed = "; ".join(one.rstrip(".") for one in found[:MAX_LISTED])
        notes.append(f"what the file refers to is not all there: {listed}{more}")


def _note_axes(stage: Any, notes: list[str]) -> None:
    geometry = USD.load("UsdGeom")
    said = []
    if geometry.GetStageUpAxis(stage) == geometry.Tokens.z:
        said.append("z points upwards")
    metres = layer_number(stage.GetRootLayer(), geometry.Tokens.metersPerUnit)
    if metres not in (None, 1):
        said.append(f"a unit is {metres:g} m")
    if said:
        notes.append(f"positions stay in the axes and units of the file, where {', '.join(said)}")
