"""Reading USD files: every mesh that is rendered, in world space, with its animation.

Files are read through ``Usd.Stage``, which composes references, layers, instances and value clips.
Points are read at their samples; meshes that move between keys of transforms or skeletons are read
at every frame of the stage. Skinning and blend shapes are evaluated by UsdSkel. Positions keep the
units and axes of the file.
"""

from collections.abc import Callable, Sequence
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.errors import FormatError
from meshreel.formats.options import ReadOptions
from meshreel.formats.scenes.scene_mesh import SceneMesh, read_or_defer_error
from meshreel.formats.usd.materials import StageMaterials
from meshreel.formats.usd.meshes import (
    InstancedMesh,
    MeshNotes,
    MeshTracks,
    StageMesh,
    find_skins,
    note_instances,
    shape_of,
)
from meshreel.formats.usd.rendered import (
    Placements,
    RenderedMesh,
    Transforms,
    rendered_meshes,
)
from meshreel.formats.usd.sampling import (
    TOLERANCE,
    Codes,
    Samples,
    even_interval,
    frame_grid,
    snap,
)
from meshreel.formats.usd.stage import (
    DAMAGED,
    DEFAULT_RATE,
    MAX_RATE,
    MIN_RATE,
    check_used_layers,
    checked_layers,
    codes_per_second,
    layer_number,
    usd_errors,
)
from meshreel.model.validation import validate_fps
from meshreel.runtime.extras import USD

AnyMesh = StageMesh | InstancedMesh

MAX_FRAME_RATE = 120.0
"""Time codes per second above which a code is not a frame, unless the stage has a frame rate."""

MAX_LISTED = 3


def read_meshes(path: Path, options: ReadOptions) -> list[SceneMesh]:
    """Return the meshes of a USD file.

    With a frame rate in the options, if any mesh moves between its samples, all meshes are sampled
    at that rate, from the first sample of the file to the last.

    Raises
    ------
    FormatError
        If USD cannot read the file, or it contains no mesh that is rendered.
    """
    notes = options.notes
    stage = open_stage(path, options)
    with usd_errors("USD cannot read its meshes"):
        rate = codes_per_second(stage.GetRootLayer())
        rendered = rendered_meshes(stage, notes)
        transforms, skins = Transforms(), find_skins(one.prim for one in rendered)
        materials = StageMaterials(None if options.allow_outside else path.parent, notes)
        mesh_notes = MeshNotes(notes)

        def stage_mesh(rendered: RenderedMesh) -> AnyMesh:
            skin = skins.get(str(rendered.prim.GetPath()))
            above = rendered.levels[-1].to_root if rendered.levels else transforms
            mesh = StageMesh(stage, shape_of(rendered.prim), skin, above, materials, mesh_notes)
            if not rendered.levels:
                return mesh
            return InstancedMesh(rendered.name, mesh, Placements(rendered.levels, transforms))

        meshes = [stage_mesh(one) for one in rendered]
        note_instances([one for one in meshes if isinstance(one, InstancedMesh)], notes)
        has_rate = stage.HasAuthoredMetadata("timeCodesPerSecond")
        codes_of = _frame_codes(meshes, rate, codes_per_frame(stage, rate), options)

    def scene_mesh(mesh: AnyMesh) -> SceneMesh:
        with usd_errors(f"USD cannot read {mesh.path}"):
            return _scene_mesh(mesh, codes_of(mesh), rate, notes, has_rate=has_rate)

    return [read_or_defer_error(mesh.path, partial(scene_mesh, mesh)) for mesh in meshes]


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
    tracks = MeshTracks(mesh, codes, notes)
    return SceneMesh(
        mesh.path,
        snap(codes) / rate,
        lambda index: mesh.frame(float(codes[index])),
        lambda index: mesh.surface(float(codes[index]), tracks.animated),
        fps,
        tracks.tracks,
    )


def _frame_codes(
    meshes: Sequence[AnyMesh], rate: float, frame_interval: float, options: ReadOptions
) -> Callable[[AnyMesh], Codes]:
    """Return a function that gives the time codes of the frames of a mesh, empty if static."""
    samples = [one for mesh in meshes if (one := _samples(mesh)) is not None]
    interpolated = [one.all for one in samples if one.moves_between_samples(frame_interval)]
    if (fps := validate_fps(options.fps or 0.0)) and interpolated:
        grid = cache(lambda: _common_grid([one.all for one in samples], rate / fps))

        def common_codes(mesh: AnyMesh) -> Codes:
            if len(mesh.samples.all) < 2:
                return mesh.samples.all
            _note_final(mesh, grid(), max(float(one.all[-1]) for one in samples if len(one.all)))
            return grid()

        return common_codes
    origin = min((float(one[0]) for one in interpolated), default=0.0)

    def codes_of(mesh: AnyMesh) -> Codes:
        codes = mesh.samples.frames(frame_interval, origin)
        if len(codes) != (n_samples := len(mesh.samples.all)):
            mesh.notes.sampled.add(f"{mesh.path} ({n_samples} samples, {len(codes)} frames)")
        if n_samples:
            _note_final(mesh, codes, float(mesh.samples.all[-1]))
        return codes

    return codes_of


def _note_final(mesh: AnyMesh, codes: Codes, last: float) -> None:
    """Note a mesh whose last sample is between two frames, and is shown by the later one."""
    if codes[-1] > last + TOLERANCE:
        mesh.notes.final.add(f"{mesh.path} (time code {last:g}, shown at {codes[-1]:g})")


def _samples(mesh: AnyMesh) -> Samples | None:
    """Return the samples of a mesh, or None if they are invalid."""
    try:
        _ = mesh.samples.all
    except FormatError:
        return None
    return mesh.samples


def _common_grid(samples: Sequence[Codes], interval: float) -> Codes:
    """Return the common frames of all animated meshes, from the first sample to the last."""
    animated = [one for one in samples if len(one) > 1]
    first, last = min(one[0] for one in animated), max(one[-1] for one in animated)
    return frame_grid(float(first), float(last), interval)


def open_stage(path: Path, options: ReadOptions) -> Any:
    """Return the ``Usd.Stage`` of the current file on disk.

    Parameters
    ----------
    options : ReadOptions
        Their notes gain a sentence if referenced files are missing, and one if axes or units
        differ from y up and meters.

    Raises
    ------
    FormatError
        If USD cannot read the file, a rate is invalid, or layers are outside of its folder.
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
    """Return the time codes per frame of a stage with `rate` time codes per second.

    Without a frame rate, it is one code per frame, unless codes are much finer than frames: then
    the default frame rate applies.
    """
    fps = layer_number(stage.GetRootLayer(), "framesPerSecond")
    if fps is not None and MIN_RATE <= fps <= MAX_RATE:
        return rate / fps
    return 1.0 if rate <= MAX_FRAME_RATE else rate / DEFAULT_RATE


def _note_missing(stage: Any, notes: list[str]) -> None:
    problems = [" ".join(str(error).split()) for error in stage.GetCompositionErrors()]
    if problems:
        more = f" and {len(problems) - MAX_LISTED} more" if len(problems) > MAX_LISTED else ""
        listed = "; ".join(one.rstrip(".") for one in problems[:MAX_LISTED])
        notes.append(f"the file refers to missing or invalid data: {listed}{more}")


def _note_axes(stage: Any, notes: list[str]) -> None:
    geometry = USD.load("UsdGeom")
    differences = []
    if geometry.GetStageUpAxis(stage) == geometry.Tokens.z:
        differences.append("z points up")
    meters = layer_number(stage.GetRootLayer(), geometry.Tokens.metersPerUnit)
    if meters not in (None, 1):
        differences.append(f"a unit is {meters:g} m")
    if differences:
        facts = ", ".join(differences)
        notes.append(f"positions stay in the axes and units of the file, where {facts}")
